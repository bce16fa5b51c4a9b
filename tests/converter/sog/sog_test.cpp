// SPDX-License-Identifier: Apache-2.0
// SOG: files of other programs mean what they mean there, ours come back within their steps.
#include "converter/sog/sog.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <nlohmann/json.hpp>

#include "converter/check.h"
#include "converter/edit/quality.h"
#include "converter/registry/file_format.h"
#include "converter/scenes.h"
#include "converter/scratch.h"
#include "converter/sog/folder.h"
#include "converter/sog/zip.h"
#include "core/file/file.h"
#include "core/image/image.h"
#include "core/image/webp.h"
#include "core/model/equivalent_axes.h"
#include "core/model/fallback.h"
#include "core/model/texture_dictionary.h"
#include "core/model/verbs.h"
#include "core/system/error.h"
#include "shared/splat.h"
#include "support/catch.h"
#include "support/message_of.h"
#include "support/scenes.h"

using namespace tg;

namespace {

// Two Gaussians of SH degree 1 as another program writes them, every byte known.
struct SogParts {
  nlohmann::json meta = nlohmann::json::parse(R"({
    "version": 2, "count": 2, "asset": {"generator": "a test"},
    "means": {"mins": [0, -1, 0.5], "maxs": [2, 1, 0.5], "files": ["l.webp", "u.webp"]},
    "scales": {"codebook": [-3, -2, -1], "files": ["scales.webp"]},
    "quats": {"files": ["quats.webp"]},
    "sh0": {"codebook": [0, 0.5, 1], "files": ["sh0.webp"]},
    "shN": {"count": 2, "bands": 1, "codebook": [-0.25, 0.25], "files": ["rows.webp", "labels.webp"]}
  })");
  // A row of pixels each; behind them stands one that nothing may look at.
  std::vector<std::pair<std::string, std::vector<std::uint8_t>>> images = {
      {"l.webp", {0, 255, 0, 255, 255, 0, 0, 255}},  {"u.webp", {0, 255, 0, 255, 255, 0, 0, 255}},
      {"scales.webp", {0, 1, 2, 255, 2, 1, 0, 255}}, {"quats.webp", {128, 128, 128, 252, 255, 0, 128, 254}},
      {"sh0.webp", {0, 1, 2, 0, 2, 1, 0, 51}},       {"labels.webp", {1, 0, 0, 255, 0, 0, 0, 255}},
  };
  std::vector<ZipEntry> replaced;  // in the place of images of their names
  int palette_width = 64 * 3;

  std::vector<std::uint8_t> bytes(const Scratch& scratch) const {
    const std::string text = meta.dump();
    std::vector<ZipEntry> entries = {{"meta.json", {text.begin(), text.end()}}};
    for (const auto& [name, data] : images) {
      BytePixels pixels(static_cast<int>(data.size() / 4) + 1, 1);
      std::fill(pixels.data.begin(), pixels.data.end(), std::uint8_t{0xee});
      std::copy(data.begin(), data.end(), pixels.data.begin());
      entries.push_back({name, encodeWebp(pixels)});
    }
    BytePixels palette(palette_width, 1);
    for (std::size_t i = 0; i < 12 && i < palette.data.size(); ++i) palette.data[i] = 0;
    for (std::size_t i = 12; i < 24 && i < palette.data.size(); ++i) palette.data[i] = i == 13 ? 0 : 1;
    entries.push_back({"rows.webp", encodeWebp(palette)});
    for (const ZipEntry& entry : replaced) {
      *std::ranges::find(entries, entry.name, &ZipEntry::name) = entry;
    }
    const auto path = scratch.folder() / "parts.sog";
    writeZip(path, entries, path);
    return readFile(path, 1 << 20);
  }
};

// One pixel each.
const std::vector<std::uint8_t> kLossy = {0x52, 0x49, 0x46, 0x46, 0x22, 0x00, 0x00, 0x00, 0x57, 0x45, 0x42,
                                          0x50, 0x56, 0x50, 0x38, 0x20, 0x16, 0x00, 0x00, 0x00, 0x30, 0x01,
                                          0x00, 0x9d, 0x01, 0x2a, 0x01, 0x00, 0x01, 0x00, 0x0e, 0xc0, 0xfe,
                                          0x25, 0xa4, 0x00, 0x03, 0x70, 0x00, 0x00, 0x00, 0x00};
const std::vector<std::uint8_t> kLossyWithAlpha = {
    0x52, 0x49, 0x46, 0x46, 0x4a, 0x00, 0x00, 0x00, 0x57, 0x45, 0x42, 0x50, 0x56, 0x50, 0x38, 0x58, 0x0a,
    0x00, 0x00, 0x00, 0x10, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x41, 0x4c, 0x50, 0x48,
    0x0c, 0x00, 0x00, 0x00, 0x11, 0x07, 0x10, 0x11, 0xfd, 0x0f, 0x44, 0x44, 0xff, 0x03, 0x00, 0x00, 0x56,
    0x50, 0x38, 0x20, 0x18, 0x00, 0x00, 0x00, 0x14, 0x01, 0x00, 0x9d, 0x01, 0x2a, 0x01, 0x00, 0x01, 0x00,
    0x00, 0x00, 0xfe, 0x00, 0x00, 0x0d, 0xc0, 0x00, 0xfe, 0xe6, 0xb5, 0x00, 0x00, 0x00};

// A file as encodeWebp makes it, behind a chunk of features (VP8X) that says `alpha`.
std::vector<std::uint8_t> extended(const std::vector<std::uint8_t>& webp, int width, int height, bool alpha) {
  constexpr std::size_t kRiff = 12;
  const auto last = [](int side) { return static_cast<std::uint8_t>(side - 1); };
  std::vector<std::uint8_t> out(webp.begin(), webp.begin() + kRiff);
  out.insert(out.end(), {'V', 'P', '8', 'X', 10, 0, 0, 0, static_cast<std::uint8_t>(alpha ? 0x10 : 0), 0, 0, 0,
                         last(width), 0, 0, last(height), 0, 0});
  out.insert(out.end(), webp.begin() + kRiff, webp.end());
  const auto bytes = static_cast<std::uint32_t>(out.size() - 8);
  for (int k = 0; k < 4; ++k) out[4 + static_cast<std::size_t>(k)] = static_cast<std::uint8_t>(bytes >> 8 * k);
  return out;
}

}  // namespace

TEST_CASE("SOG: another program's file is read as its specification says") {
  const Scratch scratch;
  const Bundle loaded = parseSog(SogParts().bytes(scratch), "a.sog");
  CHECK(loaded.warnings.empty());
  const GaussianModel& model = loaded.model;
  REQUIRE(model.size() == 2);
  REQUIRE(model.sh_degree == 1);
  CHECK(largest(model.mean[0] - glm::vec3(0, std::exp(1.0) - 1, std::exp(0.5) - 1)) < 1e-6);
  CHECK(largest(model.mean[1] - glm::vec3(std::exp(2.0) - 1, 1 - std::exp(1.0), std::exp(0.5) - 1)) < 1e-6);
  CHECK(model.log_scale[0] == glm::vec3(-3, -2, -1));
  CHECK(model.log_scale[1] == glm::vec3(-1, -2, -3));
  const float near_zero = (128.0f / 255 * 2 - 1) * std::sqrt(0.5f);
  CHECK(model.rotation[0].y == Approx(near_zero).margin(1e-6));
  CHECK(model.rotation[0].x == Approx(std::sqrt(1 - 3 * near_zero * near_zero)));
  // The largest is y: w, x and z are stored.
  CHECK(model.rotation[1].x == Approx(std::sqrt(0.5)));
  CHECK(model.rotation[1].y == Approx(-std::sqrt(0.5)));
  CHECK(model.rotation[1].w == Approx(near_zero).margin(1e-6));
  CHECK(std::abs(model.rotation[1].z) < 1e-3f);
  CHECK(model.sh[0] == glm::vec3(0, 0.5, 1));
  CHECK(model.sh[4] == glm::vec3(1, 0.5, 0));
  CHECK(opacityOf(model, 0) < 1e-8);
  CHECK(opacityOf(model, 1) == Approx(0.2));
  CHECK(model.sh[1] == glm::vec3(0.25, -0.25, 0.25));
  CHECK(model.sh[3] == glm::vec3(0.25));
  CHECK(model.sh[5] == glm::vec3(-0.25));
}

TEST_CASE("SOG: what a file says wrongly is refused in words") {
  const Scratch scratch;
  const auto refusal = [&](const std::function<void(SogParts&)>& change) {
    SogParts parts;
    change(parts);
    return test::messageOf([&] { parseSog(parts.bytes(scratch), "a.sog"); });
  };
  CHECK(refusal([](SogParts&) {}) == "accepted");
  CHECK(refusal([](SogParts& p) { p.meta.erase("version"); }) ==
        "a.sog: meta.json: has no version (SOG version 1 is not supported, expected version 2)");
  CHECK(refusal([](SogParts& p) { p.meta["version"] = 3; }).find("\"version\"") != std::string::npos);
  CHECK(refusal([](SogParts& p) { p.meta["count"] = 0; }).find("\"count\"") != std::string::npos);
  CHECK(refusal([](SogParts& p) { p.meta["count"] = 50'000'000; }).find("too many Gaussians for a file of") !=
        std::string::npos);
  CHECK(refusal([](SogParts& p) { p.meta["count"] = 4; }) ==
        "a.sog: l.webp: too few pixels (expected at least 4, found 3)");
  CHECK(refusal([](SogParts& p) { p.meta["means"]["files"][1] = "../u.webp"; }) ==
        "a.sog: the ZIP archive has no entry \"../u.webp\"");
  CHECK(refusal([](SogParts& p) { p.meta["means"]["maxs"][0] = 1e6; }).find("Gaussian") != std::string::npos);
  CHECK(refusal([](SogParts& p) {
          p.meta["scales"]["codebook"] = nlohmann::json::array();
        }).find("wrong number of values (expected 1 to 256, found 0)") != std::string::npos);
  CHECK(refusal([](SogParts& p) { p.meta["sh0"].erase("files"); }).find("\"files\"") != std::string::npos);
  // However many bytes are lost at the end, or too many follow it; some that follow do no harm.
  const std::vector<std::uint8_t> whole = SogParts().bytes(scratch);
  const auto withBytes = [&](std::size_t bytes) {
    std::vector<std::uint8_t> other = whole;
    other.resize(bytes);
    return test::messageOf([&] { parseSog(other, "a.sog"); });
  };
  for (const std::size_t bytes : {whole.size() / 2, std::size_t{21}, std::size_t{4}, whole.size() + (1 << 16)}) {
    CHECK(withBytes(bytes) == "a.sog: the ZIP archive has no end of its directory (in " + std::to_string(bytes) +
                                  " bytes): it may be cut off, or other bytes follow it");
  }
  for (std::size_t lost = 1; lost <= 22; ++lost) {
    CHECK_THAT(withBytes(whole.size() - lost), Contains("has no end of its directory"));
  }
  for (const std::size_t more : {1, 20'000, 65'535}) CHECK(withBytes(whole.size() + more) == "accepted");
  CHECK(refusal([](SogParts& p) { p.meta["shN"]["bands"] = 4; }).find("\"bands\"") != std::string::npos);
  CHECK(refusal([](SogParts& p) { p.meta["shN"]["count"] = 1; }) ==
        "a.sog: Gaussian 0 has SH that the palette lacks (expected an index below 1, found 1)");
  CHECK(refusal([](SogParts& p) { p.palette_width = 64; }).find("the palette's picture has a wrong width") !=
        std::string::npos);
}

TEST_CASE("SOG: an image takes no more memory than its Gaussians want") {
  const Scratch scratch;
  const auto refusal = [&](const std::string& name, std::vector<std::uint8_t> bytes) {
    SogParts parts;
    parts.replaced = {{name, std::move(bytes), true}};
    // What others take in the file is not its own.
    if (name == "scales.webp") parts.replaced.push_back({"sh0.webp", std::vector<std::uint8_t>(500'000)});
    return test::messageOf([&] { parseSog(parts.bytes(scratch), "a.sog"); });
  };
  std::vector<std::uint8_t> long_one(40 << 20);  // 120 kB of the file
  for (std::size_t i = 0; i < long_one.size(); ++i) long_one[i] = static_cast<std::uint8_t>(i >> 10);
  CHECK(refusal("scales.webp", long_one)
            .starts_with("a.sog: entry \"scales.webp\" is too long (expected at most 33554432, found "));
  const std::string bomb = refusal("scales.webp", std::vector<std::uint8_t>(30 << 20));  // 30 kB of the file
  CHECK(bomb.starts_with("a.sog: entry \"scales.webp\" is too long (expected at most "));
  const std::vector<std::uint8_t> large = encodeWebp(BytePixels(2100, 2000));
  CHECK(refusal("l.webp", large) == "a.sog: l.webp: too many pixels (expected at most 4194304, found 4200000)");
  CHECK(refusal("l.webp", encodeWebp(BytePixels(2000, 2000))) == "accepted");
}

TEST_CASE("SOG: lossy images and PNG are refused and lossless WebP is read in every container") {
  const Scratch scratch;
  const auto answer = [&](const std::vector<std::uint8_t>& scales) {
    SogParts parts;
    parts.meta["count"] = 1;
    parts.replaced = {{"scales.webp", scales}};
    return test::messageOf([&] { parseSog(parts.bytes(scratch), "a.sog"); });
  };
  const std::string refused = "a.sog: scales.webp: wrong kind of image (expected a lossless WebP, found a lossy one)";
  CHECK(answer(kLossy) == refused);
  CHECK(answer(kLossyWithAlpha) == refused);
  CHECK(answer(extended(kLossy, 1, 1, false)) == refused);
  CHECK(answer(encodePng(Image(1, 1, 4))) ==
        "a.sog: scales.webp: wrong kind of image (expected a lossless WebP, found a PNG)");
  const std::vector<std::uint8_t> lossless = encodeWebp(BytePixels(2, 1));
  CHECK(answer(lossless) == "accepted");
  CHECK(answer(extended(lossless, 2, 1, false)) == "accepted");
  CHECK(answer(extended(lossless, 2, 1, true)) == "accepted");
}

TEST_CASE("SOG: what is wrong in meta.json of a folder is told without naming it twice") {
  const auto files = [](const std::string&, std::uint64_t) {
    const std::string text = R"({"version": 2, "count": 2, "means": 7})";
    return std::vector<std::uint8_t>(text.begin(), text.end());
  };
  CHECK(test::messageOf([&] { parseSogFiles(files, "lod/0/0_0/meta.json", 10); }) ==
        "lod/0/0_0/meta.json: /means: wrong type (expected an object, found 7)");
}

TEST_CASE("SOG: a long name of what it was trained as is cut in the warning") {
  const Scratch scratch;
  SogParts parts;
  parts.meta["model"] = "2dgs";
  CHECK(parseSog(parts.bytes(scratch), "a.sog").warnings ==
        std::vector<std::string>{"trained as \"2dgs\", which the model has no word for"});
  parts.meta["model"] = std::string(100'000, 'm');
  CHECK(parseSog(parts.bytes(scratch), "a.sog").warnings ==
        std::vector<std::string>{"trained as \"" + std::string(36, 'm') + "..., which the model has no word for"});
}

TEST_CASE("SOG: what meta.json may leave out may be null") {
  const Scratch scratch;
  SogParts parts;
  parts.meta["model"] = parts.meta["antialias"] = parts.meta["shN"] = nullptr;
  const Bundle loaded = parseSog(parts.bytes(scratch), "a.sog");
  CHECK(loaded.warnings.empty());
  CHECK(loaded.model.sh_degree == 0);
}

TEST_CASE("SOG: files that are not bundled are the model of the bundled ones") {
  const Scratch scratch;
  const GaussianModel model = test::makeScene(test::SceneKind::ordinary, 18, 30).model;
  const auto meta = scratch.folder() / "a.json", bundled = scratch.folder() / "a.sog";
  const std::string images = "images (1) + \u00e9";
  std::filesystem::create_directory(scratch.folder() / images);
  std::uint64_t bytes = 0;
  std::string text;
  for (const ZipEntry& entry : sogFiles(model, "a.sog")) {
    const std::string content(entry.bytes.begin(), entry.bytes.end());
    if (entry.name == kSogMetaName) text = content;
    if (entry.name != kSogMetaName) scratch.write(images + "/" + entry.name, content);
    bytes += content.size();
  }
  nlohmann::json json = nlohmann::json::parse(text);
  for (nlohmann::json& part : json) {
    if (!part.is_object() || !part.contains("files")) continue;
    for (nlohmann::json& file : part["files"]) file = "./" + images + "/" + file.get<std::string>();
  }
  const auto store = [&] { scratch.write("a.json", json.dump()); };
  store();
  writeSog(bundled, model);
  const Format& format = detectFormat(meta);
  CHECK(format.name == kSogMetaName);
  CHECK(storedBytes(format, meta) == bytes - text.size() + json.dump().size());
  CHECK(readModel(meta).model.size() == model.size());
  CHECK(readModel(meta).model.texture_mode == model.texture_mode);
  CHECK(readModel(meta, {.base_only = true}).model.texture_mode == TextureMode::none);
  CHECK(checkFile(meta).errors.empty());
  const auto refusal = [&] { return test::messageOf([&] { readModel(meta); }).substr(meta.string().size()); };
  const nlohmann::json whole = json;
  for (const std::string name : {"../a.webp", "/a.webp", "images/../a.webp", ".a.webp", "images//a.webp"}) {
    json["sh0"]["files"][0] = name;
    store();
    CHECK(refusal() ==
          ": a file's name leaves the folder, or has other signs (expected letters, digits, spaces, _ - . ( ) + and /, "
          "found \"" +
              name + "\")");
  }
  for (const std::string key : {"means", "scales", "quats", "sh0"}) {
    json = whole;
    json.erase(key);
    store();
    CHECK(refusal() == ": \"" + key + "\" is missing");
  }
  json = whole;
  json["count"] = (1 << 20) + 1;
  store();
  CHECK(refusal().starts_with(": too many Gaussians (expected at most 1048576, found 1048577)"));
}

TEST_CASE("SOG: a codebook of 256 values that lacks its first has one step before the others") {
  const Scratch scratch;
  SogParts parts;
  nlohmann::json values = {nullptr};
  for (int i = 1; i < 256; ++i) values.push_back(i);
  parts.meta["sh0"]["codebook"] = values;
  const Bundle loaded = parseSog(parts.bytes(scratch), "a.sog");
  CHECK(loaded.model.sh[0] == glm::vec3(1.0f - 254.0f / 255, 1, 2));
  values[1] = nullptr;
  parts.meta["sh0"]["codebook"] = values;
  CHECK_THROWS_AS(parseSog(parts.bytes(scratch), "a.sog"), Error);
  parts.meta["sh0"]["codebook"] = {nullptr, 1, 2};
  CHECK_THROWS_AS(parseSog(parts.bytes(scratch), "a.sog"), Error);
}

TEST_CASE("SOG: a rotation that says nothing is counted, and turns nothing") {
  const Scratch scratch;
  SogParts parts;
  parts.images[3].second[3] = 7;
  const Bundle loaded = parseSog(parts.bytes(scratch), "a.sog");
  CHECK(loaded.model.rotation[0] == glm::vec4(1, 0, 0, 0));
  CHECK(loaded.repairs == std::vector<std::string>{"1 splats with a broken rotation: not turned"});
}

TEST_CASE("SOG: a model comes back in the order that is returned, within the steps of its numbers") {
  const Scratch scratch;
  for (int degree = 0; degree <= 3; ++degree) {
    const GaussianModel in = randomSplats(degree, 700, 20.0, degree + 90);
    const auto path = scratch.folder() / "a.sog";
    const std::vector<std::uint32_t> order = writeSog(path, in);
    GaussianModel out = readSog(path).model;
    REQUIRE(order.size() == in.size());
    const GaussianModel sorted = select(in, order);
    renameAxesTowards(out, sorted.rotation);
    REQUIRE(out.size() == in.size());
    REQUIRE(out.sh_degree == degree);
    for (std::size_t i = 0; i < in.size(); ++i) {
      CAPTURE(degree, i);
      // 65535 steps of the logarithm, 6.1 in all, that are 21 times as wide at 20.
      CHECK(largest(sorted.mean[i] - out.mean[i]) <= 4 * 21 * 6.1 / 65535 / 2 + 1e-5);
      CHECK(largest(sorted.log_scale[i] - out.log_scale[i]) <= 0.08);
      const glm::vec3 stored = out.log_scale[i];  // equals may have come in another order
      CHECK(stored[shortestAxis(sorted.log_scale[i])] == std::min({stored.x, stored.y, stored.z}));
      CHECK(std::abs(opacityOf(sorted, i) - opacityOf(out, i)) <= 1.0 / 255 + 1e-6);
      const glm::dvec4 a = glm::normalize(glm::dvec4(sorted.rotation[i]));
      const glm::dvec4 b = glm::normalize(glm::dvec4(out.rotation[i]));
      CHECK(std::abs(glm::dot(a, b)) > 1.0 - 5e-5);
      const std::size_t k = in.shCount();
      for (std::size_t c = 0; c < k; ++c) {
        CHECK(largest(sorted.sh[i * k + c] - out.sh[i * k + c]) <= 0.015 + 1e-6);
      }
    }
  }
}

TEST_CASE("SOG: few different scales are kept as they are") {
  const Scratch scratch;
  GaussianModel model = randomSplats(0, 40, 20.0, 0 + 90);
  const auto path = scratch.folder() / "a.sog";
  const std::vector<std::uint32_t> order = writeSog(path, model);
  const GaussianModel sorted = select(model, order);
  GaussianModel out = readSog(path).model;
  renameAxesTowards(out, sorted.rotation);
  CHECK(out.log_scale == sorted.log_scale);
}

TEST_CASE("SOG: textures come back, and other readers see the fallback") {
  const Scratch scratch;
  for (const TextureMode mode : {TextureMode::alpha, TextureMode::rgb, TextureMode::rgba}) {
    test::TestScene scene = test::makeScene(test::SceneKind::ordinary, 17, 120);
    GaussianModel& model = scene.model;
    setShDegree(model, 0);  // random SH have no palette
    model.texture_mode = mode;
    model.outside = TextureOutside::edge;
    model.intersection = IntersectionModel::plane;
    neutralize(model.atlas.texels, mode);
    const auto path = scratch.folder() / "a.sog";
    const GaussianModel sorted = select(model, writeSog(path, model, {.texture_step = 1.0f / 256}));
    const GaussianModel out = readSog(path).model;
    CAPTURE(name(mode));
    CHECK(out.texture_mode == mode);
    CHECK(out.outside == TextureOutside::edge);
    CHECK(out.intersection == IntersectionModel::plane);
    REQUIRE(out.atlas.rects.size() == sorted.size());
    for (std::size_t i = 0; i < out.size(); ++i) {
      REQUIRE(out.atlas.rects[i].width == sorted.atlas.rects[i].width);
      REQUIRE(out.atlas.rects[i].height == sorted.atlas.rects[i].height);
    }
    const std::vector<Camera> views = {scene.camera};
    CHECK(renderedPsnr(sorted, out, views, glm::vec3(0.0f)) > 40);
    GaussianModel base = readSog(path, true).model;
    base.intersection = model.intersection;  // which SOG has no word for
    CHECK(base.texture_mode == TextureMode::none);
    CHECK(renderedPsnr(bakeFallback(sorted, FallbackScale::kept), base, views, glm::vec3(0.0f)) > 40);
    // Coarser steps, fewer bytes.
    const std::uintmax_t fine = std::filesystem::file_size(path);
    writeSog(path, model, {.texture_step = 1.0f / 8});
    CHECK(std::filesystem::file_size(path) < fine);
  }
}

TEST_CASE("SOG: texels that no steps reach are counted") {
  const Scratch scratch;
  GaussianModel model = test::makeScene(test::SceneKind::ordinary, 17, 120).model;
  SogReport report;
  writeSog(scratch.folder() / "a.sog", model, {}, &report);
  CHECK(report.clipped_texels == 0);
  for (glm::vec4& texel : model.atlas.texels) texel.x = 1e6f;
  writeSog(scratch.folder() / "a.sog", model, {}, &report);
  CHECK(report.clipped_texels == model.atlas.texels.size());
  model.texture_mode = TextureMode::rgba;
  model.atlas = makeUniformAtlas(model.size(), 2, 2);  // one texture, which all share
  for (glm::vec4& texel : model.atlas.texels) texel.x = 1e6f;
  writeSog(scratch.folder() / "a.sog", model, {}, &report);
  CHECK(report.clipped_texels == model.atlas.texels.size());
}

TEST_CASE("SOG: the base of shared textures has their alpha in its scales, which readers of textures take off again") {
  const Scratch scratch;
  test::TestScene scene = test::makeScene(test::SceneKind::ordinary, 19, 60);
  GaussianModel& model = scene.model;
  constexpr int kSide = 8;
  model.texture_mode = TextureMode::rgba;
  model.atlas = makeUniformAtlas(model.size(), kSide, kSide);
  for (std::size_t t = 0; t < model.atlas.texels.size(); ++t) {
    const int u = static_cast<int>(t % kSide), v = static_cast<int>(t / kSide % kSide);
    model.atlas.texels[t] = {0, 0, 0, u >= 2 && u < 6 && v >= 2 && v < 6 ? 1 : 0};
  }
  const auto path = scratch.folder() / "a.sog";
  const GaussianModel sorted = select(model, writeSog(path, model));
  GaussianModel out = readSog(path).model, base = readSog(path, true).model;
  base.intersection = model.intersection;
  for (std::size_t i = 0; i < out.size(); ++i) {
    REQUIRE(shortestAxis(sorted.log_scale[i]) == shortestAxis(out.log_scale[i]));
    CHECK(glm::length(out.log_scale[i] - sorted.log_scale[i]) < 0.1f);
    CHECK(glm::length(base.log_scale[i] - out.log_scale[i] + glm::vec3(0.0625f)) < 1e-5f);
  }
  const std::vector<Camera> views = {scene.camera};
  CHECK(renderedPsnr(sorted, out, views, glm::vec3(0.0f)) > 40);
  CHECK(renderedPsnr(sorted, base, views, glm::vec3(0.0f)) >
        renderedPsnr(sorted, bakeFallback(sorted, FallbackScale::kept), views, glm::vec3(0.0f)) + 1);
}

TEST_CASE("SOG: a check finds what is wrong with the textures alone") {
  const Scratch scratch;
  const auto path = scratch.folder() / "a.sog";
  const GaussianModel model = test::makeScene(test::SceneKind::ordinary, 18, 30).model;
  const auto errorsOf = [&](const std::function<void(ZipEntry&)>& change) {
    std::vector<ZipEntry> entries = sogFiles(model, "a.sog");
    for (ZipEntry& entry : entries) change(entry);
    writeZip(path, entries, path);
    return checkFile(path).errors.size();
  };
  CHECK(errorsOf([](ZipEntry&) {}) == 0);
  CHECK(errorsOf([](ZipEntry& entry) {
          if (entry.name == "texture_texels.webp") entry.name = "elsewhere.webp";
        }) == 1);
  CHECK(errorsOf([](ZipEntry& entry) {
          if (entry.name == "texture_texels.webp") entry.bytes.assign(100, 7);
        }) == 1);
  CHECK(errorsOf([](ZipEntry& entry) {
          if (entry.name != "meta.json") return;
          nlohmann::json meta = nlohmann::json::parse(entry.bytes.begin(), entry.bytes.end());
          meta["TG_gaussian_splatting_texture"]["mode"] = "rgbx";
          const std::string text = meta.dump();
          entry.bytes.assign(text.begin(), text.end());
        }) == 1);
}

TEST_CASE("SOG: wider steps make smaller files, finer ones nearer models") {
  const Scratch scratch;
  const test::TestScene scene = test::makeScene(test::SceneKind::ordinary, 23, 400);
  const std::vector<Camera> views = {scene.camera};
  const auto path = scratch.folder() / "a.sog";
  double last_psnr = 1e9;
  std::uintmax_t last_bytes = std::numeric_limits<std::uintmax_t>::max();
  for (const float steps : {kLeastSteps, 1.0f, 8.0f, kMostSteps}) {
    const GaussianModel sorted = select(scene.model, writeSog(path, scene.model, {.steps = steps}));
    const GaussianModel out = readSog(path).model;
    CAPTURE(steps);
    const double psnr = renderedPsnr(sorted, out, views, glm::vec3(0.0f));
    CHECK(psnr < last_psnr);
    last_psnr = psnr;
    CHECK(std::filesystem::file_size(path) < last_bytes);
    last_bytes = std::filesystem::file_size(path);
    for (std::size_t i = 0; i < out.atlas.rects.size(); ++i) {
      if (out.atlas.rects[i].texelCount() == 0) continue;
      REQUIRE(shortestAxis(sorted.log_scale[i]) == shortestAxis(out.log_scale[i]));
    }
  }
}

TEST_CASE("SOG: steps too fine for a byte widen until nearly all texels fit") {
  const Scratch scratch;
  GaussianModel model = test::makeScene(test::SceneKind::ordinary, 24, 100).model;
  setShDegree(model, 0);
  for (float& logit : model.opacity_logit) logit = 20;  // texels that may not be coarser than the step
  model.texture_mode = TextureMode::rgba;
  const auto path = scratch.folder() / "a.sog";
  const auto errorOf = [&](float step) {  // mean, of colours and of alpha
    const GaussianModel sorted = select(model, writeSog(path, model, {.texture_step = step}));
    const GaussianModel out = readSog(path).model;
    glm::dvec4 sum(0.0);
    std::size_t count = 0;
    for (std::size_t i = 0; i < out.size(); ++i) {
      const TextureRect from = sorted.atlas.rects[i], to = out.atlas.rects[i];
      for (std::uint32_t t = 0; t < from.texelCount(); ++t, ++count) {
        sum += glm::abs(glm::dvec4(sorted.atlas.texels[from.offset + t] - out.atlas.texels[to.offset + t]));
      }
    }
    REQUIRE(count > 0);
    return std::pair((sum.x + sum.y + sum.z) / 3 / static_cast<double>(count), sum.a / static_cast<double>(count));
  };
  const auto [color, alpha] = errorOf(1.0f / 64);
  const auto [finest_color, finest_alpha] = errorOf(1.0f / 65536);
  CHECK(finest_color < color);
  CHECK(finest_alpha < alpha);
}

TEST_CASE("SOG: stored images may be longer than what an entry may inflate to") {
  const Scratch scratch;
  const auto path = scratch.folder() / "a.sog";
  BytePixels noise(1024, 768);
  std::uint32_t state = 1;
  for (std::uint8_t& byte : noise.data)
    byte = static_cast<std::uint8_t>((state = state * 1664525u + 1013904223u) >> 24);
  const std::vector<std::uint8_t> image = encodeWebp(noise);
  REQUIRE(image.size() > 5 << 19);
  writeZip(path, std::vector<ZipEntry>{{"first.webp", image}, {"last.webp", image}}, path);
  const std::vector<std::uint8_t> bytes = readFile(path, 1 << 23);
  const ZipReader zip(bytes, "a.sog");
  CHECK(zip.read("first.webp", image.size()) == image);
  CHECK(zip.read("last.webp", image.size()) == image);
  CHECK(test::messageOf([&] {
          (void)zip.read("last.webp", image.size() - 1);
        }).starts_with("a.sog: entry \"last.webp\" is too long"));
}

TEST_CASE("SOG: codebooks have all 256 values, which some readers take for granted") {
  const Scratch scratch;
  const auto path = scratch.folder() / "a.sog";
  writeSog(path, randomSplats(1, 20, 20.0, 1 + 90));
  const std::vector<std::uint8_t> bytes = readFile(path, 1 << 20);
  const std::vector<std::uint8_t> text = ZipReader(bytes, "a.sog").read("meta.json", 1 << 20);
  const nlohmann::json meta = nlohmann::json::parse(text.begin(), text.end());
  for (const char* key : {"scales", "sh0", "shN"}) CHECK(meta[key]["codebook"].size() == 256);
}

TEST_CASE("SOG: colours as far out as 1e16 are written") {
  const Scratch scratch;
  const auto path = scratch.folder() / "a.sog";
  GaussianModel model = randomSplats(0, 1, 1.0, 92);
  model.sh[0] = glm::vec3(1e16f);
  writeSog(path, model);
  CHECK(readSog(path).model.sh[0] == model.sh[0]);
}

TEST_CASE("SOG: the same model gives the same bytes") {
  const Scratch scratch;
  const test::TestScene scene = test::makeScene(test::SceneKind::ordinary, 19, 300);
  writeSog(scratch.folder() / "a.sog", scene.model);
  writeSog(scratch.folder() / "b.sog", scene.model);
  CHECK(readFile(scratch.folder() / "a.sog", 1 << 24) == readFile(scratch.folder() / "b.sog", 1 << 24));
}

TEST_CASE("SOG: bytes reach every texel of a texture that most Gaussians share") {
  constexpr std::size_t kMost = 4000, kOthers = 1000;  // and these in twos
  GaussianModel model = test::makeScene(test::SceneKind::ordinary, 5, kMost + 2 * kOthers, 32, 32).model;
  model.texture_mode = TextureMode::rgba;
  model.atlas = makeUniformAtlas(model.size(), 2, 2);
  const auto texels = [&](GaussianModel& of, std::size_t i) {
    return std::span(of.atlas.texels).subspan(of.atlas.rects[i].offset, of.atlas.rects[i].texelCount());
  };
  for (std::size_t i = 0; i < model.size(); ++i) {
    const auto k = static_cast<float>(i < kMost ? 0 : 1 + (i - kMost) / 2) / kOthers;
    std::ranges::fill(texels(model, i), glm::vec4(0.8f - 0.2f * k, -0.9f, 0.1f * k, 0.2f + 0.5f * k));
  }
  const Scratch scratch;
  const auto path = scratch.folder() / "most.sog";
  GaussianModel sorted = select(model, writeSog(path, model));
  GaussianModel out = readSog(path).model;
  float most = 0;  // off by
  for (std::size_t i = 0; i < out.size(); ++i) {
    for (std::size_t t = 0; t < 4; ++t) {
      const glm::vec4 off = glm::abs(texels(out, i)[t] - texels(sorted, i)[t]);
      most = std::max({most, off.r, off.g, off.b, off.a});
    }
  }
  CHECK(most < 0.05f);
}

TEST_CASE("SOG: what Gaussians share is stored once, and comes back to all") {
  constexpr std::size_t kDifferent = 5;
  const Scratch scratch;
  const auto path = scratch.folder() / "shared.sog";
  test::TestScene scene = sharedScene(kDifferent);
  GaussianModel& model = scene.model;
  std::size_t texels = 0;
  for (std::size_t i = 0; i < kDifferent; ++i) texels += model.atlas.rects[i].texelCount();
  const GaussianModel sorted = select(model, writeSog(path, model));
  const std::vector<std::uint8_t> bytes = readFile(path, 1 << 24);
  const ZipReader zip(bytes, "shared.sog");
  const auto meta = nlohmann::json::parse(zip.read("meta.json", 1 << 20))["TG_gaussian_splatting_texture"];
  CHECK(meta["version"] == 2);
  CHECK(meta["textures"] == 5);
  CHECK(decodeWebp(zip.read("texture_texels.webp", 1 << 24), "texels").size() < texels + 300);
  const GaussianModel out = readSog(path).model;
  CHECK(textureGroups(out.atlas) == textureGroups(sorted.atlas));
  CHECK(renderedPsnr(sorted, out, std::vector<Camera>{scene.camera}, glm::vec3(0.0f)) > 40);
  CHECK(readSog(path, true).model.texture_mode == TextureMode::none);
  const std::uintmax_t once = std::filesystem::file_size(path);
  for (std::size_t i = 0; i < model.size(); ++i) {
    model.atlas.texels[model.atlas.rects[i].offset].x += 1e-3f * static_cast<float>(i);
  }
  writeSog(path, model);
  CHECK(once < std::filesystem::file_size(path));

  SECTION("labels and counts that are none are refused") {
    const auto refused = [&](const auto& change) {
      std::vector<ZipEntry> entries = sogFiles(sorted, "s.sog");
      for (ZipEntry& entry : entries) change(entry);
      writeZip(scratch.folder() / "wrong.sog", entries, "wrong.sog");
      return test::messageOf([&] { readSog(scratch.folder() / "wrong.sog"); }, ErrorKind::badData);
    };
    const auto changed = [&](const std::string& key, const nlohmann::json& value) {
      return [=](ZipEntry& entry) {
        if (entry.name != "meta.json") return;
        auto all = nlohmann::json::parse(entry.bytes);
        all["TG_gaussian_splatting_texture"][key] = value;
        const std::string text = all.dump();
        entry.bytes.assign(text.begin(), text.end());
      };
    };
    CHECK_THAT(refused(changed("textures", 0)), Contains("textures"));
    CHECK_THAT(refused(changed("textures", 65537)), Contains("textures"));
    CHECK_THAT(refused(changed("textures", 3)), Contains("has a texture that there is not (expected an index below 3"));
    // 255 x 255 texels for each of many Gaussians, from one small image: refused before there is memory for them.
    const GaussianModel many = select(sorted, std::vector<std::uint32_t>(5000, 0));
    std::vector<ZipEntry> entries = sogFiles(many, "s.sog");
    for (ZipEntry& entry : entries) {
      if (entry.name == "texture_sizes.webp") {
        BytePixels sizes(4, 4);
        std::ranges::fill(sizes.data, std::uint8_t{255});
        entry.bytes = encodeWebp(sizes);
      }
      if (entry.name == "texture_texels.webp") entry.bytes = encodeWebp(BytePixels(256, 256));
    }
    writeZip(scratch.folder() / "large.sog", entries, "large.sog");
    CHECK_THAT(test::messageOf([&] { readSog(scratch.folder() / "large.sog"); }, ErrorKind::badData),
               Contains("too many texels (expected at most 268435456, found 268"));
    CHECK_THAT(refused(changed("files", {"texture_sizes.webp", "texture_texels.webp"})), Contains("files"));
    CHECK_THAT(refused([](ZipEntry& entry) {
                 if (entry.name == "texture_labels.webp") entry.bytes = encodeWebp(BytePixels(4, 4));
               }),
               Contains("texture_labels.webp: too few pixels"));
  }
}

namespace {

// Textures that differ little from the neutral one, more or less so.
test::TestScene faintScene() {
  test::TestScene scene = test::makeScene(test::SceneKind::ordinary, 31, 400);
  setShDegree(scene.model, 0);
  for (std::size_t i = 0; i < scene.model.size(); ++i) {
    const TextureRect rect = scene.model.atlas.rects[i];
    const float part = 0.3f * static_cast<float>(i % 4);
    for (glm::vec4& texel : std::span(scene.model.atlas.texels).subspan(rect.offset, rect.texelCount())) {
      texel = part * texel + (1 - part) * glm::vec4(0.1f, -0.05f, 0.1f, 0.8f);
    }
  }
  return scene;
}

}  // namespace

TEST_CASE("SOG: steps that leave nothing of a texture leave its mean") {
  const Scratch scratch;
  const auto path = scratch.folder() / "a.sog";
  for (const TextureMode mode : {TextureMode::alpha, TextureMode::rgb, TextureMode::rgba}) {
    test::TestScene scene = faintScene();
    scene.model.texture_mode = mode;
    neutralize(scene.model.atlas.texels, mode);
    CAPTURE(name(mode));
    const std::vector<Camera> views = {scene.camera};
    SogReport report;
    // All textures go: the file is that of the model without them.
    for (glm::vec4& texel : scene.model.atlas.texels) texel = glm::mix(glm::vec4(0, 0, 0, 1), texel, 0.1f);
    const GaussianModel base = bakeFallback(scene.model, FallbackScale::fitted);
    writeSog(path, scene.model, {.steps = 16}, &report);
    const std::vector<std::uint8_t> bytes = readFile(path, 1 << 24);
    CHECK(report.texels == 0);
    CHECK(readSog(path).model.texture_mode == TextureMode::none);
    writeSog(path, base, {.steps = 16});
    CHECK(readFile(path, 1 << 24) == bytes);
    // Some do.
    scene = faintScene();
    scene.model.texture_mode = mode;
    neutralize(scene.model.atlas.texels, mode);
    const GaussianModel sorted = select(scene.model, writeSog(path, scene.model, {.texture_step = 0.25f}, &report));
    CHECK(report.texels > 0);
    CHECK(report.texels < scene.model.atlas.texels.size());
    const GaussianModel out = readSog(path).model;
    // Its mean stays with every Gaussian, also where texels are left of it.
    const GaussianModel had = bakeFallback(sorted, FallbackScale::kept), has = bakeFallback(out, FallbackScale::kept);
    double most = 0;
    for (std::size_t i = 0; i < out.size(); ++i) most = std::max(most, largest(had.sh[i] - has.sh[i]));
    CHECK(most < 0.016);  // half of a step of DC
  }
}

TEST_CASE("SOG: rotations that are nearly none stay so in steps of any width") {
  const Scratch scratch;
  GaussianModel model = withoutTextures(test::makeScene(test::SceneKind::ordinary, 31, 400).model);
  model.rotation.assign(model.size(), glm::vec4(1, 0, 0, 0));
  for (const float steps : {1.0f, 2.0f, 7.0f, 11.0f, 17.0f, 40.0f}) {
    writeSog(scratch.folder() / "a.sog", model, {.steps = steps});
    float largest = 0;
    for (const glm::vec4& q : readSog(scratch.folder() / "a.sog").model.rotation) {
      largest = std::max({largest, std::abs(q.y), std::abs(q.z), std::abs(q.w)});
    }
    CAPTURE(steps);
    CHECK(largest < 0.003f);  // half a byte
  }
}

TEST_CASE("SOG: a file that is read and written with the same steps once more stays as it is") {
  const Scratch scratch;
  const auto first = scratch.folder() / "a.sog", second = scratch.folder() / "b.sog";
  const bool shared = GENERATE(false, true);
  const test::TestScene scene = shared ? sharedScene(20) : faintScene();
  for (const float steps : {4.0f, 8.0f, 16.0f}) {
    writeSog(first, scene.model, {.steps = steps});
    const GaussianModel model = readSog(first).model;
    const GaussianModel sorted = select(model, writeSog(second, model, {.steps = steps}));
    CAPTURE(shared, steps);
    const auto bytes = [](const auto& path) { return static_cast<double>(std::filesystem::file_size(path)); };
    CHECK(bytes(second) == Approx(bytes(first)).epsilon(0.01));
    // Which component of a rotation is the largest may have changed, with textures or without.
    GaussianModel again = readSog(second).model;
    again.rotation = sorted.rotation;
    again.log_scale = sorted.log_scale;
    CHECK(renderedPsnr(sorted, again, std::vector<Camera>{scene.camera}, glm::vec3(0.0f)) > 60);
  }
}

TEST_CASE("SOG: textures of a version to come are left out with a warning") {
  const Scratch scratch;
  SogParts parts;
  parts.meta["TG_gaussian_splatting_texture"] = {{"version", 3}};
  const Bundle loaded = parseSog(parts.bytes(scratch), "a.sog");
  CHECK(loaded.model.texture_mode == TextureMode::none);
  REQUIRE(loaded.warnings.size() == 1);
  CHECK(loaded.warnings[0] == "textures of another version than 1 and 2 are left out");
}
