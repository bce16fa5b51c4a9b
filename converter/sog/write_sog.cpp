// SPDX-License-Identifier: Apache-2.0
// SOG out.
#include <algorithm>
#include <functional>
#include <nlohmann/json.hpp>
#include <numeric>

#include "converter/formats/space_curve.h"
#include "converter/formats/texel_spread.h"
#include "converter/sog/codebook.h"
#include "converter/sog/parts.h"
#include "converter/sog/sog.h"
#include "converter/sog/zip.h"
#include "core/file/file.h"
#include "core/file/json.h"
#include "core/image/webp.h"
#include "core/model/equivalent_axes.h"
#include "core/model/fallback.h"
#include "core/model/texture_dictionary.h"
#include "core/model/verbs.h"
#include "core/system/assert.h"
#include "core/system/error.h"
#include "core/system/numbers.h"
#include "core/system/parallel.h"
#include "shared/splat.h"

namespace tg {
namespace {

using Json = nlohmann::ordered_json;

constexpr double kCoefficientStep = 0.03;  // of DC and SH, at options.steps 1
constexpr double kLastCode = 65535;        // of a coordinate
constexpr double kWidestStep = 1;          // of texels

// Steps of the other codes, 1 at least, at options.steps `f`: such that a byte less costs a picture about as much
// whatever it is taken from (docs/lab/converter.md).
// Positions are two bytes that are coded apart: powers of two leave the lower one few values. Not all axes change
// theirs at once, so that files shrink by little.
double positionStep(double f, int axis) { return std::exp2(std::floor(2 + 1.5 * std::log2(f) + axis / 3.0)); }
double opacityStep(double f) { return 4 * f - 2; }
// Textures of a Gaussian's own hang on its axes.
double rotationStep(double f, bool textured) { return textured ? f / 4 : f; }
double scaleStep(double f, bool textured) { return std::pow(textured ? f / 4 : f, 0.6); }

std::uint8_t toByte(double value) { return static_cast<std::uint8_t>(std::clamp(std::round(value), 0.0, 255.0)); }

// Filled up: some readers take 256 values for granted.
Json codebookOf(std::span<const float> values) {
  Json array = Json::array();
  for (const float value : values) array.push_back(shortDouble(value));
  while (array.size() < sog::kCodebook) array.push_back(0);
  return array;
}

// The whole number in [0, last] that is nearest to the nearest multiple of `step`, which is 1 at least.
double stepped(double value, double step, double last) {
  const double used = std::max(1.0, step);
  return std::clamp(std::round(std::round(value / used) * used), 0.0, last);
}

// To thousandths, which are short in meta.json, if the values of the codebook lie far enough apart for that.
void shorten(std::vector<float>& codebook) {
  constexpr double kParts = 1000, kApart = 4 / kParts;
  const auto close = [](float a, float b) { return static_cast<double>(b) - a < kApart; };
  if (std::ranges::adjacent_find(codebook, close) != codebook.end()) return;
  for (float& value : codebook) value = static_cast<float>(std::round(value * kParts) / kParts);
}

// The least number of three digits from `step` > 0 on: its multiples are short in meta.json.
double inThreeDigits(double step) {
  const double unit = std::pow(10.0, std::floor(std::log10(step)) - 2);
  return std::ceil(step / unit - 1e-9) * unit;
}

// Multiples of `step`, or of the least step with which sog::kCodebook of them reach from the least number to the
// largest. With the coder behind it better than as few values that fit best.
std::vector<float> evenCodebook(std::span<const float> numbers, double step) {
  const auto [low, high] = std::minmax_element(numbers.begin(), numbers.end());
  const double range = static_cast<double>(*high) - static_cast<double>(*low);
  const double used = inThreeDigits(std::max(step, range / (sog::kCodebook - 2)));
  std::vector<float> codebook;
  const double first = std::round(*low / used);
  // Numbers far out, where adding 1 to `first` may change nothing, still make no more than fit.
  const double steps = std::min(std::round(*high / used) - first, sog::kCodebook - 1.0);
  for (int k = 0; k <= steps; ++k) codebook.push_back(static_cast<float>((first + k) * used));
  return codebook;
}

// The images of a model whose Gaussians are in their order.
class SogWriter {
 public:
  SogWriter(GaussianModel model, const SogOptions& options, const std::string& path)
      : model_(std::move(model)), options_(options), path_(path) {}

  std::vector<ZipEntry> write() {
    meta_["version"] = sog::kVersion;
    meta_["count"] = model_.size();
    for (const glm::vec3& log_scale : model_.log_scale) shortest_axes_.push_back(shortestAxis(log_scale));
    if (isTextured(model_)) addTextures();  // first: the base holds what stands in for the texels as they are stored
    addMeans();
    addScales();
    addRotations();
    addColors();
    if (model_.sh_degree > 0) addSh();
    if (!textures_.is_null()) meta_[sog::kTextures] = std::move(textures_);
    std::vector<ZipEntry> entries(1 + images_.size());
    const std::string text = dumpJson(meta_);
    entries[0] = {"meta.json", {text.begin(), text.end()}, true};
    parallelFor(static_cast<std::int64_t>(images_.size()), 1,
                [&](std::int64_t i) { entries[1 + i] = {images_[i].first, encodeWebp(images_[i].second)}; });
    return entries;
  }

  // Of those written, how many the widest steps do not reach.
  std::uint64_t clippedTexels() const { return clipped_texels_; }

 private:
  // Of at least `pixels` pixels, opaque, and named so in the list that is returned.
  BytePixels& image(Json& files, const std::string& name, std::size_t pixels) {
    const auto side = static_cast<std::size_t>(std::ceil(std::sqrt(static_cast<double>(pixels))));
    const std::size_t width = std::max<std::size_t>((side + 3) / 4 * 4, 4);
    return image(files, name, width, ((pixels + width - 1) / width + 3) / 4 * 4);
  }
  BytePixels& image(Json& files, const std::string& name, std::size_t width, std::size_t height) {
    if (std::max(width, height) > kMaxWebpSide) {
      throw Error(ErrorKind::badData, path_,
                  name + " is too large" + atMost(kMaxWebpSide, std::max(width, height)) + " pixels a side");
    }
    files.push_back(name);
    BytePixels& pixels =
        images_.emplace_back(name, BytePixels(static_cast<int>(width), static_cast<int>(height))).second;
    for (std::size_t i = 0; i < pixels.size(); ++i) pixels.data[4 * i + 3] = 255;
    return pixels;
  }

  void addMeans() {
    std::array<double, 3> low, high;
    for (int k = 0; k < 3; ++k) {
      const auto [least, most] = std::minmax_element(model_.mean.begin(), model_.mean.end(),
                                                     [&](glm::vec3 a, glm::vec3 b) { return a[k] < b[k]; });
      low[k] = sog::toLogarithm((*least)[k]);
      high[k] = sog::toLogarithm((*most)[k]);
    }
    Json& node = meta_["means"] = Json::object();
    node["mins"] = low;
    node["maxs"] = high;
    Json files;
    image(files, "means_l.webp", model_.size());
    image(files, "means_u.webp", model_.size());
    BytePixels& lower = images_[images_.size() - 2].second;
    BytePixels& upper = images_.back().second;
    for (std::size_t i = 0; i < model_.size(); ++i) {
      for (int k = 0; k < 3; ++k) {
        const double range = high[k] - low[k];
        const double part = range > 0 ? (sog::toLogarithm(model_.mean[i][k]) - low[k]) / range : 0.0;
        const auto code = static_cast<unsigned>(stepped(part * kLastCode, positionStep(options_.steps, k), kLastCode));
        lower.data[4 * i + k] = static_cast<std::uint8_t>(code & 255u);
        upper.data[4 * i + k] = static_cast<std::uint8_t>(code >> 8);
      }
    }
    node["files"] = std::move(files);
  }

  void addScales() {
    const std::span<const float> numbers(&model_.log_scale.front().x, 3 * model_.size());
    const auto size =
        static_cast<std::size_t>(sog::kCodebook / std::max(1.0, scaleStep(options_.steps, own_textures_)));
    std::vector<float> codebook = makeCodebook(numbers, size);
    if (codebook.size() == size) shorten(codebook);
    Json files;
    BytePixels& pixels = image(files, "scales.webp", model_.size());
    for (std::size_t i = 0; i < model_.size(); ++i) {
      std::size_t codes[3];
      for (int k = 0; k < 3; ++k) codes[k] = nearestIn(codebook, model_.log_scale[i][k]);
      // The plane of a texture is that of the two longer axes: which is the shortest must not change.
      const int shortest_axis = shortest_axes_[i];
      const auto stored = [&] { return glm::vec3(codebook[codes[0]], codebook[codes[1]], codebook[codes[2]]); };
      if (codebook.size() > 1 && shortestAxis(stored()) != shortest_axis) {
        std::size_t& shortest = codes[shortest_axis];
        if (shortest > 0) --shortest;
        for (int k = 0; k < 3; ++k) {
          if (k != shortest_axis && codes[k] <= shortest) codes[k] = shortest + 1;
        }
      }
      for (int k = 0; k < 3; ++k) pixels.data[4 * i + k] = static_cast<std::uint8_t>(codes[k]);
    }
    meta_["scales"] = {{"codebook", codebookOf(codebook)}, {"files", std::move(files)}};
  }

  void addRotations() {
    Json files;
    BytePixels& pixels = image(files, "quats.webp", model_.size());
    for (std::size_t i = 0; i < model_.size(); ++i) {
      const glm::dvec4 q = glm::normalize(glm::dvec4(model_.rotation[i]));
      int largest = 0;
      for (int k = 1; k < 4; ++k) {
        if (std::abs(q[k]) > std::abs(q[largest])) largest = k;
      }
      const double sign = q[largest] < 0 ? -1.0 : 1.0;
      std::uint8_t* bytes = pixels.data.data() + 4 * i;
      for (int k = 0, to = 0; k < 4; ++k) {
        if (k != largest)
          bytes[to++] = static_cast<std::uint8_t>(
              stepped(255 * (sign * q[k] * std::sqrt(0.5) + 0.5), rotationStep(options_.steps, own_textures_), 255.0));
      }
      bytes[3] = static_cast<std::uint8_t>(sog::kFirstLargest + largest);
    }
    meta_["quats"] = {{"files", std::move(files)}};
  }

  void addColors() {
    const std::size_t n = model_.size(), row = model_.shCount();
    std::vector<float> numbers(3 * n);
    for (std::size_t i = 0; i < n; ++i) {
      for (int k = 0; k < 3; ++k) numbers[3 * i + k] = model_.sh[i * row][k];
    }
    const std::vector<float> codebook = evenCodebook(numbers, kCoefficientStep * options_.steps);
    Json files;
    BytePixels& pixels = image(files, "sh0.webp", n);
    for (std::size_t i = 0; i < n; ++i) {
      for (int k = 0; k < 3; ++k) {
        pixels.data[4 * i + k] = static_cast<std::uint8_t>(nearestIn(codebook, numbers[3 * i + k]));
      }
      pixels.data[4 * i + 3] = opacityByte(model_, i);
    }
    meta_["sh0"] = {{"codebook", codebookOf(codebook)}, {"files", std::move(files)}};
  }

  std::uint8_t opacityByte(const GaussianModel& model, std::size_t i) const {
    const double opacity = sigmoid(model.opacity_logit[i], 255.0);
    return static_cast<std::uint8_t>(stepped(opacity, opacityStep(options_.steps), 255.0));
  }

  void addSh() {
    const std::size_t n = model_.size(), rest = model_.shCount() - 1, length = 3 * rest;
    std::vector<float> rows(n * length);
    for (std::size_t i = 0; i < n; ++i) {
      const glm::vec3* from = model_.sh.data() + i * model_.shCount() + 1;
      std::copy_n(&from->x, length, rows.data() + i * length);
    }
    const Palette palette = makePalette(rows, length, sog::kMaxPalette);
    const std::vector<float> codebook = evenCodebook(palette.rows, kCoefficientStep * options_.steps);
    const std::size_t held = palette.rows.size() / length;
    Json files;
    BytePixels& centroids = image(files, "shN_centroids.webp", sog::kPaletteColumns * rest,
                                  (held + sog::kPaletteColumns - 1) / sog::kPaletteColumns);
    for (std::size_t c = 0; c < held * rest; ++c) {
      for (int k = 0; k < 3; ++k) {
        centroids.data[4 * c + k] = static_cast<std::uint8_t>(nearestIn(codebook, palette.rows[3 * c + k]));
      }
    }
    BytePixels& labels = image(files, "shN_labels.webp", n);
    for (std::size_t i = 0; i < n; ++i) {
      labels.data[4 * i] = static_cast<std::uint8_t>(palette.labels[i] & 255u);
      labels.data[4 * i + 1] = static_cast<std::uint8_t>(palette.labels[i] >> 8);
    }
    meta_["shN"] = {
        {"count", held}, {"bands", model_.sh_degree}, {"codebook", codebookOf(codebook)}, {"files", std::move(files)}};
  }

  // What of the textures is stored.
  struct Stored {
    std::vector<std::uint32_t> owners;  // the Gaussian of each texture, or the first that shares it
    std::vector<TextureRect> rects;     // of each
    std::vector<std::uint32_t> labels;  // [N] which one a Gaussian has; empty: its own
    std::vector<double> coarser;        // how much coarser than its texels' spreads a texture may be

    bool shared() const { return !labels.empty(); }
  };

  // `base`: with the opacities that the reader sees.
  Stored storedTextures(const GaussianModel& base) const {
    const std::vector<TextureRect>& rects = model_.atlas.rects;
    const std::vector<std::uint32_t> groups = textureGroups(model_.atlas);
    Stored stored;
    if (areShared(groups) && model_.atlas.texels.size() <= sog::kMostHandedOut) {
      const std::vector<std::uint32_t> owners = firstOfGroups(groups);
      std::vector<std::uint32_t> members(owners.size(), 0);
      for (const std::uint32_t group : groups) ++members[group];
      std::vector<std::uint32_t> order(owners.size()), place(owners.size());  // what most share first
      std::iota(order.begin(), order.end(), 0u);
      std::ranges::stable_sort(order, std::greater(), [&](std::uint32_t group) { return members[group]; });
      for (std::uint32_t k = 0; k < order.size(); ++k) {
        place[order[k]] = k;
        stored.owners.push_back(owners[order[k]]);
      }
      for (const std::uint32_t group : groups) stored.labels.push_back(place[group]);
      for (const std::uint32_t group : order) stored.coarser.push_back(sog::sharedSpread(members[group]));
    } else {
      stored.owners.resize(rects.size());
      std::iota(stored.owners.begin(), stored.owners.end(), 0u);
      for (std::size_t i = 0; i < rects.size(); ++i) {
        stored.coarser.push_back(opacitySpread(opacityByte(base, i) / 255.0));
      }
    }
    for (const std::uint32_t owner : stored.owners) stored.rects.push_back(rects[owner]);
    return stored;
  }

  // Of colours and of alpha: as fine as asked for, or as coarse as it takes for bytes to reach nearly all texels.
  std::array<double, 2> texelSteps(const Stored& stored) const {
    std::array<std::vector<float>, 4> magnitudes;  // of each channel, in units of a texel's spread
    for (const sog::SizeClass& group : sog::sizeClasses(stored.rects)) {
      const std::vector<double> spreads = texelSpreads(group.width, group.height);
      for (const std::uint32_t i : group.textures) {
        for (std::size_t t = 0; t < spreads.size(); ++t) {
          const glm::vec4 change = model_.atlas.texels[stored.rects[i].offset + t] - glm::vec4(0, 0, 0, 1);
          for (int k = 0; k < 4; ++k) {
            const double magnitude = std::abs(change[k]);
            const bool reached = stored.shared() && magnitude <= sog::kSharedReach;
            magnitudes[k].push_back(reached ? 0.0f : static_cast<float>(magnitude / (spreads[t] * stored.coarser[i])));
          }
        }
      }
    }
    const double step = static_cast<double>(options_.texture_step) * options_.steps;
    std::array<double, 2> steps = {step, 2 * step};
    for (int k = 0; k < 4 && !magnitudes[k].empty(); ++k) {
      steps[k == 3] = reachingStep(steps[k == 3], static_cast<double>(mostOf(magnitudes[k])));
    }
    for (double& own : steps) own = shortDouble(static_cast<float>(std::min(own, kWidestStep)));
    return steps;
  }

  // Leaves in the model the texels as they are stored, and then bakes them.
  void addTextures() {
    for (std::size_t i = 0; i < model_.size(); ++i) {
      const TextureRect rect = model_.atlas.rects[i];
      if (std::max(rect.width, rect.height) > sog::kMaxSide) {
        throw Error(ErrorKind::badData, path_,
                    "Gaussian " + std::to_string(i) + " has too large a texture for SOG" +
                        atMost(sog::kMaxSide, std::max(rect.width, rect.height)) + " texels a side");
      }
    }
    neutralize(model_.atlas.texels, model_.texture_mode);
    // The reader chooses steps by the opacity that is stored: the fallback's of the texels before they are rounded.
    GaussianModel base = bakeFallback(model_, FallbackScale::kept);
    const Stored stored = storedTextures(base);
    Json files;
    BytePixels& sizes = image(files, "texture_sizes.webp", stored.rects.size());
    std::size_t texels = 0;
    for (std::size_t i = 0; i < stored.rects.size(); ++i) {
      sizes.data[4 * i] = static_cast<std::uint8_t>(stored.rects[i].width);
      sizes.data[4 * i + 1] = static_cast<std::uint8_t>(stored.rects[i].height);
      texels += stored.rects[i].texelCount();
    }
    BytePixels& values = image(files, "texture_texels.webp", std::max<std::size_t>(texels, 1));
    std::size_t at = 0;
    std::vector<std::uint64_t> members(stored.rects.size(), stored.shared() ? 0 : 1);  // that have the texture
    for (const std::uint32_t label : stored.labels) ++members[label];
    const std::array<double, 2> steps = texelSteps(stored);
    for (const sog::SizeClass& group : sog::sizeClasses(stored.rects)) {
      const std::vector<double> spreads = texelSpreads(group.width, group.height);
      for (std::size_t t = 0; t < spreads.size(); ++t) {
        for (const std::uint32_t i : group.textures) {
          const double spread = spreads[t] * stored.coarser[i];
          glm::vec4& texel = model_.atlas.texels[stored.rects[i].offset + t];
          std::uint8_t* bytes = values.data.data() + 4 * at++;
          bool clips = false;
          for (int k = 0; k < 4; ++k) {
            const double own = sog::texelStep(steps[k == 3], spread, stored.shared()), neutral = k == 3 ? 1.0 : 0.0;
            const double stored_byte = wholeSteps((texel[k] - neutral) / own) + sog::kNeutralByte;
            clips = clips || (steps[k == 3] == kWidestStep && (stored_byte < 0 || stored_byte > 255));
            bytes[k] = toByte(stored_byte);
            texel[k] = static_cast<float>(neutral + (bytes[k] - sog::kNeutralByte) * own);
          }
          texel.a = std::clamp(texel.a, 0.0f, 1.0f);
          if (clips) clipped_texels_ += members[i];
        }
      }
    }
    const bool shared = stored.shared();
    own_textures_ = !shared;
    textures_ = {{"version", shared ? sog::kSharedTextures : sog::kOwnTextures}};
    if (shared) {
      textures_["textures"] = stored.owners.size();
      BytePixels& labels = image(files, "texture_labels.webp", model_.size());
      for (std::size_t i = 0; i < model_.size(); ++i) {
        const TextureRect own = model_.atlas.rects[i], owner = stored.rects[stored.labels[i]];
        std::copy_n(model_.atlas.texels.begin() + owner.offset, owner.texelCount(),
                    model_.atlas.texels.begin() + own.offset);
        labels.data[4 * i] = static_cast<std::uint8_t>(stored.labels[i] & 255u);
        labels.data[4 * i + 1] = static_cast<std::uint8_t>(stored.labels[i] >> 8);
      }
    }
    textures_.update({{"mode", name(model_.texture_mode)},
                      {"intersection", name(model_.intersection)},
                      {"outside", name(model_.outside)},
                      {"steps", steps},
                      {"files", std::move(files)}});
    model_ = bakeFallback(model_, sog::fallbackScale(shared));
    if (!shared) model_.opacity_logit = std::move(base.opacity_logit);
  }

  GaussianModel model_;
  std::vector<int> shortest_axes_;  // of the model as it is given
  bool own_textures_ = false;       // each Gaussian its own
  std::uint64_t clipped_texels_ = 0;
  const SogOptions& options_;
  const std::string& path_;
  Json meta_ = Json::object(), textures_;
  std::vector<std::pair<std::string, BytePixels>> images_;
};

}  // namespace

std::vector<ZipEntry> sogFiles(GaussianModel model, const std::string& path, const SogOptions& options,
                               std::uint64_t* clipped) {
  TG_ASSERT(lengthsAgree(model), "the model's arrays have their lengths");
  TG_ASSERT(options.steps >= kLeastSteps && options.steps <= kMostSteps && options.texture_step > 0,
            "steps that the format has");
  if (model.size() == 0) throw Error(ErrorKind::badData, path, "the model has no Gaussians");
  renameAxesForCoding(model);
  SogWriter writer(std::move(model), options, path);
  std::vector<ZipEntry> entries = writer.write();
  if (clipped) *clipped = writer.clippedTexels();
  return entries;
}

std::vector<std::uint32_t> writeSog(const std::filesystem::path& path, const GaussianModel& model,
                                    const SogOptions& options, std::uint64_t* clipped) {
  std::vector<std::uint32_t> order;
  if (model.size() > 0) order = hilbertOrder(model.mean);
  const std::vector<ZipEntry> entries = sogFiles(select(model, order), path.string(), options, clipped);
  writeFileAtomically(path, [&](const std::filesystem::path& temporary) { writeZip(temporary, entries, path); });
  return order;
}

}  // namespace tg
