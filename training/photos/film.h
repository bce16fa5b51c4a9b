// SPDX-License-Identifier: Apache-2.0
// Which frames of a film are worth keeping, and the command lines of ffmpeg.
#pragma once
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace tg {

constexpr int kJudgedSide = 720;  // [px] of the grey squares that frames are judged as, whatever their shape

// The variance of the Laplacian over a grey picture of kJudgedSide rows and columns: the blurred have less of it.
double sharpness(std::span<const std::uint8_t> grey);

// Frames as they come out of a pipe, in pieces of any size.
class SharpnessMeter {
 public:
  void add(std::span<const std::uint8_t> bytes);
  const std::vector<double>& frames() const { return frames_; }

 private:
  std::vector<std::uint8_t> frame_;
  std::vector<double> frames_;
};

// The sharpest of each of `count` stretches of equal length, in order; all where there are no more.
std::vector<std::size_t> sharpestFrames(std::span<const double> sharpness, std::size_t count);

// Arguments of ffmpeg: every frame as a grey square to standard output; those frames as `folder`/%06d.jpg, counted from
// 1, no side longer than `longest` [px] (0: any).
std::vector<std::string> judgeFrames(const std::string& ffmpeg, const std::filesystem::path& film);
std::vector<std::string> extractFrames(const std::string& ffmpeg, const std::filesystem::path& film,
                                       std::span<const std::size_t> frames, int longest,
                                       const std::filesystem::path& folder);

// What ffmpeg says of a film before it begins: how long, how many frames a second.
class FilmLength {
 public:
  void read(std::string_view line);
  std::size_t frames() const { return static_cast<std::size_t>(seconds_ * per_second_); }  // 0: not said

 private:
  double seconds_ = 0;
  double per_second_ = 0;
};

}  // namespace tg
