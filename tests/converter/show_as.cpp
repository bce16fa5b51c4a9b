// SPDX-License-Identifier: Apache-2.0
// tg_show_as MODEL VIEWER CAMERAS.json OUT.png: what the emulated viewer shows of a model's base from
// the first camera, on black.
#include <optional>

#include "converter/registry/file_format.h"
#include "core/bundle/camera_file.h"
#include "core/image/image.h"
#include "core/model/fallback.h"
#include "core/system/program.h"
#include "render/affine/affine_picture.h"

int main(int argc, char** argv) {
  return tg::runProgram("tg_show_as", [&] {
    const std::optional<tg::SplatViewer> viewer =
        argc == 5 ? tg::parse<tg::SplatViewer>(argv[2]) : std::optional<tg::SplatViewer>();
    if (!viewer) throw tg::Error(tg::ErrorKind::usage, "expected MODEL VIEWER CAMERAS.json OUT.png");
    const tg::Bundle loaded = tg::readModel(argv[1], {.base_only = true});
    const tg::ViewerPicture picture(tg::bakeFallback(loaded.model, tg::FallbackScale::kept), *viewer);
    tg::writeImage(argv[4], picture.render(tg::readCameras(argv[3]).at(0), glm::vec3(0.0f)));
    return 0;
  });
}
