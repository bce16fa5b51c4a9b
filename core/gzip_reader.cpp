// SPDX-License-Identifier: Apache-2.0
// zlib's inflate behind bounds. libarchive's own gzip filter checks neither the checksum nor the ratio.
#include "core/gzip_reader.h"

#include <zlib.h>

#include <fstream>
#include <limits>
#include <string>
#include <system_error>
#include <vector>

#include "core/error.h"

namespace tg {
namespace {

constexpr std::uint64_t kMaxRatio = 1000;
constexpr std::uint64_t kRatioFreeBytes = 1 << 20;
constexpr std::size_t kInputBytes = 1 << 16;
constexpr std::size_t kOutputBytes = 1 << 18;

}  // namespace

struct GzipReader::State {
  std::string path;
  std::ifstream file;
  std::uint64_t max_inflated = 0;
  std::uint64_t file_size = 0;
  std::uint64_t bytes_in = 0;
  std::uint64_t bytes_out = 0;
  std::vector<std::uint8_t> input = std::vector<std::uint8_t>(kInputBytes);
  std::vector<std::uint8_t> output = std::vector<std::uint8_t>(kOutputBytes);
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
    return stream.avail_in > 0;
  }
};

GzipReader::GzipReader(const std::filesystem::path& path, std::uint64_t max_inflated_bytes)
    : state_(std::make_unique<State>()) {
  State& s = *state_;
  s.path = path.string();
  s.max_inflated = max_inflated_bytes;
  std::error_code status;
  if (std::filesystem::is_directory(path, status))
    throw Error(ErrorKind::cannotRead, s.path, "is a folder (expected a file)");
  s.file.open(path, std::ios::binary);
  if (!s.file) throw Error(ErrorKind::cannotRead, s.path, "cannot open");
  s.file_size = std::filesystem::file_size(path, status);
  if (status) throw Error(ErrorKind::cannotRead, s.path, "is not a regular file");
  if (inflateInit2(&s.stream, 15 + 16) != Z_OK) throw Error(ErrorKind::cannotRead, s.path, "cannot start zlib");
  s.started = true;
}

GzipReader::~GzipReader() = default;

std::uint64_t GzipReader::inflatedBound() const {
  const std::uint64_t size = state_->file_size;
  const bool wraps = size > std::numeric_limits<std::uint64_t>::max() / 2 / kMaxRatio;
  return wraps ? size : size * kMaxRatio + kRatioFreeBytes + kOutputBytes;
}

bool GzipReader::hasTrailingBytes() const {
  State& s = *state_;
  return s.finished && (s.stream.avail_in > 0 || s.refill());
}

std::span<const std::uint8_t> GzipReader::next() {
  State& s = *state_;
  if (s.finished) return {};
  s.stream.next_out = s.output.data();
  s.stream.avail_out = static_cast<uInt>(s.output.size());
  while (s.stream.avail_out > 0 && !s.finished) {
    if (s.stream.avail_in == 0 && !s.refill()) {
      if (s.bytes_in == 0) s.fail("is empty (expected a gzip stream)");
      s.fail("gzip stream ends early");
    }
    const uInt before = s.stream.avail_in;
    const int result = inflate(&s.stream, Z_NO_FLUSH);
    s.bytes_in += before - s.stream.avail_in;
    if (result == Z_STREAM_END)
      s.finished = true;
    else if (result != Z_OK)
      s.fail(std::string("broken gzip stream: ") + (s.stream.msg ? s.stream.msg : "unexpected data"));
  }
  const std::size_t produced = s.output.size() - s.stream.avail_out;
  s.bytes_out += produced;
  if (s.bytes_out > kRatioFreeBytes && s.bytes_out / kMaxRatio > s.bytes_in)
    s.fail("inflates more than " + std::to_string(kMaxRatio) + " : 1");
  if (s.bytes_out > s.max_inflated)
    s.fail("inflates to more than the limit (expected at most " + std::to_string(s.max_inflated) + " bytes)");
  return std::span(s.output).first(produced);
}

}  // namespace tg
