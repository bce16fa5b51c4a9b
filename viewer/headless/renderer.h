// SPDX-License-Identifier: Apache-2.0
// The renderer of runs without a window.
#pragma once
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "render/devices/devices.h"
#include "viewer/model/resident_levels.h"
#include "viewer/model/scene_of.h"
#include "viewer/view/options.h"

namespace tg {

// A renderer with the device it lives on; the device is destroyed last.
struct HeadlessRenderer {
  std::unique_ptr<OpenDevice> device;  // null: the CPU renderer
  std::unique_ptr<Renderer> renderer;
  std::string backend;  // as --backend has it: what was chosen
};

// What --backend, --device and --validation ask for; says so on stderr when it must be the CPU for want of any
// device. Throws Error(device).
HeadlessRenderer makeHeadlessRenderer(const ViewOptions& options);
// options.model that has been read; its warnings go to stderr, a line each.
Scene sceneFor(const ViewOptions& options, Bundle loaded);

// A model, or a scene with levels of detail, of which every camera gets the levels that it asks for.
class ViewedScene {
 public:
  // Throws Error(usage) for a --splat-budget that no level asks for, and what readModel or openLevels throws.
  ViewedScene(const ViewOptions& options, const std::filesystem::path& path);
  ViewedScene& operator=(ViewedScene&&) = delete;

  // With the coarsest level, where there are any.
  const Scene& scene() const { return scene_; }
  // Throws what reading throws: a level that cannot be read is an error.
  std::shared_ptr<const GaussianModel> modelFor(const Camera& camera);

 private:
  const std::uint64_t budget_;
  std::optional<OpenedLevels> opened_;
  std::optional<ResidentLevels> resident_;
  Scene scene_;
};
// The picture of --show, with its legend where --legend asks for it.
Image shownPicture(const Frame& frame, const ViewOptions& options, const RenderSettings& settings);
// Writes the devices of every API with their limits to stdout.
void printDevices();
// Throws Error(device) when validation has said anything.
void requireNoValidationMessages(const HeadlessRenderer& backend);

}  // namespace tg
