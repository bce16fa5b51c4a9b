// SPDX-License-Identifier: Apache-2.0
// The tail of a file.
#include "core/run/curves.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/system/descriptor.h"

namespace tg {
namespace {

constexpr std::size_t kMaxLine = 4096;  // [bytes] longer ones are none of ours
constexpr std::size_t kPiece = 1 << 16;

}  // namespace

void addThinned(std::vector<RunMetrics>& lines, RunMetrics line) {
  lines.push_back(std::move(line));
  if (lines.size() <= kMaxCurveLines) return;
  std::size_t number = 0, kept = 0;
  for (RunMetrics& old : lines) {
    if (old.test_psnr || number++ % 2 == 1) std::swap(lines[kept++], old);
  }
  // Of nothing but test scores every second goes, too.
  if (kept > kMaxCurveLines) {
    for (kept = 0; 2 * kept + 1 < lines.size(); ++kept) std::swap(lines[kept], lines[2 * kept + 1]);
  }
  lines.resize(kept);
}

std::vector<double> iterationsOfRun(const std::vector<RunMetrics>& lines) {
  std::vector<double> at;
  double before = 0, last = 0;
  const std::string* stage = nullptr;
  for (const RunMetrics& line : lines) {
    if (stage && line.stage != *stage) before = last;
    stage = &line.stage;
    last = std::max(last, before + line.iteration);
    at.push_back(before + line.iteration);
  }
  return at;
}

std::optional<std::pair<double, double>> rangeOfCurves(std::vector<double> lines, std::span<const double> dots) {
  if (lines.empty() && dots.empty()) return std::nullopt;
  std::sort(lines.begin(), lines.end());
  const std::size_t cut = lines.size() / 100;
  double low = lines.empty() ? dots.front() : lines[cut], high = lines.empty() ? low : lines[lines.size() - 1 - cut];
  for (const double dot : dots) {
    low = std::min(low, dot);
    high = std::max(high, dot);
  }
  return std::pair(low, high);
}

std::pair<double, double> withRoom(std::pair<double, double> range) {
  const auto [low, high] = range;
  const bool apart = high - low > 1e-9 * std::max(std::abs(low), std::abs(high));  // or axes have no numbers between
  const double room = apart ? 0.05 * (high - low) : std::max(0.1 * std::abs(high), 1e-6);
  return {low - room, high + room};
}

void MetricsFile::clear() {
  lines_.clear();
  rest_.clear();
  read_ = 0;
}

bool MetricsFile::update() {
  const Descriptor file(::open(path_.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK));
  struct stat status{};
  if (file.get() < 0 || ::fstat(file.get(), &status) != 0 || !S_ISREG(status.st_mode)) {
    const bool had = !lines_.empty();
    clear();
    return had;
  }
  bool changed = false;
  const auto device = static_cast<std::uint64_t>(status.st_dev), inode = static_cast<std::uint64_t>(status.st_ino);
  const auto size = static_cast<std::uint64_t>(std::max<off_t>(status.st_size, 0));
  if (device != device_ || inode != inode_ || size < read_) {
    changed = !lines_.empty();
    clear();
    device_ = device;
    inode_ = inode;
  }
  std::string piece(kPiece, '\0');
  while (read_ < size) {
    const ssize_t got = ::pread(file.get(), piece.data(), piece.size(), static_cast<off_t>(read_));
    if (got <= 0) break;
    read_ += static_cast<std::uint64_t>(got);
    std::string_view text(piece.data(), static_cast<std::size_t>(got));
    for (std::size_t end = text.find('\n'); end != text.npos; end = text.find('\n')) {
      if (rest_.size() + end <= kMaxLine) {
        rest_ += text.substr(0, end);
        if (std::optional<RunMetrics> line = parseMetrics(rest_)) {
          addThinned(lines_, std::move(*line));
          changed = true;
        }
      }
      rest_.clear();
      text.remove_prefix(end + 1);
    }
    // What is longer than any line stays too long until its end comes.
    if (rest_.size() <= kMaxLine) rest_ += text;
  }
  return changed;
}

}  // namespace tg
