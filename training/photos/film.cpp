// SPDX-License-Identifier: Apache-2.0
// Laplacians, stretches, arguments.
#include "training/photos/film.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "core/system/assert.h"
#include "core/system/numbers.h"
#include "core/system/parallel.h"

namespace tg {
namespace {

constexpr double kAlmostSquare = 0.005;  // what rounded sides make of squares, too little to resample for
constexpr std::size_t kJudgedBytes = std::size_t{kJudgedSide} * kJudgedSide;

// ffmpeg takes "a:b" for a protocol and "-x" for an option.
std::string fileWord(const std::filesystem::path& path) { return "file:" + std::filesystem::absolute(path).string(); }

}  // namespace

double sharpness(std::span<const std::uint8_t> grey) {
  TG_ASSERT(grey.size() == kJudgedBytes, "a grey square");
  std::vector<double> sums(kJudgedSide, 0.0), squares(kJudgedSide, 0.0);
  parallelFor(kJudgedSide - 2, 32, [&](std::int64_t row) {
    const std::uint8_t* const at = grey.data() + (row + 1) * kJudgedSide;
    std::int64_t sum = 0, square = 0;
    for (int x = 1; x < kJudgedSide - 1; ++x) {
      const int value = 4 * at[x] - at[x - 1] - at[x + 1] - at[x - kJudgedSide] - at[x + kJudgedSide];
      sum += value;
      square += value * value;
    }
    sums[row] = static_cast<double>(sum);
    squares[row] = static_cast<double>(square);
  });
  double sum = 0, square = 0;
  for (int row = 0; row < kJudgedSide; ++row) {
    sum += sums[row];
    square += squares[row];
  }
  const double count = double(kJudgedSide - 2) * (kJudgedSide - 2);
  return square / count - sum / count * (sum / count);
}

void SharpnessMeter::add(std::span<const std::uint8_t> bytes) {
  while (!bytes.empty()) {
    const std::size_t taken = std::min(bytes.size(), kJudgedBytes - frame_.size());
    frame_.insert(frame_.end(), bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(taken));
    bytes = bytes.subspan(taken);
    if (frame_.size() < kJudgedBytes) return;
    frames_.push_back(sharpness(frame_));
    frame_.clear();
  }
}

std::vector<std::size_t> sharpestFrames(std::span<const double> sharpness, std::size_t count) {
  std::vector<std::size_t> chosen;
  count = std::min(count, sharpness.size());
  for (std::size_t i = 0; i < count; ++i) {
    const auto begin = sharpness.begin() + static_cast<std::ptrdiff_t>(i * sharpness.size() / count);
    const auto end = sharpness.begin() + static_cast<std::ptrdiff_t>((i + 1) * sharpness.size() / count);
    chosen.push_back(static_cast<std::size_t>(std::max_element(begin, end) - sharpness.begin()));
  }
  return chosen;
}

namespace {

// The film's first stream of moving pictures (V: no cover) through a filter, a picture out for each that the filter
// lets through. Before it, frames that say so are put together from their two fields, which takes the frames around
// them; the others pass as they are. What is said of the stream as a whole is often wrong.
std::vector<std::string> filtered(const std::string& ffmpeg, const std::filesystem::path& film,
                                  const std::string& filter) {
  return {ffmpeg,      "-nostdin",     "-hide_banner",
          "-i",        fileWord(film), "-map",
          "0:V:0",     "-vf",          "bwdif=mode=send_frame:deint=interlaced," + filter,
          "-fps_mode", "passthrough"};
}

// Not 0 for these frames. ffmpeg takes at most 100 terms of a sum in a row, hence the brackets.
std::string anyOf(std::span<const std::size_t> frames) {
  if (frames.size() == 1) return "eq(n," + std::to_string(frames.front()) + ")";
  const std::size_t half = frames.size() / 2;
  return "(" + anyOf(frames.first(half)) + "+" + anyOf(frames.subspan(half)) + ")";
}

// toneMapped() of hdr.h in ffmpeg's words. It goes through linear light without subsampling, as sides may be odd.
std::string toneMap(const FilmFacts& facts) {
  const std::string white = formatted("npl=%.0f", kPaperWhite);
  return "format=yuv444p10le,zscale=t=linear:" + white + (facts.saysColours() ? "" : ":pin=bt2020:min=bt2020nc") +
         ":tin=" + (facts.transfer() == Transfer::pq ? "smpte2084" : "arib-std-b67") +
         ",format=gbrpf32le,zscale=p=bt709,tonemap=mobius:desat=0" +
         formatted(":param=%g:peak=%.4f", kUnchanged, kBrightest / kPaperWhite) + ",zscale=t=bt709:" + white +
         ",format=gbrp";
}

}  // namespace

std::vector<std::string> listFilters(const std::string& ffmpeg) { return {ffmpeg, "-hide_banner", "-filters"}; }

std::vector<std::string> judgeFrames(const std::string& ffmpeg, const std::filesystem::path& film) {
  const std::string side = std::to_string(kJudgedSide);
  std::vector<std::string> command = filtered(ffmpeg, film, "scale=" + side + ":" + side + ":flags=area,format=gray");
  command.insert(command.end(), {"-f", "rawvideo", "-"});
  return command;
}

std::vector<std::string> extractFrames(const std::string& ffmpeg, const std::filesystem::path& film,
                                       std::span<const std::size_t> frames, int longest,
                                       const std::filesystem::path& folder, const FilmFacts& facts, bool mapped) {
  TG_ASSERT(!frames.empty(), "frames to take");
  // A JPEG has BT.601's colours, whatever the film has.
  std::string filter = "select='" + anyOf(frames) + "',";
  if (!facts.pixelShape().empty()) filter += "scale=w='round(iw*sar)':h=ih,";
  filter += "scale=out_color_matrix=bt601:flags=area";
  if (longest > 0) {
    const std::string most = std::to_string(longest);
    filter += ":w='min(iw," + most + ")':h='min(ih," + most + ")':force_original_aspect_ratio=decrease";
  }
  if (mapped && facts.transfer() != Transfer::sdr) filter += "," + toneMap(facts);
  // A pattern may not hold a name of the user's: '%' counts in it.
  std::string pattern = folder.string();
  for (std::size_t at = 0; (at = pattern.find('%', at)) != pattern.npos; at += 2) pattern.insert(at, 1, '%');
  std::vector<std::string> command = filtered(ffmpeg, film, filter);
  command.insert(command.end(), {"-q:v", "2", "-f", "image2", "-y", "file:" + pattern + "/%06d.jpg"});
  return command;
}

void FilmFacts::read(std::string_view line) {
  if (const std::size_t at = line.find("Duration: "); at != line.npos && line.size() >= at + 21) {
    const auto hours = parseWhole<double>(line.substr(at + 10, 2)),
               minutes = parseWhole<double>(line.substr(at + 13, 2)),
               seconds = parseWhole<double>(line.substr(at + 16, 5));
    if (hours && minutes && seconds) seconds_ = *hours * 3600 + *minutes * 60 + *seconds;
  }
  opened_ |= line.starts_with("Input #");
  const bool cover = line.find("(attached pic)") != line.npos;
  if (seen_ || cover || line.find("Stream #") == line.npos || line.find("Video: ") == line.npos) return;
  seen_ = true;
  if (const std::size_t at = line.find(" fps,"); at != line.npos) {
    const std::size_t begin = line.rfind(' ', at - 1) + 1;
    if (const auto rate = parseWhole<double>(line.substr(begin, at - begin)); rate && *rate > 0 && *rate < 1e4) {
      per_second_ = *rate;
    }
  }
  // "720x576 [SAR 16:15 DAR 4:3], SAR 64:45 DAR 16:9": of the codec and, where it says otherwise, of the container
  if (const std::size_t at = line.rfind("SAR "); at != line.npos) {
    const std::string_view shape = line.substr(at + 4, line.find(' ', at + 4) - at - 4);
    const std::size_t colon = shape.find(':');
    const auto wide = parseWhole<double>(shape.substr(0, colon));
    const auto high = colon == shape.npos ? std::nullopt : parseWhole<double>(shape.substr(colon + 1));
    if (wide && high && *high > 0 && std::abs(*wide / *high - 1) > kAlmostSquare) pixel_shape_ = shape;
  }
  // "yuv420p10le(tv, bt2020nc/bt2020/arib-std-b67)"
  for (const auto& [word, transfer] :
       {std::pair("/smpte2084", Transfer::pq), std::pair("/arib-std-b67", Transfer::hlg)}) {
    const std::size_t at = line.find(word);
    if (at == line.npos) continue;
    transfer_ = transfer;
    const std::size_t begin = line.rfind(' ', at) + 1;
    says_colours_ = line.substr(begin, at - begin).find("unknown") == line.npos;
  }
}

void FilterList::read(std::string_view line) {
  zscale_ |= line.find(" zscale ") != line.npos;
  tonemap_ |= line.find(" tonemap ") != line.npos;
}

}  // namespace tg
