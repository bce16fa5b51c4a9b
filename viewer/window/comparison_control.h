// SPDX-License-Identifier: Apache-2.0
// The comparison in the window: with what, how far apart, flickering, and the line of a wipe under the pointer.
#pragma once
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "viewer/picture/metrics_thread.h"
#include "viewer/picture/photographs.h"
#include "viewer/picture/picture.h"
#include "viewer/view/options.h"
#include "viewer/view/state.h"
#include "viewer/window/screen.h"

namespace tg {

class ComparisonControl {
 public:
  // Looks through options.photographs; throws what Photographs throws, but with options.follow: a run that can be
  // watched without its photographs is. `wake` is called in another thread when a picture has been measured.
  ComparisonControl(const ViewOptions& options, std::function<void()> wake);

  const std::optional<Photographs>& photographs() const { return photographs_; }
  // Why there are none; "": there are, or nobody asked for them.
  const std::string& withoutPhotographs() const { return without_photographs_; }

  // Why there is nothing to compare with, and what to do about it, as in CompareState.
  struct Problem {
    std::string what, way_out;
  };
  // None where there is nothing to compare with; `problem` says why, unless comparing is off.
  std::optional<OtherPicture> other(const ViewerState& state, Problem& problem) const;

  // Once a frame, before the panels are drawn: what they say about it. `picture`: the one on screen, may be null;
  // `newest`: it is the one asked for last.
  void update(ViewerState& state, const Picture* picture, bool newest);
  // Has each whole picture measured once. `complete`: this one is. What is found is said by update(), also when a newer
  // model has come meanwhile: of a run that is followed it may come faster than figures.
  void measure(ViewerState& state, const Picture* picture, bool complete);
  // [s] until the flicker changes sides by itself, at least 1 ms.
  double untilFlicker(const CompareState& compare, double now) const;

  // Whether the pointer moves the line of a wipe over `area` instead of the camera. Within a frame of Dear ImGui.
  bool dragDivider(ViewerState& state, PixelRect area);

 private:
  std::optional<Photographs> photographs_;
  std::string without_photographs_;
  MetricsThread metrics_;
  // What figures are of. It keeps no model alive.
  struct Subject {
    std::filesystem::path model_file, other_file;
    std::weak_ptr<const GaussianModel> model, other;
    PictureRequest view;  // without the models; of a photograph: as it is measured
  };
  static Subject subjectOf(const ViewerState& state, const Picture& picture);
  static bool isOfView(const Subject& a, const Subject& b);  // whatever the settings and how new the models are

  std::optional<Subject> subject_;         // asked for last
  std::weak_ptr<const PicturePair> pair_;  // of it, on screen
  std::uint64_t asked_ = 0;                // the thread's number of it
  std::uint64_t first_ = 0;                // since when models alone have changed
  std::uint64_t found_ = 0;                // what figures_ are of
  std::optional<PictureMetrics> figures_;
  double flickered_ = 0;  // [s] window time
  bool dragging_divider_ = false;
};

}  // namespace tg
