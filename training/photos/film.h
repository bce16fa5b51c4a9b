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

#include "training/photos/hdr.h"

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

// What ffmpeg says of a film before it begins, line by line; of its first stream of pictures.
class FilmFacts {
 public:
  void read(std::string_view line);
  std::size_t frames() const { return static_cast<std::size_t>(seconds_ * per_second_); }  // 0: not said
  bool onlySound() const { return opened_ && !seen_; }
  Transfer transfer() const { return transfer_; }
  bool saysColours() const { return says_colours_; }  // whether primaries and matrix of HDR are in the stream
  const std::string& pixelShape() const { return pixel_shape_; }  // "4:3" of pixels that are no squares, else ""

 private:
  double seconds_ = 0;
  double per_second_ = 0;
  Transfer transfer_ = Transfer::sdr;
  bool says_colours_ = false;
  std::string pixel_shape_;
  bool opened_ = false;  // a file that it can read
  bool seen_ = false;    // the line of that stream
};

// Whether a list of ffmpeg's filters, told line by line, has those that map HDR to a common screen.
class FilterList {
 public:
  void read(std::string_view line);
  bool mapsTones() const { return zscale_ && tonemap_; }

 private:
  bool zscale_ = false, tonemap_ = false;
};

// Arguments of ffmpeg: its filters; every frame as a grey square to standard output; of the same frames those frames as
// `folder`/%06d.jpg, counted from 1, with square pixels and without interlacing, no side longer than `longest` [px]
// (0: any), `mapped` to a common screen if the film is in HDR.
std::vector<std::string> listFilters(const std::string& ffmpeg);
std::vector<std::string> judgeFrames(const std::string& ffmpeg, const std::filesystem::path& film);
std::vector<std::string> extractFrames(const std::string& ffmpeg, const std::filesystem::path& film,
                                       std::span<const std::size_t> frames, int longest,
                                       const std::filesystem::path& folder, const FilmFacts& facts, bool mapped);

}  // namespace tg
