// SPDX-License-Identifier: Apache-2.0
// model.tgz for a reader that waits for it.
#pragma once
#include "core/bundle/bundle.h"

namespace tg {

// As writeBundle, but not compressed, and nothing waits for the disk.
void writeBundleQuickly(const std::filesystem::path& path, const Bundle& bundle);

}  // namespace tg
