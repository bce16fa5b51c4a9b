// SPDX-License-Identifier: Apache-2.0
// Pictures that the window draws one after the other by themselves: a recording, or a benchmark.
#pragma once
#include <cstddef>
#include <functional>
#include <string>

#include "viewer/picture/picture.h"

namespace tg {

class PictureRun {
 public:
  virtual ~PictureRun() = default;
  // The camera of the picture that is due; null while there is none.
  virtual const Camera* due() = 0;
  // The picture of the camera that was due. `read` fetches its pixels. Throws Error.
  virtual void take(const Picture& picture, const std::function<Image()>& read) = 0;
  virtual std::size_t done() const = 0;
  virtual std::size_t frames() const = 0;
  // Once all are done: waits for what is still under way, and says what came of it. Throws Error.
  virtual std::string finish() = 0;
};

}  // namespace tg
