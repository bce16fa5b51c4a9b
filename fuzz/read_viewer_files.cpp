// SPDX-License-Identifier: Apache-2.0
// Any text is one of the viewer's files or an Error, and what was read survives being written: the session, a camera
// path (also from a cameras.json), a script. The first byte chooses the reader.
#include <cmath>
#include <cstdlib>
#include <string>

#include "core/system/error.h"
#include "viewer/script/script.h"
#include "viewer/view/camera_path.h"
#include "viewer/view/session.h"

namespace {

void readSession(const std::string& text) {
  const std::string written = tg::formatSession(tg::parseSession(text, "session.json"));
  if (tg::formatSession(tg::parseSession(written, "again.json")) != written) std::abort();
}

void readPath(const std::string& text) {
  const tg::CameraPath path = tg::parsePath(text, "path.json");
  const tg::CameraPath again = tg::parsePath(tg::formatPath(path), "again.json");
  if (again.keys.size() != path.keys.size()) std::abort();
  const double seconds = tg::duration(path);
  for (const double part : {0.0, 0.3, 1.0}) {
    const tg::PathKey key = tg::at(path, part * seconds);
    for (int k = 0; k < 3; ++k) {
      if (!std::isfinite(key.position[k])) std::abort();
    }
    tg::toCamera(key, path.aspect, 64, 48);
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const std::string text(reinterpret_cast<const char*>(data + 1), size - 1);
  try {
    switch (data[0] % 3) {
      case 0:
        readSession(text);
        break;
      case 1:
        readPath(text);
        break;
      default:
        tg::parseScript(text, "script.txt");
        break;
    }
  } catch (const tg::Error&) {
  }
  return 0;
}
