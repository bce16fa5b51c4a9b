// SPDX-License-Identifier: Apache-2.0
// What is compared with what is told by the state alone; this finds it, has it measured, and moves the divider.
#include "viewer/window/comparison_control.h"

#include <imgui.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/system/error.h"

namespace tg {
namespace {

constexpr float kDividerReach = 6;  // [UiState::scale] around the line of a wipe

// Empty: a photograph.
std::filesystem::path fileOf(const ViewerState& state, const OtherPicture& other) {
  const int document = other.model ? otherDocument(state) : -1;
  return document < 0 ? std::filesystem::path() : state.documents.open[static_cast<std::size_t>(document)].path;
}

}  // namespace

ComparisonControl::ComparisonControl(const ViewOptions& options, std::function<void()> wake)
    : metrics_(std::move(wake)) {
  if (options.photographs.empty()) return;
  try {
    photographs_.emplace(options.photographs);
  } catch (const Error& error) {
    if (!options.follow) throw;
    without_photographs_ = error.what();
  }
}

std::optional<OtherPicture> ComparisonControl::other(const ViewerState& state, Problem& problem) const {
  const CompareState& compare = state.compare;
  if (compare.how.mode == CompareMode::off) return std::nullopt;
  OtherPicture other;
  // What does not change the pictures of a mode would have them drawn anew.
  other.how.mode = compare.how.mode;
  if (compare.how.mode == CompareMode::difference) {
    other.how.with_sign = compare.how.with_sign;
    other.how.gain = compare.how.gain;
  }
  if (compare.with_photographs && photographs_) {
    const int camera = cameraHere(state);
    if (camera < 0) {
      problem = state.scene.cameras.empty()
                    ? Problem{"This model has no cameras", "Photographs are found by theirs"}
                    : Problem{"No photograph was taken from here", "Go to a camera of the model (Space, or . and ,)"};
      return std::nullopt;
    }
    other.taken = state.scene.cameras[static_cast<std::size_t>(camera)];
    other.photograph = photographs_->find(other.taken);
    if (!other.photograph.empty()) return other;
    problem.what = photographs_->folder().string() + ": holds no photograph \"" + other.taken.name + "\"";
    return std::nullopt;
  }
  const int document = otherDocument(state);
  if (document >= 0) {
    other.model = state.documents.open[static_cast<std::size_t>(document)].scene.model;
    if (state.display.crop) other.crop = state.display.box;  // also while one Gaussian of the first is alone
    if (other.model) return other;
  }
  problem = {"There is nothing to compare with", "Open another model"};
  return std::nullopt;
}

void ComparisonControl::update(ViewerState& state, const Picture* picture, bool newest) {
  CompareState& compare = state.compare;
  Problem problem;
  const std::optional<OtherPicture> found = other(state, problem);
  compare.problem = std::move(problem.what);
  compare.way_out = std::move(problem.way_out);
  compare.photograph = found ? found->photograph.lexically_relative(compare.photographs).string() : std::string();
  if (compare.problem.empty() && picture && newest) compare.problem = picture->problem;
  if (compare.how.mode == CompareMode::flicker && compare.timed && state.time - flickered_ >= compare.flicker_seconds) {
    compare.how.shows_other = !compare.how.shows_other;
    flickered_ = state.time;
  }
  if (const auto result = metrics_.take(); result && result->number >= first_) {
    figures_ = result->metrics;
    found_ = result->number;
    compare.measured = found_ == asked_;
  }
  // The picture may have changed since the figures were found to be of it.
  compare.measured = compare.measured && picture && picture->pair && picture->pair == pair_.lock();
  const bool elsewhere = found && subject_ &&
                         (found->photograph != subject_->view.other->photograph ||
                          state.scene.path != subject_->model_file || fileOf(state, *found) != subject_->other_file);
  compare.measured = compare.measured && !elsewhere;
  compare.metrics = elsewhere ? std::nullopt : figures_;
}

ComparisonControl::Subject ComparisonControl::subjectOf(const ViewerState& state, const Picture& picture) {
  Subject subject{state.scene.path, {}, picture.request.model, {}, picture.request};
  OtherPicture& other = *subject.view.other;
  subject.other_file = fileOf(state, other);
  subject.other = other.model;
  if (picture.photograph) {
    subject.view.camera = measuredCamera(other.taken);
    subject.view.settings.exposure = 0;
  }
  other.how = {};
  other.model.reset();
  subject.view.model.reset();
  return subject;
}

bool ComparisonControl::isOfView(const Subject& a, const Subject& b) {
  PictureRequest view = a.view;
  view.settings = b.view.settings;
  return a.model_file == b.model_file && a.other_file == b.other_file && same(view, b.view);
}

void ComparisonControl::measure(ViewerState& state, const Picture* picture, bool complete) {
  CompareState& compare = state.compare;
  if (compare.how.mode == CompareMode::off || (picture && complete && !hasFigures(*picture))) {
    compare.metrics = figures_ = std::nullopt;
    subject_.reset();
    first_ = asked_ + 1;
  }
  if (!picture || !complete || !hasFigures(*picture)) {
    compare.measured = false;
    return;
  }
  Subject subject = subjectOf(state, *picture);
  const auto equal = [](const auto& a, const auto& b) { return !a.owner_before(b) && !b.owner_before(a); };
  const bool of_view = subject_ && isOfView(*subject_, subject);
  const bool of_settings = of_view && subject_->view.settings == subject.view.settings;
  if (!of_settings || !equal(subject.model, subject_->model) || !equal(subject.other, subject_->other)) {
    asked_ = metrics_.ask(*picture);
    if (!of_settings) first_ = asked_;
    if (!of_view) compare.metrics = figures_ = std::nullopt;
    compare.measured_size = subject.view.camera.size;
    subject_ = std::move(subject);
  }
  pair_ = picture->pair;
  compare.measured = found_ == asked_;
}

double ComparisonControl::untilFlicker(const CompareState& compare, double now) const {
  return std::max(compare.flicker_seconds - (now - flickered_), 1e-3);
}

bool ComparisonControl::dragDivider(ViewerState& state, PixelRect area) {
  Comparison& how = state.compare.how;
  const ImGuiIO& io = ImGui::GetIO();
  if (how.mode != CompareMode::wipe || !io.MouseDown[0]) return dragging_divider_ = false;
  const float pixels = std::max(io.DisplayFramebufferScale.x, 1e-3f);
  const float left = static_cast<float>(area.origin.x) / pixels, width = static_cast<float>(area.size.x) / pixels;
  if (!dragging_divider_) {
    const bool pressed = ImGui::IsMouseClicked(0) && !io.WantCaptureMouse;
    const float reach = kDividerReach * static_cast<float>(state.ui.scale);
    dragging_divider_ = pressed && std::abs(io.MousePos.x - (left + how.divider * width)) < reach;
  }
  if (dragging_divider_) how.divider = std::clamp((io.MousePos.x - left) / width, 0.0f, 1.0f);
  return dragging_divider_;
}

}  // namespace tg
