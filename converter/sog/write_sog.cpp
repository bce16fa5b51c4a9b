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
constexpr glm::vec4 kNeutralTexel(0, 0, 0, 1);

// Steps of the other codes, 1 at least, at options.steps `f`: such that a byte less costs a picture about as much
// whatever it is taken from (docs/lab/converter.md).
// Positions are two bytes that are coded apart: powers of two leave the lower one few values. Not all axes change
// theirs at once, so that files shrink by little.
double positionStep(double f, int axis) { return std::exp2(std::floor(2 + 1.5 * std::log2(f) + axis / 3.0)); }
double opacityStep(double f) { return 4 * f - 2; }
// Textures of a Gaussian's own hang on its axes. Scales have a codebook for all, of which the part `textured` has one.
double rotationStep(double f, bool textured) { return textured ? f / 4 : f; }
double scaleStep(double f, double textured) { return std::pow(f * std::pow(0.25, textured), 0.6); }

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

// Of a rotation's component, in [-1, 1] / sqrt(2): coarse steps go out from the byte nearest to 0, to which components
// are brought (renameAxesForCoding()).
std::uint8_t rotationByte(double component, double step) {
  constexpr double kMiddle = 128;
  const double value = 255 * (component * std::sqrt(0.5) + 0.5);
  if (step <= 1) return static_cast<std::uint8_t>(std::clamp(std::round(value), 0.0, 255.0));
  const double steps = std::round((value - kMiddle) / step);
  return static_cast<std::uint8_t>(std::clamp(std::round(kMiddle + steps * step), 0.0, 255.0));
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
    if (isTextured(model_)) {
      addTextures();  // first: the base holds what stands in for the texels
    } else {
      findShortestAxes();
    }
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

  const SogReport& report() const { return report_; }

 private:
  // Before scales are baked, which may make two the same.
  void findShortestAxes() {
    shortest_axes_.clear();
    for (const glm::vec3& log_scale : model_.log_scale) shortest_axes_.push_back(shortestAxis(log_scale));
  }

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
    const double step = scaleStep(options_.steps, textured_part_);
    const auto size = static_cast<std::size_t>(sog::kCodebook / std::max(1.0, step));
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
      const bool textured = !own_textures_.empty() && own_textures_[i];
      const double step = rotationStep(options_.steps, textured);
      std::uint8_t* bytes = pixels.data.data() + 4 * i;
      for (int k = 0, to = 0; k < 4; ++k) {
        if (k != largest) bytes[to++] = rotationByte(sign * q[k], step);
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

  // The last part that wants the model's coefficients: it takes them, as a second copy would be most of a model.
  void addSh() {
    const std::size_t n = model_.size(), rest = model_.shCount() - 1, length = 3 * rest;
    std::vector<glm::vec3> sh = std::move(model_.sh);
    for (std::size_t i = 0; i < n; ++i) std::copy_n(sh.data() + i * (rest + 1) + 1, rest, sh.data() + i * rest);
    const Palette palette = makePalette({&sh.front().x, n * length}, length, sog::kMaxPalette);
    std::vector<glm::vec3>().swap(sh);
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

  bool isShared(std::span<const std::uint32_t> groups) const {
    return areShared(model_.atlas, groups) && model_.atlas.texels.size() <= sog::kMostHandedOut;
  }

  // `base`: with the opacities that the reader sees.
  Stored storedTextures(const GaussianModel& base) const {
    const std::vector<TextureRect>& rects = model_.atlas.rects;
    const std::vector<std::uint32_t> groups = textureGroups(model_.atlas);
    Stored stored;
    if (isShared(groups)) {
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
          const glm::vec4 change = model_.atlas.texels[stored.rects[i].offset + t] - kNeutralTexel;
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

  // Of a texel that differs so much from the neutral one: its bytes, not clamped.
  static glm::dvec4 codesOf(const glm::vec4& change, const std::array<double, 2>& steps, double spread, bool shared) {
    glm::dvec4 codes;
    for (int k = 0; k < 4; ++k) {
      codes[k] = wholeSteps(static_cast<double>(change[k]) / sog::texelStep(steps[k == 3], spread, shared));
    }
    return codes;
  }

  // Takes the textures whose texels all round to the neutral one: what stands in for them is nearer to the model, and
  // takes fewer bytes. Whether there were any.
  bool dropTextures(const Stored& stored, const std::array<double, 2>& steps, GaussianModel& base) {
    std::vector<bool> neutral(stored.rects.size(), false);
    for (const sog::SizeClass& group : sog::sizeClasses(stored.rects)) {
      const std::vector<double> spreads = texelSpreads(group.width, group.height);
      for (const std::uint32_t i : group.textures) {
        bool all = true;
        for (std::size_t t = 0; t < spreads.size() && all; ++t) {
          const glm::vec4 change = model_.atlas.texels[stored.rects[i].offset + t] - kNeutralTexel;
          all = codesOf(change, steps, spreads[t] * stored.coarser[i], stored.shared()) == glm::dvec4(0);
        }
        neutral[i] = all;
      }
    }
    std::vector<std::uint32_t> dropped;
    for (std::uint32_t i = 0; i < model_.size(); ++i) {
      if (neutral[stored.shared() ? stored.labels[i] : i]) dropped.push_back(i);
    }
    if (dropped.empty()) return false;
    const GaussianModel fallback = bakeFallback(select(model_, dropped), FallbackScale::fitted);
    for (std::size_t k = 0; k < dropped.size(); ++k) {
      const std::uint32_t i = dropped[k];
      model_.atlas.rects[i] = {};
      for (GaussianModel* model : {&model_, &base}) {
        model->sh[i * model_.shCount()] = fallback.sh[k * model_.shCount()];
        model->opacity_logit[i] = fallback.opacity_logit[k];
        model->log_scale[i] = fallback.log_scale[k];
      }
    }
    return true;
  }

  // Leaves in the model the texels that `stored` are, and their bytes in its image.
  std::vector<glm::u8vec4> roundTexels(const Stored& stored, const std::array<double, 2>& steps) {
    std::vector<std::uint64_t> members(stored.rects.size(), stored.shared() ? 0 : 1);  // that have the texture
    for (const std::uint32_t label : stored.labels) ++members[label];
    std::vector<glm::u8vec4> all_bytes;
    report_ = {};
    for (const sog::SizeClass& group : sog::sizeClasses(stored.rects)) {
      const std::vector<double> spreads = texelSpreads(group.width, group.height);
      for (std::size_t t = 0; t < spreads.size(); ++t) {
        for (const std::uint32_t i : group.textures) {
          const double spread = spreads[t] * stored.coarser[i];
          glm::vec4& texel = model_.atlas.texels[stored.rects[i].offset + t];
          const glm::dvec4 codes = codesOf(texel - kNeutralTexel, steps, spread, stored.shared());
          glm::u8vec4& bytes = all_bytes.emplace_back();
          bool clips = false;
          for (int k = 0; k < 4; ++k) {
            const double stored_byte = codes[k] + sog::kNeutralByte;
            clips = clips || (steps[k == 3] == kWidestStep && (stored_byte < 0 || stored_byte > 255));
            bytes[k] = toByte(stored_byte);
            const double own = sog::texelStep(steps[k == 3], spread, stored.shared());
            texel[k] = static_cast<float>(static_cast<double>(kNeutralTexel[k]) + (bytes[k] - sog::kNeutralByte) * own);
          }
          texel.a = std::clamp(texel.a, 0.0f, 1.0f);
          report_.texels += members[i];
          if (clips) report_.clipped_texels += members[i];
        }
      }
    }
    for (std::size_t i = 0; i < stored.labels.size(); ++i) {
      const TextureRect own = model_.atlas.rects[i], owner = stored.rects[stored.labels[i]];
      std::copy_n(model_.atlas.texels.begin() + owner.offset, owner.texelCount(),
                  model_.atlas.texels.begin() + own.offset);
    }
    return all_bytes;
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
    // Of the texels before they are rounded: other readers see all of them, ours take off the mean of what is stored.
    // The reader chooses steps by the opacity that is stored.
    GaussianModel base = bakeFallback(model_, FallbackScale::kept);
    Stored stored;
    std::array<double, 2> steps;
    std::vector<glm::u8vec4> bytes;
    do {  // once more where rounding makes textures equal: whoever reads the file would find them shared
      do {
        stored = storedTextures(base);
        steps = texelSteps(stored);
      } while (dropTextures(stored, steps, base));
      bytes = roundTexels(stored, steps);
    } while (!stored.shared() && isShared(textureGroups(model_.atlas)));
    renameAxesForCoding(model_);
    findShortestAxes();
    if (bytes.empty()) {
      model_ = withoutTextures(model_);
      return;
    }
    const bool shared = stored.shared();
    if (!shared) {
      for (const TextureRect& rect : stored.rects) own_textures_.push_back(rect.texelCount() > 0);
      const auto textured = static_cast<double>(std::ranges::count(own_textures_, true));
      textured_part_ = textured / static_cast<double>(model_.size());
    }
    addTextureImages(stored, steps, bytes);
    model_ = bakeFallback(model_, sog::fallbackScale(shared));
    model_.sh = std::move(base.sh);
    if (!shared) model_.opacity_logit = std::move(base.opacity_logit);
  }

  void addTextureImages(const Stored& stored, const std::array<double, 2>& steps, std::span<const glm::u8vec4> bytes) {
    Json files;
    BytePixels& sizes = image(files, "texture_sizes.webp", stored.rects.size());
    for (std::size_t i = 0; i < stored.rects.size(); ++i) {
      sizes.data[4 * i] = static_cast<std::uint8_t>(stored.rects[i].width);
      sizes.data[4 * i + 1] = static_cast<std::uint8_t>(stored.rects[i].height);
    }
    BytePixels& values = image(files, "texture_texels.webp", bytes.size());
    for (std::size_t at = 0; at < bytes.size(); ++at) std::copy_n(&bytes[at].x, 4, values.data.data() + 4 * at);
    textures_ = {{"version", stored.shared() ? sog::kSharedTextures : sog::kOwnTextures}};
    if (stored.shared()) {
      textures_["textures"] = stored.owners.size();
      BytePixels& labels = image(files, "texture_labels.webp", model_.size());
      for (std::size_t i = 0; i < model_.size(); ++i) {
        labels.data[4 * i] = static_cast<std::uint8_t>(stored.labels[i] & 255u);
        labels.data[4 * i + 1] = static_cast<std::uint8_t>(stored.labels[i] >> 8);
      }
    }
    textures_.update({{"mode", name(model_.texture_mode)},
                      {"intersection", name(model_.intersection)},
                      {"outside", name(model_.outside)},
                      {"steps", steps},
                      {"files", std::move(files)}});
  }

  GaussianModel model_;
  std::vector<int> shortest_axes_;
  std::vector<bool> own_textures_;  // whether a Gaussian has one; empty: none, or those that others have, too
  double textured_part_ = 0;        // of own_textures_
  SogReport report_;
  const SogOptions& options_;
  const std::string& path_;
  Json meta_ = Json::object(), textures_;
  std::vector<std::pair<std::string, BytePixels>> images_;
};

}  // namespace

std::vector<ZipEntry> sogFiles(GaussianModel model, const std::string& path, const SogOptions& options,
                               SogReport* report) {
  TG_ASSERT(lengthsAgree(model), "the model's arrays have their lengths");
  TG_ASSERT(options.steps >= kLeastSteps && options.steps <= kMostSteps && options.texture_step > 0,
            "steps that the format has");
  if (model.size() == 0) throw Error(ErrorKind::badData, path, "the model has no Gaussians");
  renameAxesForCoding(model);
  SogWriter writer(std::move(model), options, path);
  std::vector<ZipEntry> entries = writer.write();
  if (report) *report = writer.report();
  return entries;
}

std::vector<std::uint32_t> writeSog(const std::filesystem::path& path, const GaussianModel& model,
                                    const SogOptions& options, SogReport* report) {
  std::vector<std::uint32_t> order;
  if (model.size() > 0) order = hilbertOrder(model.mean);
  const std::vector<ZipEntry> entries = sogFiles(select(model, order), path.string(), options, report);
  writeFileAtomically(path, [&](const std::filesystem::path& temporary) { writeZip(temporary, entries, path); });
  return order;
}

double sogStep(double low, double high, double x) {
  const double code = (sog::toLogarithm(high) - sog::toLogarithm(low)) / kLastCode;
  return code * positionStep(SogOptions().steps, 2) * (1 + std::abs(x));
}

}  // namespace tg
