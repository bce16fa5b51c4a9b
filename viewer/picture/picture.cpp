// SPDX-License-Identifier: Apache-2.0
// What makes two requests one.
#include "viewer/picture/picture.h"

namespace tg {
namespace {

bool sameView(const Camera& a, const Camera& b) {
  return a.width == b.width && a.height == b.height && a.fx == b.fx && a.fy == b.fy && a.cx == b.cx && a.cy == b.cy &&
         a.camera_from_world_rotation == b.camera_from_world_rotation &&
         a.camera_from_world_translation == b.camera_from_world_translation;
}

bool sameOther(const OtherPicture& a, const OtherPicture& b) {
  if (a.model != b.model || a.difference != b.difference) return false;
  if (!a.model && (a.photograph != b.photograph || !sameView(a.taken, b.taken))) return false;
  return !a.difference || (a.with_sign == b.with_sign && a.gain == b.gain);
}

}  // namespace

bool same(const PictureRequest& a, const PictureRequest& b) {
  if (a.other.has_value() != b.other.has_value() || (a.other && !sameOther(*a.other, *b.other))) return false;
  return a.model == b.model && sameView(a.camera, b.camera) && a.settings == b.settings && a.output == b.output &&
         a.exposure == b.exposure;
}

}  // namespace tg
