// SPDX-License-Identifier: Apache-2.0
// SOG in.
#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>

#include "converter/formats/repair.h"
#include "converter/formats/texel_spread.h"
#include "converter/sog/parts.h"
#include "converter/sog/sog.h"
#include "converter/sog/zip.h"
#include "core/bundle/ply.h"
#include "core/bundle/splat_rows.h"
#include "core/file/file.h"
#include "core/file/json.h"
#include "core/image/webp.h"
#include "core/model/fallback.h"
#include "core/model/texture_dictionary.h"
#include "core/model/verbs.h"
#include "core/system/error.h"
#include "core/system/parallel.h"

namespace tg {
namespace {

constexpr std::uint64_t kMaxFileBytes = std::uint64_t{4} << 30;
constexpr std::size_t kMaxName = 255;
// Of an image: some writers make it square, or its sides powers of two.
constexpr std::size_t kMostPerNeededPixel = 4;
constexpr std::size_t kPixelsAlwaysAllowed = std::size_t{1} << 22;  // the largest palette has fewer
constexpr std::uint64_t kMostBytesPerPixel = 8;                     // lossless, of noise, with metadata

class SogReader {
 public:
  // place: what messages call meta.json behind the path, where that does not name it.
  SogReader(SogFiles files, const std::string& path, std::string place)
      : path_(path),
        place_(std::move(place)),
        files_(std::move(files)),
        json_(parseJson(files_("meta.json", sog::kMaxMetaBytes), path)) {
    const JsonNode meta = root().object();
    if (!meta.has("version")) meta.fail("has no version (SOG version 1 is not supported, expected version 2)");
    meta.integer("version", sog::kVersion, sog::kVersion);
    count_ = static_cast<std::size_t>(meta.integer("count", 1, static_cast<std::int64_t>(kMaxGaussians)));
  }

  std::size_t count() const { return count_; }

  Bundle read(bool base_only) {
    const JsonNode meta = root();
    const auto has = [&](const char* key) { return meta.has(key) && !meta.member(key).is_null(); };
    const JsonNode sh = has("shN") ? meta.at("shN").object() : meta;
    const int degree = has("shN") ? static_cast<int>(sh.integer("bands", 0, 3)) : 0;
    readMeans(meta.at("means").object(), degree);
    readScales(meta.at("scales").object());
    readRotations(meta.at("quats").object());
    readColors(meta.at("sh0").object());
    if (degree > 0) readSh(sh);
    if (has("model") && meta.string("model") != "default") {
      loaded_.warnings.push_back("trained as " + meta.at("model").shown() + ", which the model has no word for");
    } else if (has("antialias") && meta.boolean("antialias")) {
      loaded_.warnings.emplace_back(kAntialiasedWarning);
    }
    if (!base_only && has(sog::kTextures)) readTextures(meta.at(sog::kTextures).object());
    checkModel(loaded_.model, path_);
    return std::move(loaded_);
  }

 private:
  JsonNode root() const { return {json_, path_, place_}; }

  // File `index` of the `files` that `node` lists.
  // `expected`: pixels that are known not to be too many, as decodeWebp() has it.
  BytePixels image(const JsonNode& node, std::size_t files, std::size_t index, std::size_t least,
                   std::size_t expected = 0) const {
    node.array("files", files);
    const std::string name = node.at("files").element(index).string();
    if (name.size() > kMaxName) node.fail("a file's name is too long" + atMost(kMaxName, name.size()));
    const std::string where = path_ + ": " + name;
    const std::size_t most = std::max(kMostPerNeededPixel * least, kPixelsAlwaysAllowed);
    const std::vector<std::uint8_t> bytes = files_(name, kMostBytesPerPixel * most);
    constexpr std::array<std::uint8_t, 4> kPng = {0x89, 'P', 'N', 'G'};
    if (bytes.size() >= kPng.size() && std::ranges::equal(kPng, std::span(bytes).first(kPng.size()))) {
      throw Error(ErrorKind::badData, where, "wrong kind of image" + expectedFound("a lossless WebP", "a PNG"));
    }
    const WebpHeader header = readWebpHeader(bytes, where);
    if (!header.lossless) {
      throw Error(ErrorKind::badData, where, "wrong kind of image" + expectedFound("a lossless WebP", "a lossy one"));
    }
    const std::size_t found = static_cast<std::size_t>(header.width) * static_cast<std::size_t>(header.height);
    if (found > most) throw Error(ErrorKind::badData, where, "too many pixels" + atMost(most, found));
    if (found < least) {
      throw Error(
          ErrorKind::badData, where,
          "too few pixels (expected at least " + std::to_string(least) + ", found " + std::to_string(found) + ")");
    }
    return decodeWebp(bytes, where, expected);
  }

  // An index beyond the list has its last value. A first value of null is one that a writer's bug left out: as in
  // PlayCanvas' engine it lies a 255th of the others' range before them.
  std::vector<float> codebook(const JsonNode& node) const {
    const JsonNode list = node.at("codebook").array();
    const std::size_t size = list.size();
    if (size < 1 || size > sog::kCodebook)
      list.fail("wrong number of values (expected 1 to 256, found " + std::to_string(size) + ")");
    std::vector<float> values;
    const bool repaired = size == sog::kCodebook && list.value[0].is_null();
    if (repaired) values.push_back(0);
    for (std::size_t i = values.size(); i < size; ++i) {
      values.push_back(static_cast<float>(list.finite(list.value[i], std::to_string(i))));
    }
    if (repaired) values[0] = values[1] + (values[1] - values.back()) / (sog::kCodebook - 1);
    values.resize(sog::kCodebook, values.back());
    return values;
  }

  // The model grows once its images are there, whose bytes bound the count: those of other numbers may be of one
  // colour.
  void readMeans(const JsonNode& node, int degree) {
    const auto low = node.numbers<3>("mins"), high = node.numbers<3>("maxs");
    const BytePixels lower = image(node, 2, 0, count_), upper = image(node, 2, 1, count_);
    resizeGaussians(loaded_.model, count_, degree);
    for (std::size_t i = 0; i < count_; ++i) {
      for (int k = 0; k < 3; ++k) {
        const int code = lower.data[4 * i + k] | upper.data[4 * i + k] << 8;
        loaded_.model.mean[i][k] = static_cast<float>(sog::fromLogarithm(low[k] + (high[k] - low[k]) * code / 65535.0));
      }
    }
  }

  void readScales(const JsonNode& node) {
    const std::vector<float> values = codebook(node);
    const BytePixels pixels = image(node, 1, 0, count_, count_);
    for (std::size_t i = 0; i < count_; ++i) {
      for (int k = 0; k < 3; ++k) loaded_.model.log_scale[i][k] = values[pixels.data[4 * i + k]];
    }
  }

  void readRotations(const JsonNode& node) {
    const BytePixels pixels = image(node, 1, 0, count_, count_);
    std::size_t broken = 0;
    for (std::size_t i = 0; i < count_; ++i) {
      const std::uint8_t* bytes = pixels.data.data() + 4 * i;
      const int largest = bytes[3] - sog::kFirstLargest;
      glm::vec4 q(0.0f);
      if (largest < 0) {
        ++broken;
        q[0] = 1.0f;
      } else {
        double rest = 1.0;
        for (int k = 0, from = 0; k < 4; ++k) {
          if (k == largest) continue;
          const double value = (bytes[from++] / 255.0 * 2.0 - 1.0) * std::sqrt(0.5);
          q[k] = static_cast<float>(value);
          rest -= value * value;
        }
        q[largest] = static_cast<float>(std::sqrt(std::max(rest, 0.0)));
        if (!hasLength(q)) q[0] = 1.0f;
      }
      loaded_.model.rotation[i] = q;
    }
    addSplatCount(loaded_.repairs, broken, "with a broken rotation: not turned");
  }

  void readColors(const JsonNode& node) {
    const std::vector<float> values = codebook(node);
    const BytePixels pixels = image(node, 1, 0, count_, count_);
    GaussianModel& model = loaded_.model;
    for (std::size_t i = 0; i < count_; ++i) {
      for (int k = 0; k < 3; ++k) model.sh[i * model.shCount()][k] = values[pixels.data[4 * i + k]];
      model.opacity_logit[i] = logitFromOpacity(pixels.data[4 * i + 3] / 255.0);
    }
  }

  void readSh(const JsonNode& node) {
    const std::vector<float> values = codebook(node);
    GaussianModel& model = loaded_.model;
    const std::size_t rest = model.shCount() - 1;
    const auto size = static_cast<std::size_t>(node.integer("count", 1, sog::kMaxPalette));
    const BytePixels rows = image(node, 2, 0, 1), labels = image(node, 2, 1, count_, count_);
    if (static_cast<std::size_t>(rows.width) != sog::kPaletteColumns * rest) {
      node.fail("the palette's picture has a wrong width" +
                expectedFound(sog::kPaletteColumns * rest, static_cast<std::uint64_t>(rows.width)));
    }
    const std::size_t held = sog::kPaletteColumns * static_cast<std::size_t>(rows.height);
    for (std::size_t i = 0; i < count_; ++i) {
      const std::size_t label = labels.data[4 * i] | std::size_t{labels.data[4 * i + 1]} << 8;
      if (label >= size || label >= held) {
        throw Error(ErrorKind::badData, path_,
                    "Gaussian " + std::to_string(i) + " has SH that the palette lacks (expected an index below " +
                        std::to_string(std::min(size, held)) + ", found " + std::to_string(label) + ")");
      }
      const std::uint8_t* row = rows.data.data() + 4 * (label * rest);
      for (std::size_t c = 0; c < rest; ++c) {
        for (int k = 0; k < 3; ++k) model.sh[i * model.shCount() + 1 + c][k] = values[row[4 * c + k]];
      }
    }
  }

  void readTextures(const JsonNode& node) {
    const std::int64_t version = node.integer("version", 1, 1000);
    if (version != sog::kOwnTextures && version != sog::kSharedTextures) {
      loaded_.warnings.push_back("textures of another version than 1 and 2 are left out");
      return;
    }
    GaussianModel& model = loaded_.model;
    model.texture_mode = named<TextureMode>(node, "mode");
    model.intersection = named<IntersectionModel>(node, "intersection");
    model.outside = named<TextureOutside>(node, "outside");
    if (model.texture_mode == TextureMode::none) node.fail("mode: textures have one (expected alpha, rgb or rgba)");
    const auto steps = node.numbers<2>("steps", 0.0, 1.0);
    const bool shared = version == sog::kSharedTextures;
    const auto stored = shared ? static_cast<std::size_t>(node.integer("textures", 1, kMostSharedTextures)) : count_;
    const std::size_t file_count = shared ? 3 : 2;
    const BytePixels sizes = image(node, file_count, 0, stored);
    std::vector<TextureRect> rects(stored);
    std::uint64_t texel_count = 0;
    for (std::size_t i = 0; i < stored; ++i)
      place(rects[i], sizes.data[4 * i], sizes.data[4 * i + 1], texel_count, kMaxModelTexels, node);
    std::vector<std::uint32_t> labels, members(stored);  // of each Gaussian; of each texture
    if (shared) {
      labels = readLabels(image(node, file_count, 2, count_, count_), stored);
      for (const std::uint32_t label : labels) ++members[label];
    }
    const BytePixels values = image(node, file_count, 1, texel_count);
    std::vector<glm::vec4> texels(texel_count);
    std::size_t at = 0;
    for (const sog::SizeClass& group : sog::sizeClasses(rects)) {
      const std::vector<double> spreads = texelSpreads(group.width, group.height);
      for (std::size_t t = 0; t < spreads.size(); ++t) {
        for (const std::uint32_t i : group.textures) {
          const double spread =
              spreads[t] * (shared ? sog::sharedSpread(members[i]) : opacitySpread(opacityOf(model, i)));
          const std::uint8_t* bytes = values.data.data() + 4 * at++;
          glm::vec4& texel = texels[rects[i].offset + t];
          for (int k = 0; k < 4; ++k) {
            texel[k] =
                static_cast<float>((bytes[k] - sog::kNeutralByte) * sog::texelStep(steps[k == 3], spread, shared));
          }
          texel.a = std::clamp(1.0f + texel.a, 0.0f, 1.0f);
        }
      }
    }
    neutralize(texels, model.texture_mode);
    if (shared) {
      handOut(rects, texels, labels, node);
    } else {
      model.atlas = {std::move(rects), std::move(texels)};
    }
    removeFallback(model, sog::fallbackScale(shared));
  }

  // A rectangle behind the `texels` that there are.
  static void place(TextureRect& rect, int width, int height, std::uint64_t& texels, std::uint64_t most,
                    const JsonNode& node) {
    rect = {static_cast<std::uint32_t>(texels), static_cast<std::uint16_t>(width), static_cast<std::uint16_t>(height)};
    if (rect.texelCount() == 0) rect = {};
    texels += rect.texelCount();
    if (texels > most) node.fail("too many texels" + atMost(most, texels));
  }

  std::vector<std::uint32_t> readLabels(const BytePixels& pixels, std::size_t textures) const {
    std::vector<std::uint32_t> labels(count_);
    for (std::size_t i = 0; i < count_; ++i) {
      labels[i] = static_cast<std::uint32_t>(pixels.data[4 * i] | pixels.data[4 * i + 1] << 8);
      if (labels[i] < textures) continue;
      throw Error(ErrorKind::badData, path_,
                  "Gaussian " + std::to_string(i) + " has a texture that there is not (expected an index below " +
                      std::to_string(textures) + ", found " + std::to_string(labels[i]) + ")");
    }
    return labels;
  }

  // To every Gaussian the texture that its label names.
  void handOut(std::span<const TextureRect> rects, std::span<const glm::vec4> texels,
               std::span<const std::uint32_t> labels, const JsonNode& node) {
    TextureAtlas& atlas = loaded_.model.atlas;
    atlas.rects.resize(count_);
    std::uint64_t texel_count = 0;
    for (std::size_t i = 0; i < count_; ++i) {
      const TextureRect& own = rects[labels[i]];
      place(atlas.rects[i], own.width, own.height, texel_count, sog::kMostHandedOut, node);
    }
    atlas.texels.resize(texel_count);
    for (std::size_t i = 0; i < count_; ++i) {
      std::copy_n(texels.begin() + rects[labels[i]].offset, atlas.rects[i].texelCount(),
                  atlas.texels.begin() + atlas.rects[i].offset);
    }
  }

  template <typename T>
  static T named(const JsonNode& node, const char* key) {
    const std::string name = node.string(key);
    const std::optional<T> value = parse<T>(name);
    if (!value) node.fail(std::string(key) + expectedFound(allNames<T>(), "\"" + name + "\""));
    return *value;
  }

  const std::string& path_;
  const std::string place_;
  const SogFiles files_;
  nlohmann::json json_;
  std::size_t count_ = 0;
  Bundle loaded_;
};

}  // namespace

Bundle parseSog(std::span<const std::uint8_t> bytes, const std::string& path, bool base_only) {
  const ZipReader zip(bytes, path);
  SogReader reader([&](const std::string& name, std::uint64_t most) { return zip.read(name, most); }, path,
                   "meta.json");
  if (reader.count() > sog::kCountAlwaysAllowed && reader.count() / sog::kMostPerByte > bytes.size()) {
    throw Error(ErrorKind::badData, path,
                "meta.json: too many Gaussians for a file of " + std::to_string(bytes.size()) + " bytes (found " +
                    std::to_string(reader.count()) + ")");
  }
  return reader.read(base_only);
}

Bundle parseSogFiles(const SogFiles& files, const std::string& path, std::uint64_t most, bool base_only) {
  SogReader reader(files, path, "");
  if (reader.count() > most) {
    throw Error(ErrorKind::badData, path, "too many Gaussians" + atMost(most, reader.count()));
  }
  return reader.read(base_only);
}

Bundle readSog(const std::filesystem::path& path, bool base_only) {
  return parseSog(readFile(path, kMaxFileBytes), path.string(), base_only);
}

}  // namespace tg
