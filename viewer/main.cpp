// SPDX-License-Identifier: Apache-2.0
// tgview: look at a model in a window, or render it to a file.
#include <cstdio>
#include <optional>
#include <vector>

#include "converter/registry/file_format.h"
#include "core/system/error.h"
#include "core/system/program.h"
#include "core/system/signals.h"
#include "viewer/flags.h"
#include "viewer/headless/headless.h"
#include "viewer/model/resident_levels.h"
#include "viewer/window/window.h"

namespace {

void listCameras(const std::filesystem::path& path) {
  const std::vector<tg::Camera> cameras =
      tg::isLodMeta(path) ? tg::openLevels(path, {}).cameras : tg::readModel(path).cameras;
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    const tg::Camera& camera = cameras[i];
    std::printf("%4zu  %-5s  %5d x %-5d  fy %8.1f  %s\n", i, camera.test ? "test" : "train", camera.size.x,
                camera.size.y, camera.focal.y, tg::printable(camera.name).c_str());
  }
  if (cameras.empty()) std::fprintf(stderr, "%s: the model has no cameras\n", tg::printable(path.string()).c_str());
}

int run(int argc, char** argv) {
  tg::CommandLine line;
  if (const std::optional<int> code = tg::readFlags(argc, argv, line)) return *code;
  tg::handleStopSignals(tg::endAtOnce);  // no temporary file of a video stays behind
  const tg::ViewOptions& view = line.view;
  if (line.list_cameras) {
    listCameras(view.model);
  } else if (view.inspect) {
    tg::inspectHeadless(view);
  } else if (!view.out.empty() && (!view.compare.empty() || !view.photographs.empty())) {
    tg::compareToFile(view);
  } else if (!view.out.empty()) {
    tg::renderToFile(view);
  } else if (view.benchmark && !line.window) {
    tg::benchmarkHeadless(view);
  } else if (!view.record.empty()) {
    tg::recordToFile(view);
  } else if (!view.serve.empty()) {
    tg::serveModel(view);
  } else {
    tg::runWindow(view);
  }
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  return tg::runProgram("tgview", [&] { return run(argc, argv); });
}
