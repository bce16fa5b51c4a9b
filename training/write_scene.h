// SPDX-License-Identifier: Apache-2.0
// What tgtrain writes: a scene in the format of its name, of a size where one is asked for.
#pragma once
#include <cstdint>
#include <string>

#include "core/bundle/bundle.h"
#include "training/settings/settings.h"

namespace tg {

// How many times as many bytes as a .sog a file at `path` takes. Throws Error(usage) for "" and for what is not brought
// to a size.
double partOfSog(const std::string& path);

// Writes `scene`; its cameras only where the format has them and no size is asked for. replace: files beside it, too.
// bytes: at most, by the finest steps of the format; a file that cannot be as small is as small as it can be, with a
// line on stderr, since training took its time; 0: any. Returns what to say of it beside its name: "(59961 bytes, 41.2
// dB to the model)", where numbers are rounded, over up to four views. Throws what the writers throw, after a model.tgz
// beside the path where it is not `kept` elsewhere.
std::string writeScene(const std::string& path, Bundle scene, bool replace, bool kept, std::uint64_t bytes = 0);

}  // namespace tg
