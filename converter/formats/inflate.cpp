// SPDX-License-Identifier: Apache-2.0
// gzip by zlib, Zstandard by libzstd.
#include "converter/formats/inflate.h"

#include <zlib.h>
#include <zstd.h>
#include <zstd_errors.h>

#include <algorithm>
#include <new>
#include <utility>

#include "core/system/error.h"

namespace tg {
namespace {

constexpr std::uint64_t kMaxDeflateRatio = 1032;
constexpr std::size_t kPieceBytes = 1 << 20;

}  // namespace

bool isPadding(std::span<const std::uint8_t> bytes) {
  return std::ranges::all_of(bytes, [](std::uint8_t byte) { return byte == 0; });
}

struct GzipBytes::State {
  std::string path;
  std::uint64_t packed_bytes = 0;
  std::span<const std::uint8_t> left;  // not yet given to zlib, whose counters have 32 bits
  z_stream stream{};
  bool finished = false;

  ~State() { inflateEnd(&stream); }

  // Another member may follow (RFC 1952, section 2.2), or zeros to the end, which gzip(1) passes over, too.
  void endMember() {
    left = {stream.next_in, stream.avail_in + left.size()};
    stream.avail_in = 0;
    finished = isPadding(left);
    if (finished) return;
    if (left.size() < 2 || left[0] != 0x1f || left[1] != 0x8b) {
      throw Error(ErrorKind::badData, path,
                  std::to_string(left.size()) + " bytes follow the gzip stream (expected none)");
    }
    inflateReset(&stream);
  }

  // Fills as much of `out` as the stream has.
  std::size_t read(std::uint8_t* out, std::size_t size) {
    stream.next_out = out;
    stream.avail_out = static_cast<uInt>(size);
    while (stream.avail_out > 0 && !finished) {
      if (stream.avail_in == 0) {
        const std::size_t piece = std::min(left.size(), kPieceBytes);
        if (piece == 0) throw Error(ErrorKind::badData, path, "gzip stream ends early");
        stream.next_in = const_cast<std::uint8_t*>(left.data());
        stream.avail_in = static_cast<uInt>(piece);
        left = left.subspan(piece);
      }
      const int result = inflate(&stream, Z_NO_FLUSH);
      if (result == Z_STREAM_END) {
        endMember();
      } else if (result != Z_OK) {
        throw Error(ErrorKind::badData, path,
                    std::string("broken gzip stream: ") + (stream.msg ? stream.msg : "unexpected data"));
      }
    }
    return size - stream.avail_out;
  }
};

GzipBytes::GzipBytes(std::span<const std::uint8_t> bytes, std::string path) : state_(std::make_unique<State>()) {
  state_->path = std::move(path);
  state_->packed_bytes = bytes.size();
  state_->left = bytes;
  if (inflateInit2(&state_->stream, 15 + 16) != Z_OK) throw std::bad_alloc();
}

GzipBytes::~GzipBytes() = default;

std::vector<std::uint8_t> GzipBytes::take(std::uint64_t size, const std::string& what) {
  const auto shorter = [&](std::uint64_t found) {
    return Error(
        ErrorKind::badData, state_->path,
        what + " ends early (expected " + std::to_string(size) + " bytes, found " + std::to_string(found) + ")");
  };
  if (size / kMaxDeflateRatio > state_->packed_bytes) throw shorter(state_->packed_bytes * kMaxDeflateRatio);
  std::vector<std::uint8_t> bytes(size);
  for (std::size_t done = 0; done < size;) {
    const std::size_t piece = std::min<std::size_t>(bytes.size() - done, kPieceBytes);
    const std::size_t got = state_->read(bytes.data() + done, piece);
    done += got;
    if (got < piece) throw shorter(done);
  }
  return bytes;
}

std::vector<std::uint8_t> GzipBytes::takeRest(std::uint64_t limit) {
  std::vector<std::uint8_t> piece(kPieceBytes);
  std::vector<std::uint8_t> bytes;
  while (!state_->finished) {
    const std::size_t got = state_->read(piece.data(), piece.size());
    bytes.insert(bytes.end(), piece.begin(), piece.begin() + static_cast<std::ptrdiff_t>(got));
    if (bytes.size() > limit) {
      throw Error(ErrorKind::badData, state_->path,
                  "too many bytes after the splats (expected at most " + std::to_string(limit) + ")");
    }
  }
  return bytes;
}

std::vector<std::uint8_t> unpackZstandard(std::span<const std::uint8_t> bytes, std::uint64_t size,
                                          const std::string& path, const std::string& what) {
  std::vector<std::uint8_t> out(size);
  const std::size_t got = ZSTD_decompress(out.data(), out.size(), bytes.data(), bytes.size());
  const auto fail = [&](const std::string& why) { throw Error(ErrorKind::badData, path, what + " " + why); };
  if (ZSTD_getErrorCode(got) == ZSTD_error_memory_allocation) throw std::bad_alloc();
  if (ZSTD_getErrorCode(got) == ZSTD_error_dstSize_tooSmall) {
    fail("is too long (expected " + std::to_string(size) + " bytes, found more)");
  }
  if (ZSTD_isError(got)) fail(std::string("is broken: ") + ZSTD_getErrorName(got));
  if (got != size) fail("ends early (expected " + std::to_string(size) + " bytes, found " + std::to_string(got) + ")");
  return out;
}

}  // namespace tg
