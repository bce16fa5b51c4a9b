// SPDX-License-Identifier: Apache-2.0
// What tgtrain writes: a scene in the format of its name, of a size where one is asked for.
#pragma once
#include <cstdint>
#include <functional>
#include <optional>
#include <string>

#include "core/bundle/bundle.h"
#include "core/model/model.h"

namespace tg {

// How many times as many bytes as a .sog a file at `path` takes. Throws Error(usage) for "" and for what is not brought
// to a size.
double partOfSog(const std::string& path);

// What a file is to be: of a size, or of steps, or as its format is without either.
struct SceneSize {
  std::uint64_t bytes = 0;  // at most; 0: any
  float steps = 0;          // of the format; 0: its own, or the finest for `bytes`
};

// What came of it.
struct WrittenScene {
  std::uint64_t bytes = 0;          // with the files beside it
  float steps = 0;                  // of the format; 0: its own, or none
  std::optional<double> psnr = {};  // [dB] of up to four views against the model's, where numbers are rounded
};

// `model` as a file at `path` will hold it, in its own order and with its own names of axes: each attribute is near the
// model's own, and may take its place alone. Where `steps` are 0 it first sets them: the finest with which `bytes` are
// not exceeded, with a hundredth of them to spare for what training still changes where there is so much room. Throws
// Error(usage) where no steps bring it to that size, and what the writers throw.
GaussianModel asStored(const std::string& path, const GaussianModel& model, std::uint64_t bytes, float& steps);

// `write`s a file after hours of training. Without `replace` none that came meanwhile is replaced: then `keep` keeps
// the model elsewhere, and Error(cannotWrite) says where that is, which it returns. Throws what `write` throws.
void writeAfterTraining(const std::string& path, bool replace, const std::function<void()>& write,
                        const std::function<std::string()>& keep);

// Keeps a model that cannot be what was asked for: as PATH.tgz, or the first PATH-N.tgz that is free (of NAME.tgz
// NAME-N.tgz), in the folder for temporary files where that has no room. Returns `why` with where it is, or as it was.
Error keepModel(const std::string& path, const Bundle& scene, const Error& why);

// Writes `scene`, as writeAfterTraining(); its cameras only where the format has them and neither size nor steps are
// asked for. replace: files beside it, too. kept: where else the model is; "": nowhere. Of steps that exceed the size,
// and without any, the finest that do not; of steps that leave a fiftieth of it free a half, a quarter and so on, as
// far as it fits. quiet: warnings are kept to itself. Throws Error(usage) where no steps bring it to that size, and
// what the writers throw, after keepModel() where it is not `kept` elsewhere.
WrittenScene writeScene(const std::string& path, Bundle scene, bool replace, const std::string& kept, bool quiet,
                        SceneSize size = {});

}  // namespace tg
