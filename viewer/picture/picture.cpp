// SPDX-License-Identifier: Apache-2.0
// What makes two requests one.
#include "viewer/picture/picture.h"

#include "viewer/view/legend.h"

namespace tg {
namespace {

bool sameView(const Pinhole& a, const Pinhole& b) { return a == b; }  // whatever the cameras' names

bool sameOther(const OtherPicture& a, const OtherPicture& b) {
  if (a.model != b.model || (a.model && a.crop != b.crop)) return false;
  if (!a.model && (a.photograph != b.photograph || !sameView(a.taken, b.taken))) return false;
  // Of the other modes only the window's layout differs.
  return hasLegend(a.how.mode) || hasLegend(b.how.mode) ? a.how == b.how : true;
}

}  // namespace

bool hasFigures(const Picture& picture) {
  // Of one Gaussian alone the other model has nothing in such a box.
  const std::optional<CropBox>& box = picture.request.settings.crop;
  if (box && box->min == box->max) return false;
  return picture.pair && (!picture.photograph || kPhotographOutputs.has(picture.request.output));
}

bool same(const PictureRequest& a, const PictureRequest& b) {
  if (a.other.has_value() != b.other.has_value() || (a.other && !sameOther(*a.other, *b.other))) return false;
  return a.model == b.model && sameView(a.camera, b.camera) && a.settings == b.settings && a.output == b.output;
}

}  // namespace tg
