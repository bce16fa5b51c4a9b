// SPDX-License-Identifier: Apache-2.0
// Photographs to a model, step by step.
#pragma once
#include <cstddef>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "textured_gaussians/dataset.h"
#include "textured_gaussians/model.h"

namespace textured_gaussians {

// A preset and, over it, settings by name, with the values that tgtrain's flags take: {{"iterations", "7000"},
// {"texture-size", "4"}}, with or without the flags' dashes, which messages have. docs/training.md lists both.
// Other flags of tgtrain are none: messages say what has them here.
struct TrainOptions {
  std::string preset = "default";
  std::map<std::string, std::string> settings = {};
};

struct TrainProgress {
  std::string stage;  // plain (no textures yet), textured, untextured, count
  int iteration = 0;  // done in this stage
  int iterations = 0;
  double loss = 0;  // running means over training photographs, 0 before the first iteration
  double psnr = 0;  // [dB]
  std::size_t gaussians = 0;
  double seconds_left = 0;  // of all stages, as far as it can be told
};

// A training on the processor, with all threads. The same data set, options and start give the same bytes for any
// number of them. Calls from several threads wait for one another. One that was moved from may only be assigned to.
class Trainer {
 public:
  // `start`: a model to go on from, instead of the data set's points. Throws Error: usage for unknown settings or
  // values and for such as contradict each other; badData where there is nothing to start from, also of a start.
  explicit Trainer(const Dataset& dataset, const TrainOptions& options = {}, const std::optional<Model>& start = {});
  ~Trainer();
  Trainer(Trainer&&) noexcept;
  Trainer& operator=(Trainer&&) noexcept;

  // One iteration; false: there was none left. The first and the last of a stage take longer. Throws Error(badData)
  // when no Gaussian is left or the loss is not finite, and what decoding a photograph throws.
  bool step();
  TrainProgress progress() const;
  // Settings of TrainOptions that do nothing beside the others or after `start`, a line for each reason, and a
  // filter-3d that filters a `start` once more that was trained with it, as tgtrain says both.
  std::vector<std::string> warnings() const;
  // As it stands, with the data set's cameras and background: a copy. The textured one while its twin is trained.
  Model model() const;

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace textured_gaussians
