// SPDX-License-Identifier: Apache-2.0
// zlib's inflate behind bounds. libarchive's own gzip filter checks neither the checksum nor the ratio.
#include "core/file/gzip_reader.h"

#include <zlib.h>

#include <algorithm>
#include <fstream>
#include <limits>
#include <new>
#include <optional>
#include <stop_token>
#include <string>
#include <system_error>
#include <thread>
#include <utility>
#include <vector>

#include "core/file/file.h"
#include "core/system/error.h"
#include "core/system/worker.h"

namespace tg {
namespace {

constexpr std::uint64_t kMaxRatio = 1000;
constexpr std::uint64_t kRatioFreeBytes = 1 << 20;
constexpr std::size_t kInputBytes = 1 << 16;
constexpr std::size_t kLeastOutputBytes = 1 << 16, kMostOutputBytes = 1 << 20;
constexpr std::size_t kPiecesAhead = 4;

}  // namespace

struct GzipReader::State {
  std::string path;
  std::ifstream file;
  std::uint64_t max_inflated = 0;
  std::uint64_t file_size = 0;
  std::uint64_t bytes_in = 0;
  std::uint64_t bytes_out = 0;
  std::vector<std::uint8_t> input = std::vector<std::uint8_t>(kInputBytes);
  ByteProgress* progress = nullptr;
  z_stream stream{};
  bool started = false;
  bool finished = false;

  ~State() {
    if (started) inflateEnd(&stream);
  }
  [[noreturn]] void fail(const std::string& what) const { throw Error(ErrorKind::badData, path, what); }

  // False at the end of the file.
  bool refill() {
    file.read(reinterpret_cast<char*>(input.data()), static_cast<std::streamsize>(input.size()));
    if (file.bad()) throw Error(ErrorKind::cannotRead, path, "cannot read");
    stream.next_in = input.data();
    stream.avail_in = static_cast<uInt>(file.gcount());
    if (progress) progress->advance(stream.avail_in);
    return stream.avail_in > 0;
  }

  // Whether another stream follows the one that ended (RFC 1952, section 2.2: a file is one or more).
  bool anotherStream() { return (stream.avail_in > 0 || refill()) && *stream.next_in == 0x1f; }

  // Fills `output`, which is shorter at the end and empty after it.
  void inflateNext(std::vector<std::uint8_t>& output);
};

// The next pieces, in order. Pieces that have been taken come back to be filled again.
class GzipReader::Ahead {
 public:
  explicit Ahead(State& state)
      : thread_(startWorker(pieces_, [this, &state](const std::stop_token& stop) {
          Piece piece;
          do {
            piece = free_.poll().value_or(Piece());
            state.inflateNext(piece);
          } while (!piece.empty() && pieces_.give(std::move(piece), stop));
        })) {}

  // Valid until the next call.
  std::span<const std::uint8_t> next() {
    std::optional<Piece> piece = pieces_.take();
    if (!piece) return {};
    free_.give(std::exchange(taken_, std::move(*piece)));
    return taken_;
  }

 private:
  using Piece = std::vector<std::uint8_t>;
  Queue<Piece> pieces_{kPiecesAhead - 1};  // and one that waits to be among them
  LatestValue<Piece> free_;
  Piece taken_;
  std::jthread thread_;
};

GzipReader::GzipReader(const std::filesystem::path& path, std::uint64_t max_inflated_bytes, ByteProgress* progress)
    : state_(std::make_unique<State>()) {
  State& s = *state_;
  s.path = path.string();
  s.max_inflated = max_inflated_bytes;
  std::error_code status;
  const std::filesystem::file_type type = std::filesystem::status(path, status).type();
  if (type == std::filesystem::file_type::directory) {
    throw Error(ErrorKind::cannotRead, s.path, "is a folder (expected a file)");
  }
  if (!status && type != std::filesystem::file_type::regular) {  // to open a pipe would wait
    throw Error(ErrorKind::cannotRead, s.path, "is no regular file");
  }
  s.file.open(path, std::ios::binary);
  if (!s.file) throw Error(ErrorKind::cannotRead, s.path, "cannot open");
  s.file_size = std::filesystem::file_size(path, status);
  if (status) throw Error(ErrorKind::cannotRead, s.path, "cannot read: " + status.message());
  if (inflateInit2(&s.stream, 15 + 16) != Z_OK) throw std::bad_alloc();
  s.started = true;
  s.progress = progress;
  if (progress) progress->total = s.file_size;
  ahead_ = std::make_unique<Ahead>(s);
}

GzipReader::~GzipReader() = default;

std::uint64_t GzipReader::inflatedBound() const {
  const std::uint64_t size = state_->file_size;
  const bool wraps = size > std::numeric_limits<std::uint64_t>::max() / 2 / kMaxRatio;
  return wraps ? size : size * kMaxRatio + kRatioFreeBytes + kMostOutputBytes;
}

bool GzipReader::hasTrailingBytes() const {
  State& s = *state_;
  return s.finished && (s.stream.avail_in > 0 || s.refill());
}

std::span<const std::uint8_t> GzipReader::next() { return ahead_->next(); }

void GzipReader::State::inflateNext(std::vector<std::uint8_t>& output) {
  output.clear();
  if (finished) return;
  // As much again as there was: a small file costs a small piece.
  output.resize(std::clamp<std::size_t>(bytes_out, kLeastOutputBytes, kMostOutputBytes));
  stream.next_out = output.data();
  stream.avail_out = static_cast<uInt>(output.size());
  while (stream.avail_out > 0 && !finished) {
    if (stream.avail_in == 0 && !refill()) {
      if (bytes_in == 0) fail("is empty (expected a gzip stream)");
      fail("gzip stream ends early");
    }
    const uInt before = stream.avail_in;
    const int result = inflate(&stream, Z_NO_FLUSH);
    bytes_in += before - stream.avail_in;
    if (result == Z_STREAM_END) {
      finished = !anotherStream();
      if (!finished) inflateReset(&stream);
    } else if (result != Z_OK) {
      fail(std::string("broken gzip stream: ") + (stream.msg ? stream.msg : "unexpected data"));
    }
  }
  output.resize(output.size() - stream.avail_out);
  bytes_out += output.size();
  if (bytes_out > kRatioFreeBytes && bytes_out / kMaxRatio > bytes_in) {
    fail("inflates more than " + std::to_string(kMaxRatio) + " : 1");
  }
  if (bytes_out > max_inflated) {
    fail("inflates to more than the limit (expected at most " + std::to_string(max_inflated) + " bytes)");
  }
}

}  // namespace tg
