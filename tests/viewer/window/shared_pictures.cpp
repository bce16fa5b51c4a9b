// SPDX-License-Identifier: Apache-2.0
// What a window on an OpenGL GPU does, on the software device that there is: pictures that share its textures, one
// thread after the other's work. shared_pictures MODEL, exit code 1 where a picture is another one than it should be.
#include <cstdio>
#include <filesystem>
#include <memory>
#include <thread>
#include <utility>

#include "core/bundle/bundle.h"
#include "core/image/metrics.h"
#include "viewer/picture/device.h"
#include "viewer/window/glfw.h"
#include "viewer/window/screen.h"

using namespace tg;

namespace {

bool isLike(const char* what, const Image& found, const Image& expected) {
  const double likeness = psnr(found, expected);
  const bool like = likeness > 50;  // pictures have 8 bits
  if (!like) std::fprintf(stderr, "%s: %.2f dB (expected more than 50)\n", what, likeness);
  return like;
}

bool run(const std::filesystem::path& path) {
  const Bundle bundle = readBundle(path);
  FrameRequest request;
  request.camera = bundle.cameras.at(0);
  const glm::ivec2 size = request.camera.size;

  const Glfw glfw;
  Events events;
  ViewOptions options;
  options.validation = true;
  const WindowPtr window = openWindow(Api::opengl, size, events, true);
  const std::unique_ptr<Screen> screen = makeGlScreen(window.get(), options, {}, GlSharing::always);

  std::shared_ptr<PictureImage> drawn, uploaded;
  Image picture, mirrored(size.x, size.y, 3);
  bool good = true;
  std::thread([&] {
    const std::unique_ptr<PictureDevice> device = screen->makePictureDevice();
    const std::unique_ptr<GpuRenderer> renderer = device->makeRenderer();
    renderer->setModel(bundle.model);
    drawn = device->makeImage(size);
    uploaded = device->makeImage(size);
    drawWhole([&] { return device->draw(*renderer, request, *drawn, 0); });
    picture = renderer->picture();
    for (int y = 0; y < size.y; ++y) {
      for (int x = 0; x < size.x; ++x) {
        for (int c = 0; c < 3; ++c) mirrored.at(x, y, c) = picture.at(size.x - 1 - x, y, c);
      }
    }
    device->upload(mirrored, *uploaded);
    good = isLike("drawn", device->download(*drawn), picture) && good;
    good = isLike("uploaded", device->download(*uploaded), mirrored) && good;
  }).join();

  for (const auto& [image, expected] : {std::pair(drawn, &picture), std::pair(uploaded, &mirrored)}) {
    good = screen->acquire(size) && good;
    const PictureBlit whole{image, {{}, size}, {{}, size}};
    screen->draw({&whole, 1}, glm::vec3(0.5f), false);
    good = isLike("in the window", screen->readWindow(), *expected) && good;
    good = isLike("read", screen->read(*image), *expected) && good;
    screen->present();
  }
  return good && screen->messages() == 0;
}

}  // namespace

int main(int argc, char** argv) { return argc == 2 && run(argv[1]) ? 0 : 1; }
