// SPDX-License-Identifier: Apache-2.0
// Edits of Gaussians, there and back.
#include "viewer/view/model_edit.h"

#include <algorithm>
#include <utility>

#include "core/model/verbs.h"
#include "core/system/assert.h"

namespace tg {
namespace {

template <typename T>
void scatter(std::vector<T>& rows, std::size_t length, std::span<const std::uint32_t> which,
             const std::vector<T>& values) {
  if (values.empty()) return;
  for (std::size_t j = 0; j < which.size(); ++j) {
    std::copy_n(values.data() + j * length, length, rows.data() + which[j] * length);
  }
}

ModelPtr erased(const GaussianModel& model, const ModelEdit& edit) {
  std::vector<std::uint32_t> kept;
  kept.reserve(model.size() - edit.which.size());
  std::size_t next = 0;
  for (std::uint32_t i = 0; i < model.size(); ++i) {
    if (next < edit.which.size() && edit.which[next] == i) {
      ++next;
    } else {
      kept.push_back(i);
    }
  }
  return std::make_shared<const GaussianModel>(select(model, kept));
}

ModelPtr restored(const GaussianModel& model, const ModelEdit& edit) {
  GaussianModel all = model;
  append(all, edit.erased);
  // Those erased lie at the end: back to their places.
  std::vector<std::uint32_t> source(all.size());
  std::size_t next = 0;
  for (std::size_t i = 0, kept = 0; i < source.size(); ++i) {
    const bool back = next < edit.which.size() && edit.which[next] == i;
    source[i] = static_cast<std::uint32_t>(back ? model.size() + next++ : kept++);
  }
  return std::make_shared<const GaussianModel>(select(all, source));
}

ModelPtr moved(const GaussianModel& model, const ModelEdit& edit) {
  auto fresh = std::make_shared<GaussianModel>(model);
  transformGaussians(*fresh, edit.similarity, edit.which);
  return fresh;
}

}  // namespace

ModelPtr applied(const GaussianModel& model, ModelEdit& edit, const ModelPtr& known) {
  TG_ASSERT(!edit.which.empty() && std::ranges::is_sorted(edit.which) && edit.which.back() < model.size(),
            "an edit is of Gaussians of the model");
  if (edit.erases) {
    edit.erased = select(model, edit.which);
    return erased(model, edit);
  }
  const Similarity& s = edit.similarity;
  const bool turns = s.rotation != glm::dmat3(1.0), scales = s.scale != 1.0;
  const std::size_t k = model.shCount();
  edit.before = {};
  edit.before.mean = gathered(model.mean, 1, edit.which, edit.which.size());
  // Scaling may name local axes anew.
  if (turns || scales) edit.before.rotation = gathered(model.rotation, 1, edit.which, edit.which.size());
  if (scales) edit.before.log_scale = gathered(model.log_scale, 1, edit.which, edit.which.size());
  if (turns && k > 1) edit.before.sh = gathered(model.sh, k, edit.which, edit.which.size());
  ModelPtr after = known ? known : moved(model, edit);
  checkModel(*after, "the edit");
  return after;
}

ModelPtr appliedAgain(const GaussianModel& model, const ModelEdit& edit) {
  TG_ASSERT(!edit.which.empty() && edit.which.back() < model.size(), "an edit is of Gaussians of the model");
  return edit.erases ? erased(model, edit) : moved(model, edit);
}

ModelPtr takenBack(const GaussianModel& model, const ModelEdit& edit) {
  if (edit.erases) return restored(model, edit);
  auto before = std::make_shared<GaussianModel>(model);
  const std::size_t k = model.shCount();
  forEachField(
      [&](const Field& field, auto& rows, const auto& old) { scatter(rows, field.values(k), edit.which, old); },
      static_cast<GaussianFields<Values>&>(*before), edit.before);
  return before;
}

std::uint64_t bytesOf(const ModelEdit& edit) {
  std::uint64_t bytes = edit.which.size() * sizeof(std::uint32_t) + bytesOf(edit.erased);
  forEachField([&](const Field&, const auto& rows) { bytes += rows.size() * sizeof(rows[0]); }, edit.before);
  return bytes;
}

}  // namespace tg
