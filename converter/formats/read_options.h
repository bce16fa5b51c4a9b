// SPDX-License-Identifier: Apache-2.0
// What a caller asks of the readers of model files.
#pragma once

namespace tg {

struct ReadProgress;

struct ReadOptions {
  ReadProgress* progress = nullptr;  // of tgz and PLY; may be null
  bool base_only = false;  // glTF: leave the texture layer aside, as a reader that knows only the Khronos extension
};

}  // namespace tg
