// SPDX-License-Identifier: Apache-2.0
// Walks over the fields of models.
#include "core/model/verbs.h"

#include <sys/mman.h>
#include <unistd.h>

#include <cmath>

#include "core/model/texture_dictionary.h"
#include "core/system/assert.h"
#include "core/system/error.h"

namespace tg {
namespace {

constexpr std::size_t kHugeBytes = std::size_t{4} << 20;  // arrays from here on are worth large pages

// A large array is touched once, 4 KiB at a time: asking for 2 MiB pages takes most of that time away. A hint only.
template <typename T>
void resizeLarge(std::vector<T>& values, std::size_t n) {
  const std::size_t bytes = n * sizeof(T);
  if (n > values.capacity() && bytes >= kHugeBytes) {
    values.reserve(n);
    const std::size_t page = static_cast<std::size_t>(::sysconf(_SC_PAGESIZE));
    const std::size_t skipped = (page - reinterpret_cast<std::uintptr_t>(values.data()) % page) % page;
    ::madvise(reinterpret_cast<char*>(values.data()) + skipped, (bytes - skipped) / page * page, MADV_HUGEPAGE);
  }
  values.resize(n);
}

// What all Gaussians of a model have in common, without textures.
GaussianModel emptyLike(const GaussianModel& model) {
  GaussianModel empty;
  empty.sh_degree = model.sh_degree;
  empty.intersection = model.intersection;
  empty.outside = model.outside;
  return empty;
}

GaussianModel selectBare(const GaussianModel& model, std::span<const std::uint32_t> source) {
  GaussianModel part = emptyLike(model);
  forEachField([&](const Field& field, auto& to,
                   const auto& from) { to = gathered(from, field.values(model.shCount()), source, source.size()); },
               part, model);
  return part;
}

}  // namespace

void neutralize(std::span<glm::vec4> texels, TextureMode mode) {
  for (glm::vec4& texel : texels) {
    if (!hasColor(mode)) texel = glm::vec4(0.0f, 0.0f, 0.0f, texel.a);
    if (!hasAlpha(mode)) texel.a = 1.0f;
  }
}

std::size_t parameterCount(const GaussianModel& model) {
  const std::size_t channels = (hasColor(model.texture_mode) ? 3 : 0) + (hasAlpha(model.texture_mode) ? 1 : 0);
  std::size_t texels = model.atlas.texels.size();
  if (const std::vector<std::uint32_t> groups = textureGroups(model.atlas); areShared(model.atlas, groups)) {
    texels = 0;
    for (const std::uint32_t first : firstOfGroups(groups)) texels += model.atlas.rects[first].texelCount();
  }
  return model.size() * gaussianFloats(model.shCount()) + texels * channels;
}

std::uint64_t bytesOf(const GaussianModel& model) {
  std::uint64_t bytes = 0;
  forEachParameter([&](const Field&, const auto& values) { bytes += values.size() * sizeof(values[0]); }, model);
  return bytes;
}

void resizeGaussians(GaussianModel& model, std::size_t n, int sh_degree) {
  TG_ASSERT(sh_degree >= 0 && sh_degree <= 3, "an SH degree from 0 to 3");
  TG_ASSERT(model.size() == 0 || sh_degree == model.sh_degree, "Gaussians keep their SH degree");
  model.sh_degree = sh_degree;
  forEachField([&](const Field& field, auto& values) { resizeLarge(values, n * field.values(model.shCount())); },
               model);
}

void setShDegree(GaussianModel& model, int degree) {
  TG_ASSERT(lengthsAgree(model), "the model's arrays have their lengths");
  if (degree < 0 || degree > 3) {
    throw Error(ErrorKind::usage, "wrong SH degree (expected 0 to 3, found " + std::to_string(degree) + ")");
  }
  if (degree == model.sh_degree) return;
  // Another degree only once there is memory for all of it.
  GaussianModel other;
  other.sh_degree = degree;
  forEachField(
      [&](const Field& field, auto& values, auto& others) {
        if (field.harmonic) others = withRowLength(values, model.shCount(), other.shCount());
      },
      model, other);
  forEachField(
      [](const Field& field, auto& values, auto& others) {
        if (field.harmonic) values.swap(others);
      },
      model, other);
  model.sh_degree = degree;
}

GaussianModel select(const GaussianModel& model, std::span<const std::uint32_t> source) {
  TG_ASSERT(lengthsAgree(model), "the model's arrays have their lengths");
  TG_ASSERT(std::ranges::all_of(source, [&](std::uint32_t i) { return i < model.size(); }),
            "the model has the sources");
  GaussianModel part = selectBare(model, source);
  part.texture_mode = model.texture_mode;
  if (model.atlas.rects.empty()) return part;
  std::size_t texels = 0;
  for (const std::uint32_t i : source) texels += model.atlas.rects[i].texelCount();
  TG_ASSERT(texels <= kMaxOffset, "offsets reach every texel");
  part.atlas.rects.reserve(source.size());
  part.atlas.texels.reserve(texels);
  for (const std::uint32_t i : source) {
    const TextureRect& rect = model.atlas.rects[i];
    const auto first = model.atlas.texels.begin() + rect.offset;
    part.atlas.rects.push_back({static_cast<std::uint32_t>(part.atlas.texels.size()), rect.width, rect.height});
    part.atlas.texels.insert(part.atlas.texels.end(), first, first + rect.texelCount());
  }
  return part;
}

void append(GaussianModel& model, const GaussianModel& other) {
  TG_ASSERT(lengthsAgree(model) && lengthsAgree(other), "the models' arrays have their lengths");
  TG_ASSERT(model.sh_degree == other.sh_degree, "both models have one SH degree");
  TG_ASSERT(model.atlas.texels.size() + other.atlas.texels.size() <= kMaxOffset, "offsets reach every texel");
  const std::size_t before = model.size();
  const bool has_rects = !model.atlas.rects.empty() || !other.atlas.rects.empty();
  forEachField([](const Field&, auto& to, const auto& from) { to.insert(to.end(), from.begin(), from.end()); }, model,
               other);
  if (!has_rects) return;
  TextureAtlas& atlas = model.atlas;
  atlas.rects.resize(before);
  for (TextureRect rect : other.atlas.rects) {
    if (rect.texelCount() != 0) rect.offset += static_cast<std::uint32_t>(atlas.texels.size());
    atlas.rects.push_back(rect);
  }
  atlas.rects.resize(model.size());
  atlas.texels.insert(atlas.texels.end(), other.atlas.texels.begin(), other.atlas.texels.end());
}

GaussianModel withoutTextures(const GaussianModel& model) {
  GaussianModel bare = emptyLike(model);
  forEachField([](const Field&, auto& to, const auto& from) { to = from; }, bare, model);
  return bare;
}

GaussianModel thinned(const GaussianModel& model, std::size_t ready, std::size_t most) {
  TG_ASSERT(most > 0 && ready <= model.size(), "a Gaussian at least, of those that the model has");
  const std::size_t step = std::max<std::size_t>(1, (ready + most - 1) / most);
  std::vector<std::uint32_t> source(ready / step);
  for (std::size_t j = 0; j < source.size(); ++j) source[j] = static_cast<std::uint32_t>(j * step);
  GaussianModel part = selectBare(model, source);
  if (source.empty()) return part;
  // The surfaces of all are those of the part, each Gaussian of which is so much larger.
  const float growth = 0.5f * std::log(static_cast<float>(model.size()) / static_cast<float>(part.size()));
  for (glm::vec3& log_scale : part.log_scale) log_scale += growth;
  return part;
}

}  // namespace tg
