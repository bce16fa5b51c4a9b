// SPDX-License-Identifier: Apache-2.0
// Draws a model's first camera: `consumer MODEL OUT.png`.
#include "converter/registry/file_format.h"
#include "core/image/image.h"
#include "render/renderer.h"

int main(int count, char** arguments) {
  if (count != 3) return 1;
  const tg::Bundle loaded = tg::readModel(arguments[1]);
  const auto renderer = tg::makeCpuRenderer();
  renderer->setModel(loaded.model);
  tg::RenderSettings settings;
  settings.background = loaded.background;
  settings.outputs = {tg::Output::final};
  tg::writeImage(arguments[2], tg::extract(renderer->render(loaded.cameras.at(0), settings), tg::Output::final));
}
