// SPDX-License-Identifier: Apache-2.0
// The renderer of runs without a window.
#pragma once
#include <memory>
#include <string>

#include "render/devices/devices.h"
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
// options.model; its warnings go to stderr, a line each.
Scene readScene(const ViewOptions& options);
Scene sceneFor(const ViewOptions& options, Bundle loaded);  // the same of a model that has been read
// The picture of --show, with its legend where --legend asks for it.
Image shownPicture(const Frame& frame, const ViewOptions& options, const RenderSettings& settings);
// Writes the devices of every API with their limits to stdout.
void printDevices();
// Throws Error(device) when validation has said anything.
void requireNoValidationMessages(const HeadlessRenderer& backend);

}  // namespace tg
