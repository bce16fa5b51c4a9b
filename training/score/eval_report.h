// SPDX-License-Identifier: Apache-2.0
// What tgeval says: the table, the histogram, the JSON, the pictures side by side.
#pragma once
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/model/effective_rank.h"
#include "training/score/evaluate.h"

namespace tg {

// Views of a scene in blocks that see several cells, and those that see one.
struct SeamScores {
  std::vector<bool> at_seams;    // [views]
  std::vector<ViewScore> whole;  // of the model that was trained unsplit; empty: none
};

struct EvalReport {
  struct Views {
    std::string dataset;
    std::string split;
    std::string device;  // that drew the pictures
    glm::vec3 background{0.0f};
    std::optional<TextureOutside> outside;  // instead of the model's own
    std::vector<ViewScore> scores;
    ScoreOptions options;
    std::size_t asked = 0;            // more than scores: interrupted
    std::optional<SeamScores> seams;  // of all views
  };
  std::optional<Views> views;
  std::optional<EffectiveRanks> ranks;
  std::size_t gaussians = 0;
  std::size_t texels = 0;
  std::size_t parameters = 0;
  std::uintmax_t bytes = 0;  // of the model's file
};

std::string formatScores(const EvalReport& report);
std::string formatRanks(const EffectiveRanks& ranks);
std::string formatEvalJson(const EvalReport& report);

// A FLIP map in its authors' colours, magma: from black (0) over violet and orange to light yellow (1).
Image flipPicture(const Image& flip_map);
// Photograph | rendering | error: flipPicture(), masked pixels grey.
Image sideBySide(const ViewPixels& photograph, const Image& picture, const Image& flip_map);
// Throws Error(cannotWrite), naming `path`, where such pictures of views of that size have more pixels than any file.
void requireSideBySide(glm::ivec2 view, const std::string& path);

}  // namespace tg
