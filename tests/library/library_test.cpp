// SPDX-License-Identifier: Apache-2.0
// The public headers: what they promise to programs that know nothing else of the project.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <limits>
#include <sstream>
#include <string>
#include <system_error>
#include <thread>
#include <tuple>
#include <utility>

#include "core/bundle/bundle.h"
#include "library/access.h"
#include "support/address_space.h"
#include "support/catch.h"
#include "support/temporary_folder.h"
#include "textured_gaussians/textured_gaussians.h"
#include "training/data/sample.h"

using namespace textured_gaussians;
using tg::TemporaryFolder;

namespace {

const char* const kSample = "docs/sample.tgz";
constexpr tg::SampleOptions kScene = {.size = 32, .train_views = 6, .test_views = 2, .points = 300, .supersampling = 1};

// The message of the Error that `step` throws; "accepted" when it throws none.
template <typename Step>
std::string messageOf(const Step& step, ErrorKind kind) {
  try {
    step();
  } catch (const Error& error) {
    return error.kind() == kind ? error.what() : std::string("another kind: ") + error.what();
  }
  return "accepted";
}

std::string bytesOf(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::stringstream bytes;
  bytes << file.rdbuf();
  return bytes.str();
}

// Runs a program of the build; what it prints.
std::string program(const std::string& name, const std::string& arguments, const TemporaryFolder& folder) {
  const std::string log = (folder / "log").string();
  const std::string command = std::string(TG_PROGRAMS) + "/" + name + " " + arguments + " >'" + log + "' 2>&1";
  const int status = std::system(command.c_str());
  const std::string said = bytesOf(log);
  INFO(command << ": " << said);
  REQUIRE(status == 0);
  return said;
}
std::string example(const std::string& name, const std::string& arguments, const TemporaryFolder& folder) {
  return program("example_" + name, arguments, folder);
}

// A working folder for as long as it lives.
struct WorkingFolder {
  explicit WorkingFolder(const std::filesystem::path& folder) { std::filesystem::current_path(folder); }
  ~WorkingFolder() { std::filesystem::current_path(before); }
  WorkingFolder& operator=(WorkingFolder&&) = delete;
  const std::filesystem::path before = std::filesystem::current_path();
};

}  // namespace

TEST_CASE("the version is the project's") { CHECK(std::string(version()) == TG_VERSION); }

TEST_CASE("a model of the numbers of another one is saved as the same file") {
  const TemporaryFolder folder;
  const Model model = Model::load(kSample);
  REQUIRE(model.size() == 5000);
  CHECK(model.means().size() == 5000 * 3);
  CHECK(model.rotations().size() == 5000 * 4);
  CHECK(model.sh().size() == 5000 * 3 * static_cast<std::size_t>((model.shDegree() + 1) * (model.shDegree() + 1)));
  CHECK(model.textureMode() == TextureMode::rgba);
  const ModelData data = model.data();
  CHECK(data.texture_rects.size() == 5000);
  CHECK(data.cameras.size() == model.cameras().size());
  const Model again(data);
  again.save(folder / "a.tgz");
  const Model read = Model::load(folder / "a.tgz");
  read.save(folder / "b.tgz");
  CHECK(bytesOf(folder / "a.tgz") == bytesOf(folder / "b.tgz"));
  CHECK(std::ranges::equal(read.sh(), model.sh()));
  CHECK(std::ranges::equal(read.texels(), model.texels()));
  CHECK(read.cameras().front().rotation == model.cameras().front().rotation);
}

TEST_CASE("what a model or a data set was moved from is still that") {
  const TemporaryFolder folder;
  Model model = Model::load(kSample);
  const Model other = std::move(model);
  CHECK(model.size() == other.size());  // NOLINT(bugprone-use-after-move)
  model = Model(ModelData());
  Model third = std::move(model);
  CHECK(model.means().empty());  // NOLINT(bugprone-use-after-move)
  tg::writeSample(folder / "scene", kScene, false);
  Dataset dataset = Dataset::load(folder / "scene");
  const Dataset moved = std::move(dataset);
  CHECK(dataset.size() == moved.size());  // NOLINT(bugprone-use-after-move)
}

TEST_CASE("numbers that make no model are refused by name") {
  const ModelData good = Model::load(kSample).data();
  const auto refused = [&](const auto& spoil) {
    ModelData data = good;
    spoil(data);
    return messageOf([&] { Model{data}; }, ErrorKind::badData);
  };
  CHECK(refused([](ModelData& data) { data.means.pop_back(); }) ==
        "model: means: no whole number of values (expected a multiple of 3 floats, found 14999)");
  CHECK(refused([](ModelData& data) { data.opacity_logits.pop_back(); }) ==
        "model: opacity_logits: wrong length (expected 5000, found 4999)");
  CHECK_THAT(refused([](ModelData& data) { data.texture_rects.pop_back(); }), Contains("texture_rects: wrong length"));
  CHECK_THAT(refused([](ModelData& data) { data.sh_degree = 4; }), Contains("expected 0 to 3, found 4"));
  CHECK_THAT(refused([](ModelData& data) { data.sh_degree = 0; }), Contains("sh"));
  CHECK_THAT(refused([](ModelData& data) { data.means[7] = std::numeric_limits<float>::quiet_NaN(); }),
             Contains("mean"));
  CHECK_THAT(refused([](ModelData& data) { std::fill_n(data.rotations.begin() + 8, 4, 0.0f); }), Contains("rotation"));
  for (const float length : {1e25f, 1e-40f}) {
    CHECK(refused([=](ModelData& data) { std::fill_n(data.rotations.begin() + 8, 4, length); }) ==
          "model: Gaussian 2: rotation has no usable length (expected a quaternion of a length from 1e-22 to 1e19)");
  }
  CHECK_THAT(refused([](ModelData& data) { data.texture_rects[3].offset = 0xffffffff; }), Contains("Gaussian 3"));
  CHECK_THAT(refused([](ModelData& data) { data.background[1] = INFINITY; }), Contains("background"));
  CHECK(refused([](ModelData&) {}) == "accepted");
}

TEST_CASE("textures of which a part is missing are refused and not lost without a word") {
  const ModelData good = Model::load(kSample).data();
  const auto refused = [&](TextureMode mode, bool rects, bool texels) {
    ModelData data = good;
    data.texture_mode = mode;
    if (!rects) data.texture_rects.clear();
    if (!texels) data.texels.clear();
    return messageOf([&] { Model{data}; }, ErrorKind::badData);
  };
  CHECK(refused(TextureMode::none, true, true) ==
        "model: texture_mode: none beside texels (expected alpha, rgb or rgba)");
  CHECK(refused(TextureMode::none, true, false) ==
        "model: texture_mode: none beside texture_rects (expected alpha, rgb or rgba)");
  CHECK(refused(TextureMode::rgba, false, true) == "model: texels: without texture_rects (expected one a Gaussian)");
  CHECK(refused(TextureMode::rgba, true, false) ==
        "model: texture_rects: without texels (expected those that they name)");
  CHECK(refused(TextureMode::none, false, false) == "accepted");
  ModelData data = good;
  data.texels.clear();
  std::ranges::fill(data.texture_rects, TextureRect());
  CHECK(Model(data).textureRects().size() == 5000);  // as of a model whose last textures were cut away
  data = ModelData();
  data.texture_mode = TextureMode::rgb;
  data.texels = good.texels;
  CHECK(Model(data).size() == 0);
}

TEST_CASE("enumerators that there are none of are refused") {
  const TemporaryFolder folder;
  const auto refused = [&](const auto& step) { return messageOf(step, ErrorKind::usage); };
  const Model model = Model::load(kSample);
  ModelData data = model.data();
  data.texture_mode = static_cast<TextureMode>(7);
  CHECK(refused([&] { Model{data}; }) == "texture mode: no such one (expected 0 to 3, found 7)");
  data = model.data();
  data.intersection = static_cast<Intersection>(-1);
  CHECK(refused([&] { Model{data}; }) == "intersection: no such one (expected 0 to 1, found -1)");
  data = model.data();
  data.outside = static_cast<TextureOutside>(3);
  CHECK_THAT(refused([&] { Model{data}; }), Contains("outside"));
  const Camera camera = lookAt({0, 0, -6}, {0, 0, 0}, {0, -1, 0}, 0.8, 4, 3);
  Renderer renderer(model);
  CHECK_THAT(refused([&] { renderer.render(camera, static_cast<Output>(8)); }), Contains("expected 0 to 7, found 8"));
  CHECK_THAT(refused([&] { renderer.render(camera, Output::final, {.textures = static_cast<TextureMode>(4)}); }),
             Contains("texture mode"));
  tg::writeSample(folder / "scene", kScene, false);
  const Dataset dataset = Dataset::load(folder / "scene");
  CHECK_THAT(refused([&] { evaluate(model, dataset, {.split = static_cast<Split>(3)}); }), Contains("split"));
}

TEST_CASE("one renderer draws for several threads, one after the other") {
  Renderer renderer(Model::load(kSample));
  std::vector<Camera> cameras;
  for (const int width : {40, 90, 64, 120}) {
    cameras.push_back(lookAt({0, 0, -6}, {0, 0, 0}, {0, -1, 0}, 0.8, width, 30));
  }
  std::vector<Image> alone, together(cameras.size());
  for (const Camera& camera : cameras) alone.push_back(renderer.render(camera));
  std::vector<std::thread> threads;
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    threads.emplace_back([&, i] {
      for (int n = 0; n < 8; ++n) together[i] = renderer.render(cameras[i]);
    });
  }
  for (std::thread& thread : threads) thread.join();
  for (std::size_t i = 0; i < cameras.size(); ++i) CHECK(together[i].data == alone[i].data);
}

TEST_CASE("a file that is not there, none or of no known format is refused with its kind") {
  const TemporaryFolder folder;
  CHECK_THAT(messageOf([&] { Model::load(folder / "none.tgz"); }, ErrorKind::cannotRead), Contains("none.tgz"));
  std::ofstream(folder / "bad.ply") << "ply, but not quite";
  CHECK_THAT(messageOf([&] { Model::load(folder / "bad.ply"); }, ErrorKind::badData), Contains("bad.ply"));
  const Model model = Model::load(kSample);
  CHECK_THAT(messageOf([&] { model.save(folder / "model.xyz"); }, ErrorKind::usage), Contains("model.xyz"));
  CHECK_THAT(messageOf([&] { model.save(folder / "none/model.tgz"); }, ErrorKind::cannotWrite), Contains("none"));
  CHECK_THAT(messageOf([&] { model.save(folder / "model.png"); }, ErrorKind::usage),
             Contains("model.png: is no model format (expected .compressed.ply, "));
  CHECK_FALSE(std::filesystem::exists(folder / "model.png"));
  CHECK_THAT(messageOf([&] { model.save(folder / "model.ksplat"); }, ErrorKind::usage),
             Contains("model.ksplat: is not written (expected .compressed.ply, "));
  std::vector<std::string> left = model.save(folder / "model.sog");
  CHECK(std::ranges::any_of(left, [](const std::string& line) { return line.find("background") != line.npos; }));
  left = model.save(folder / "model.glb");
  CHECK(left.empty());
  CHECK(Model::load(folder / "model.glb").background() == model.background());
  left = model.save(folder / "model.ply");
  CHECK(std::ranges::any_of(left, [](const std::string& line) { return line.find("texture") != line.npos; }));
}

TEST_CASE("a model that makes no file of a format is refused as such") {
  const TemporaryFolder folder;
  const Model none((ModelData()));
  for (const std::string format : {"glb", "gltf", "html", "sog", "compressed.ply"}) {
    CHECK_THAT(messageOf([&] { none.save(folder / ("none." + format)); }, ErrorKind::badData),
               Contains("the model has no Gaussians"));
  }
  ModelData data = Model::load(kSample).data();
  for (std::size_t i = 0; i < data.texels.size(); i += 4) data.texels[i] = 1e6f;
  CHECK_THAT(messageOf([&] { Model(data).save(folder / "a.tgz"); }, ErrorKind::cannotWrite), Contains("half float"));
  CHECK_THAT(Model(data).save(folder / "a.sog").back(), Contains("texels with a channel outside"));
}

TEST_CASE("a path that names no file is refused by every function that takes one") {
  const TemporaryFolder folder;
  const Model model = Model::load(kSample);
  const std::filesystem::path good = folder / "good.png";
  for (const auto& [path, message] : {std::pair<std::filesystem::path, std::string>{folder / std::string("a\0b.tgz", 7),
                                                                                    "path: a name holds a NUL byte"},
                                      {{}, "path: an empty file name"},
                                      {std::string(5000, 'a'), "path: a name of 5000 bytes (expected at most 4095)"}}) {
    const auto refused = [](const auto& step) { return messageOf(step, ErrorKind::usage); };
    CHECK(refused([&] { model.save(path); }) == message);
    CHECK(refused([&] { Model::load(path); }) == message);
    CHECK(refused([&] { readImage(path); }) == message);
    CHECK(refused([&] { writeImage(path, {1, 1, 1, {1}}); }) == message);
    CHECK(refused([&] { convert(path, good); }) == message);
    CHECK(refused([&] { convert(kSample, path); }) == message);
    CHECK(refused([&] { convert(kSample, folder / "b.tgz", {.edits = {{"--merge", path.string()}}}); }) ==
          "merge" + message.substr(message.find(':')));
    CHECK(refused([&] { Dataset::load(path); }) == message);
  }
  CHECK(std::filesystem::is_empty(folder.path));
}

TEST_CASE("a camera that is none is refused") {
  const Camera good = lookAt({0, 0, -4}, {0, 0, 0}, {0, -1, 0}, 0.8, 40, 30);
  Renderer renderer(Model::load(kSample));
  const auto refused = [&](const auto& spoil) {
    Camera camera = good;
    camera.name = "a.png";
    spoil(camera);
    return messageOf([&] { renderer.render(camera); }, ErrorKind::usage);
  };
  CHECK_THAT(refused([](Camera& camera) { camera.width = 0; }), Contains("found 0 x 30"));
  CHECK_THAT(refused([](Camera& camera) { camera.width = camera.height = 60000; }), Contains("60000 x 60000"));
  CHECK(refused([](Camera& camera) { camera.focal[1] = 0; }) == "camera a.png: expected focal lengths above 0");
  CHECK_THAT(refused([](Camera& camera) { camera.center[0] = NAN; }), Contains("not finite"));
  CHECK_THAT(refused([](Camera& camera) { camera.rotation[0] *= 1.1; }), Contains("orthonormal"));
  CHECK_THAT(refused([](Camera& camera) {
               for (int i = 0; i < 3; ++i) camera.rotation[static_cast<std::size_t>(i)] *= -1;
             }),
             Contains("reflection"));
  CHECK(refused([](Camera&) {}) == "accepted");
  CHECK_THAT(messageOf([] { lookAt({1, 2, 3}, {1, 2, 3}, {0, 1, 0}, 0.8, 8, 8); }, ErrorKind::usage),
             Contains("target"));
  CHECK_THAT(messageOf([] { lookAt({1, 2, 3}, {0, 0, 0}, {0, 1, 0}, 4, 8, 8); }, ErrorKind::usage),
             Contains("field of view"));
}

TEST_CASE("a camera looks along any direction of finite numbers") {
  const auto rotation = [](double distance, double up) {
    return lookAt({0, 0, 0}, {0, 0.5 * distance, distance}, {0, -up, 0}, 0.8, 80, 60).rotation;
  };
  const std::array<double, 9> expected = rotation(1, 1);
  CHECK(std::abs(expected[8] - 1 / std::sqrt(1.25)) < 1e-15);
  for (const double length : {0x1p-1060, 0x1p-700, 0x1p600, 0x1p1023}) {
    CAPTURE(length);
    CHECK(rotation(length, 1) == expected);
    CHECK(rotation(1, length) == expected);
    CHECK(rotation(length, length) == expected);
  }
  const Camera across = lookAt({-0x1p1023, 0, 0}, {0x1p1023, 0, 0}, {0, -1, 0}, 0.8, 80, 60);
  CHECK(across.rotation[6] == 1);
}

TEST_CASE("a point of the world appears where the camera's documentation says") {
  ModelData data;
  data.means = {0.3f, -0.2f, 0.1f};
  data.rotations = {1, 0, 0, 0};
  data.log_scales = {-2, -2, -2};
  data.opacity_logits = {8};
  data.sh = {1, 1, 1};
  const Camera camera = lookAt({1, 2, -4}, {0, 0, 0}, {0.1, -1, 0}, 0.8, 80, 60);
  const Image alpha = Renderer(Model(data)).render(camera, Output::alpha);
  std::array<double, 3> seen = camera.translation;
  for (std::size_t row = 0; row < 3; ++row) {
    for (std::size_t i = 0; i < 3; ++i) seen[row] += camera.rotation[3 * row + i] * double{data.means[i]};
  }
  const auto brightest = static_cast<int>(std::ranges::max_element(alpha.data) - alpha.data.begin());
  CHECK(brightest % 80 == static_cast<int>(seen[0] / seen[2] * camera.focal[0] + camera.center[0]));
  CHECK(brightest / 80 == static_cast<int>(seen[1] / seen[2] * camera.focal[1] + camera.center[1]));
}

TEST_CASE(
    "a picture has its camera's shape, is base and texture, and stands before the background that was asked for") {
  const Model model = Model::load(kSample);
  const Camera camera = lookAt({0, 0, -6}, {0, 0, 0}, {0, -1, 0}, 0.8, 40, 30);
  Renderer renderer(model);
  const Image picture = renderer.render(camera);
  REQUIRE(picture.width == 40);
  REQUIRE(picture.height == 30);
  REQUIRE(picture.channels == 3);
  REQUIRE(picture.data.size() == 40 * 30 * 3);
  const Image base = renderer.render(camera, Output::base), texture = renderer.render(camera, Output::texture);
  double added = 0;
  for (std::size_t i = 0; i < picture.data.size(); ++i) {
    REQUIRE(picture.data[i] == Approx(base.data[i] + texture.data[i]).margin(1e-5));  // floats, summed in another order
    added += std::abs(texture.data[i]);
  }
  CHECK(added > 1);
  const Image plain = renderer.render(camera, Output::final, {.textures = TextureMode::none});
  const Image none = renderer.render(camera, Output::texture, {.textures = TextureMode::none});
  CHECK_FALSE(std::ranges::equal(plain.data, picture.data));
  CHECK(std::ranges::count(none.data, 0.0f) == 40 * 30 * 3);
  const Image alpha = renderer.render(camera, Output::alpha);
  CHECK(alpha.channels == 1);
  const Image red = renderer.render(camera, Output::final, {.background = std::array<float, 3>{1, 0, 0}});
  const auto empty = std::ranges::find(alpha.data, 0.0f);
  REQUIRE(empty != alpha.data.end());
  CHECK(red.data[3 * static_cast<std::size_t>(empty - alpha.data.begin())] == 1);
  CHECK_THAT(messageOf([&] { renderer.render(camera, Output::final, {.splat_scale = -1}); }, ErrorKind::usage),
             Contains("(expected above 0, found -1)"));
  CHECK(messageOf([&] { renderer.render(camera, Output::final, {.max_sh_degree = 4}); }, ErrorKind::usage) ==
        "SH degree: out of range (expected 0 to 3, found 4)");
  for (const float channel : {INFINITY, std::nanf("")}) {
    const std::array<float, 3> background = {0, channel, 0};
    CHECK(messageOf([&] { renderer.render(camera, Output::final, {.background = background}); }, ErrorKind::usage) ==
          "background: is not finite");
    CHECK(messageOf([&] { Dataset::load("nowhere", {.background = background}); }, ErrorKind::usage) ==
          "background: is not finite");
  }
}

TEST_CASE("training by steps ends, learns, and gives the same bytes with one thread as with two") {
  const TemporaryFolder folder;
  tg::writeSample(folder / "scene", kScene, false);
  const Dataset dataset = Dataset::load(folder / "scene");
  REQUIRE(dataset.size() == 8);
  CHECK(dataset.photograph(7).data.size() == 32 * 32 * 3);
  CHECK_THAT(messageOf([&] { dataset.photograph(8); }, ErrorKind::usage), Contains("expected 0 to 7, found 8"));
  const TrainOptions options = {
      .settings = {{"iterations", "150"}, {"texture-iterations", "20"}, {"texture-size", "2"}, {"sh-degree", "1"}}};
  std::string files[2];
  double before = 0, after = 0;
  for (const int threads : {1, 2}) {
    setThreads(threads);
    Trainer trainer(dataset, options);
    if (threads == 1) before = evaluate(trainer.model(), dataset, {.split = Split::train}).mean.psnr;
    int steps = 0;
    while (trainer.step()) ++steps;
    CHECK(steps == 170);
    const TrainProgress progress = trainer.progress();
    CHECK(progress.stage == "textured");
    CHECK(progress.iteration == 20);
    CHECK(progress.gaussians == trainer.model().size());
    after = evaluate(trainer.model(), dataset, {.split = Split::train}).mean.psnr;
    trainer.model().save(folder / "model.tgz");
    files[threads - 1] = bytesOf(folder / "model.tgz");
  }
  setThreads(0);
  CHECK(files[0] == files[1]);
  CHECK(after > before + 1);
}

TEST_CASE("settings that there are none of, or that are no values, are refused, and a model can be gone on from") {
  const TemporaryFolder folder;
  tg::writeSample(folder / "scene", kScene, false);
  const Dataset dataset = Dataset::load(folder / "scene");
  const auto refused = [&](const TrainOptions& options) {
    return messageOf([&] { Trainer trainer(dataset, options); }, ErrorKind::usage);
  };
  CHECK(refused({.settings = {{"iteration", "30"}}}) == "iteration: no such setting (did you mean iterations?)");
  CHECK(refused({.settings = {{"speed-of-light", "1"}}}) ==
        "speed-of-light: no such setting (docs/training.md has them)");
  CHECK(refused({.settings = {{"quantize-iterations", "3"}}}) ==
        "--quantize-iterations: is for a file that tgtrain writes (expected 0)");
  // Messages name tgtrain's flags, and those are names, too.
  CHECK_THAT(refused({.settings = {{"iterations", "many"}}}), Contains("--iterations: "));
  CHECK(Trainer(dataset, {.settings = {{"--iterations", "3"}}}).progress().iterations == 3);
  CHECK(refused({.settings = {{"--iterations", "3"}, {"iterations", "4"}}}) == "iterations: is given twice");
  CHECK(refused({.settings = {{"--iteration", "30"}}}) == "iteration: no such setting (did you mean iterations?)");
  CHECK(refused({.settings = {{"--", "30"}}}).find("\"\": no such setting (") == 0);
  CHECK(refused({.settings = {{"start", "model.tgz"}}}) ==
        "start: expected points, random or a model that is loaded, found 'model.tgz'");
  CHECK(refused({.settings = {{"--start-model", "model.tgz"}}}) ==
        "start-model: is no setting: give the model itself, loaded, as start");
  CHECK(refused({.settings = {{"downscale", "2"}}}) ==
        "downscale: is an option of Dataset::load() (Python: Dataset.load())");
  CHECK(refused({.settings = {{"test-every", "2"}}}) == "test-every: is an option of the data set");
  CHECK(refused({.settings = {{"run", "folder"}}}) == "run: is tgtrain's alone");
  CHECK_THAT(refused({.preset = "best"}), Contains("best"));
  // The preset's limit gives way to the share that is named.
  CHECK_NOTHROW(Trainer(dataset, {.preset = "quick", .settings = {{"percent", "50"}, {"default-gaussians", "100"}}}));
  CHECK_THAT(messageOf([&] { setThreads(-1); }, ErrorKind::usage), Contains("found -1"));
  CHECK_THAT(messageOf([&] { Dataset::load(folder / "none"); }, ErrorKind::cannotRead), Contains("none"));
  CHECK(messageOf([&] { Dataset::load(folder / "scene", {.downscale = 65}); }, ErrorKind::usage) ==
        "--downscale: out of range (expected 1 to 64, found 65)");
  CHECK(messageOf([&] { Dataset::load(folder / "scene", {.test_every = 1}); }, ErrorKind::usage) ==
        "--test-every: out of range (expected 0, for none, or at least 2, found 1)");
  TrainOptions options = {.settings = {{"iterations", "2"}, {"texture-mode", "none"}, {"sh-degree", "0"}}};
  Trainer first(dataset, options);
  while (first.step()) {
  }
  ModelData empty = first.model().data();
  empty.means = empty.rotations = empty.log_scales = empty.opacity_logits = empty.sh = {};
  CHECK(messageOf([&] { Trainer(dataset, options, Model(empty)); }, ErrorKind::badData) ==
        "start model: has no Gaussians");
  Trainer compared(
      dataset,
      {.settings = {
           {"iterations", "2"}, {"texture-iterations", "2"}, {"texture-size", "2"}, {"compare-untextured", "on"}}});
  while (compared.step()) {
  }
  CHECK(compared.progress().stage == "untextured");
  CHECK(compared.model().textureMode() == TextureMode::rgba);
  CHECK(compared.warnings().empty());
  Trainer past(dataset,
               {.settings = {{"iterations", "30"},
                             {"densify-every", "5"},
                             {"texture-iterations", "1"},
                             {"init-count", "9"},
                             {"limit-by", "swap"},
                             {"compare-untextured", "off"}}},
               compared.model());
  CHECK(past.warnings() == std::vector<std::string>{"--init-count: does nothing with --start-model",
                                                    "--iterations, --limit-by, --densify-every: does nothing with a "
                                                    "start model that has textures"});
  tg::Bundle bundle = tg::readBundle(kSample);
  bundle.training_json = R"({"settings": {"filter-3d": "on"}})";
  tg::writeBundle(folder / "filtered.tgz", bundle);
  const Model filtered = Model::load(folder / "filtered.tgz");
  CHECK(Trainer(dataset, {.settings = {{"texture-iterations", "1"}}}, filtered).warnings().empty());
  CHECK(Trainer(dataset, {.settings = {{"texture-iterations", "1"}, {"filter-3d", "on"}}}, filtered).warnings() ==
        std::vector<std::string>{"--filter-3d: the start model is as the filter of its own training left it, and is "
                                 "filtered once more"});
  Trainer second(dataset, options, first.model());
  CHECK(second.progress().psnr == 0);
  CHECK(second.model().size() == first.model().size());
  CHECK(std::ranges::equal(second.model().means(), first.model().means()));
}

TEST_CASE("an evaluation has every photograph of the split, and its means are theirs") {
  const TemporaryFolder folder;
  tg::writeSample(folder / "scene", kScene, false);
  const Model model = Model::load(kSample);
  const Dataset dataset = Dataset::load(folder / "scene", {.background = model.background()});
  const Evaluation test = evaluate(model, dataset, {.flip = true});
  REQUIRE(test.views.size() == 2);
  CHECK(test.mean.psnr == Approx((test.views[0].psnr + test.views[1].psnr) / 2));
  CHECK(test.mean.name.empty());
  CHECK(test.mean.psnr > 18);  // the sample was trained on this scene, at 128 px
  CHECK(test.mean.ssim > 0.5);
  REQUIRE(test.mean.flip);
  CHECK(*test.mean.flip < 0.3);
  std::vector<std::size_t> told;
  const auto tell = [&](std::size_t done, std::size_t photographs) {
    CHECK(photographs == 6);
    told.push_back(done);
    if (done == 5) throw 5;
  };
  CHECK_THROWS_AS(evaluate(model, dataset, {.split = Split::train, .progress = tell}), int);
  CHECK(told == std::vector<std::size_t>{1, 2, 3, 4, 5});
  // An exception of a kind that the library turns into its own Error where it is its own.
  const auto fail = [](std::size_t, std::size_t) {
    throw std::system_error(std::make_error_code(std::errc::io_error));
  };
  CHECK_THROWS_AS(evaluate(model, dataset, {.progress = fail}), std::system_error);
  CHECK(evaluate(model, dataset, {.split = Split::train}).views.size() == 6);
  CHECK(evaluate(model, dataset, {.split = Split::all}).views.size() == 8);
  CHECK(evaluate(model, dataset, {.textures = TextureMode::none}).mean.psnr < test.mean.psnr);
}

TEST_CASE("an evaluation goes over the background of the model as that of tgeval does") {
  const TemporaryFolder folder;
  tg::writeSample(folder / "scene", kScene, false);  // white, where nobody says otherwise
  const std::array<float, 3> black = {0, 0, 0}, white = {1, 1, 1};
  const Dataset dataset = Dataset::load(folder / "scene"),
                over_black = Dataset::load(folder / "scene", {.background = black});
  CHECK(dataset.background() == white);
  Trainer trainer(over_black, {.settings = {{"iterations", "20"}, {"texture-mode", "none"}}});
  while (trainer.step()) {
  }
  trainer.model().save(folder / "black.tgz");
  const Model model = Model::load(folder / "black.tgz");
  const Evaluation evaluation = evaluate(model, dataset), chosen = evaluate(model, over_black);
  CHECK(evaluation.background == black);
  CHECK(evaluation.warnings.empty());
  const std::string path = folder.path.string();
  program("tgeval", path + "/black.tgz " + path + "/scene --json " + path + "/scores.json", folder);
  const std::string json = bytesOf(folder / "scores.json"), key = "\n \"psnr\": ";
  REQUIRE(json.find(key) != json.npos);
  CHECK(evaluation.mean.psnr == std::strtod(json.c_str() + json.find(key) + key.size(), nullptr));
  for (std::size_t i = 0; i < evaluation.views.size(); ++i) {
    CHECK(evaluation.views[i].psnr == chosen.views[i].psnr);
    CHECK(evaluation.views[i].ssim == chosen.views[i].ssim);
  }
  const Dataset over_white = Dataset::load(folder / "scene", {.background = white});
  CHECK(evaluate(model, over_white).background == white);
  CHECK(evaluate(model, over_white).mean.psnr != evaluation.mean.psnr);
  model.save(folder / "any.ply");
  CHECK(evaluate(Model::load(folder / "any.ply"), dataset).background == white);
}

TEST_CASE("an evaluation tells of a model of other photographs") {
  const TemporaryFolder folder;
  tg::SampleOptions scene = kScene;
  tg::writeSample(folder / "scene", scene, false);
  scene.train_views = 9;
  scene.test_views = 5;
  tg::writeSample(folder / "other", scene, false);
  const Model model = Trainer(Dataset::load(folder / "scene"), {.settings = {{"iterations", "1"}}}).model();
  CHECK(evaluate(model, Dataset::load(folder / "other")).warnings ==
        std::vector<std::string>{"none of its 8 cameras is among the views of other: was it trained on others?"});
  // Of a file that says in which world it was trained, as tgtrain's do.
  tg::Bundle bundle = *Access::bundle(model);
  bundle.training_json = R"({"dataset": {"normalized": null}})";
  tg::writeBundle(folder / "told.tgz", bundle);
  const Model told = Model::load(folder / "told.tgz");
  const Dataset moved = Dataset::load(folder / "scene", {.normalize = true});
  const std::string other = "was trained without normalize, and the data set is read with it";
  CHECK(evaluate(told, moved).warnings == std::vector{other});
  CHECK(messageOf([&] { Trainer(moved, {}, told); }, ErrorKind::usage) ==
        "start: the model " + other + " (expected both of one world)");
  CHECK_NOTHROW(Trainer(moved, {}, model));
  const Dataset smaller = Dataset::load(folder / "scene", {.downscale = 2});
  CHECK(evaluate(model, smaller).warnings ==
        std::vector<std::string>{"was trained on photographs of 32 x 32, and is scored on 16 x 16 (--downscale)"});
}

TEST_CASE("photographs in memory train and score to the bytes of those of a folder") {
  const TemporaryFolder folder;
  tg::writeSample(folder / "scene", kScene, false);
  Image mask{32, 32, 1, std::vector<float>(32 * 32, 1.0f)};
  std::fill_n(mask.data.begin(), 32 * 9, 0.0f);
  for (const char* name : {"train/r_1.png", "test/r_0.png"}) {
    std::filesystem::create_directories((folder / "scene/masks" / name).parent_path());
    writeImage(folder / "scene/masks" / name, mask);
  }
  const std::array<float, 3> black = {0, 0, 0};
  const Dataset loaded = Dataset::load(folder / "scene", {.background = black});
  DatasetData data;
  data.background = black;
  for (const Camera& camera : loaded.cameras()) {
    const std::string name = std::string(camera.test ? "test" : "train") + "/" + camera.name;
    data.cameras.insert(data.cameras.begin(), camera);  // in another order than loaded
    data.images.insert(data.images.begin(), toBytes(readImage(folder / "scene" / name)));
    const bool masked = std::filesystem::exists(folder / "scene/masks" / name);
    data.masks.insert(data.masks.begin(), masked ? toBytes(mask) : ByteImage());
  }
  REQUIRE(data.images.front().channels == 4);
  const tg::PointCloud& points = Access::dataset(loaded)->points;
  for (const glm::vec3& point : points.position) data.points.insert(data.points.end(), {point.x, point.y, point.z});
  for (const glm::vec3& color : points.color) data.colors.insert(data.colors.end(), {color.x, color.y, color.z});
  const Dataset made(data);
  CHECK(made.size() == 8);
  CHECK(made.warnings().empty());
  std::vector<Model> models;
  for (const Dataset& dataset : {loaded, made}) {
    Trainer trainer(dataset, {.settings = {{"iterations", "12"}, {"texture-iterations", "6"}, {"texture-size", "2"}}});
    while (trainer.step()) {
    }
    models.push_back(trainer.model());
    models.back().save(folder / (std::to_string(models.size()) + ".tgz"));
  }
  CHECK(bytesOf(folder / "1.tgz") == bytesOf(folder / "2.tgz"));
  ModelData grey = models[0].data();
  grey.background = {0.3f, 0.4f, 0.5f};
  data.background.reset();
  for (const auto& [one, other, model] :
       {std::tuple{loaded, made, models[0]}, {Dataset::load(folder / "scene"), Dataset(data), Model(grey)}}) {
    for (const Split split : {Split::train, Split::test}) {
      const Evaluation a = evaluate(model, one, {.split = split}), b = evaluate(model, other, {.split = split});
      REQUIRE(a.views.size() == b.views.size());
      CHECK(a.background == b.background);
      for (std::size_t i = 0; i < a.views.size(); ++i) {
        CHECK(a.views[i].name == b.views[i].name);
        CHECK(a.views[i].psnr == b.views[i].psnr);
        CHECK(a.views[i].ssim == b.views[i].ssim);
      }
    }
  }
  CHECK(Dataset(data).background() == black);
  data.images[1].above_white = true;
  CHECK(Dataset(data).warnings() ==
        std::vector<std::string>{"1 of 8 images have most of their values above 1, which is white (the first: image "
                                 "1): floats from 0 to 255 want a division by 255"});
}

TEST_CASE("of photographs in memory every n-th by name is held out unless a camera says so") {
  DatasetData data;
  for (int i = 0; i < 9; ++i) {
    Camera camera = lookAt({0.1 * i, 0, -6}, {0, 0, 0}, {0, -1, 0}, 0.8, 4, 3);
    camera.name = std::to_string(9 - i);
    data.cameras.push_back(camera);
    data.images.push_back({4, 3, 1, std::vector<std::uint8_t>(12, static_cast<std::uint8_t>(10 * i))});
  }
  const auto heldOut = [](const Dataset& dataset) {
    std::string names;
    for (const Camera& camera : dataset.cameras()) names += camera.name + (camera.test ? "*" : "");
    return names;
  };
  CHECK(heldOut(Dataset(data)) == "23456781*9*");
  CHECK(Dataset(data).photograph(0).data == std::vector<float>(36, 70 / 255.0f));
  data.test_every = 4;
  CHECK(heldOut(Dataset(data)) == "2346781*5*9*");
  data.cameras[2].test = true;
  CHECK(heldOut(Dataset(data)) == "123456897*");
  data.cameras[2].test = false;
  data.test_every = 0;
  const Dataset dataset(data);
  CHECK(heldOut(dataset) == "123456789");
  CHECK(messageOf([&] { evaluate(Model::load(kSample), dataset); }, ErrorKind::usage) ==
        "the data set: has no photographs of this split");
  CHECK(Trainer(dataset, {.settings = {{"init-count", "50"}}}).progress().gaussians == 50);  // without points
  data.images.resize(1);
  data.cameras.resize(1);
  data.test_every = 8;
  CHECK(heldOut(Dataset(data)) == "9");
}

TEST_CASE("an opaque photograph in memory takes no memory beside its bytes") {
  TG_SKIP_IF(tg::test::noAddressSpaceLimit());
  constexpr int width = 8000, height = 6000;
  std::vector<std::uint8_t> bytes(3 * width * height, 7);
  bytes[5] = 255;
  const Camera camera = lookAt({0, 0, -6}, {0, 0, 0}, {0, -1, 0}, 0.8, width, height);
  DatasetData data;
  data.images.push_back({width, height, 3, std::move(bytes)});
  data.cameras.push_back(camera);
  setThreads(1);
  const tg::test::AddressSpaceLimit limit(std::uint64_t{100} << 20);  // as floats it takes 576 MB
  const Dataset dataset(std::move(data));
  setThreads(0);
  CHECK(Access::dataset(dataset)->pixels(0)->rgb[5] == 255);
}

TEST_CASE("photographs in memory that make no data set are refused by name") {
  DatasetData good;
  for (int i = 0; i < 2; ++i) {
    good.cameras.push_back(lookAt({0, 0.1 * i, -6}, {0, 0, 0}, {0, -1, 0}, 0.8, 4, 3));
    good.images.push_back({4, 3, 3, std::vector<std::uint8_t>(36)});
  }
  good.points = {0, 0, 0, 1, 1, 1};
  const auto refused = [&](const auto& spoil, ErrorKind kind = ErrorKind::badData) {
    DatasetData data = good;
    spoil(data);
    return messageOf([&] { Dataset{data}; }, kind);
  };
  CHECK(refused([](DatasetData&) {}) == "accepted");
  CHECK(refused([](DatasetData& data) { data = {}; }) == "data set: images: expected at least one");
  CHECK(refused([](DatasetData& data) { data.cameras.pop_back(); }) ==
        "data set: cameras: wrong length (expected 2, found 1)");
  CHECK(refused([](DatasetData& data) { data.cameras.clear(); }) == "data set: cameras: expected one an image");
  CHECK(refused([](DatasetData& data) { data.masks.resize(1); }) ==
        "data set: masks: wrong length (expected 2, found 1)");
  CHECK(refused([](DatasetData& data) { data.images[1].width = 3; }) ==
        "data set: image 1: no picture of its camera's size (expected 4 x 3 x 1, 3 or 4, found 3 x 3 x 3 of 36 bytes)");
  CHECK_THAT(refused([](DatasetData& data) { data.images[1].data.pop_back(); }), Contains("of 35 bytes"));
  CHECK_THAT(refused([](DatasetData& data) { data.images[0].channels = 2; }), Contains("found 4 x 3 x 2"));
  CHECK_THAT(refused([](DatasetData& data) { data.masks = data.images; }),
             Contains("mask 0: no picture of its camera's size (expected 4 x 3 x 1, found 4 x 3 x 3"));
  CHECK(refused([](DatasetData& data) { data.masks = {{4, 3, 1, std::vector<std::uint8_t>(12)}, {}}; }) ==
        "data set: mask 0: hides every pixel");
  CHECK(refused([](DatasetData& data) { data.points.pop_back(); }) ==
        "data set: points: no whole number of points (expected a multiple of 3 floats, found 5)");
  CHECK(refused([](DatasetData& data) { data.colors = {1}; }) ==
        "data set: colors: wrong length (expected 6, found 1)");
  CHECK(refused([](DatasetData& data) { data.colors = {0, 0, 0, 0, 255, 0}; }) ==
        "data set: colors: point 1 is out of range (expected 0 to 1, found 255)");
  CHECK_THAT(refused([](DatasetData& data) { data.points[4] = NAN; }),
             Contains("data set: points: point 1 is out of range"));
  CHECK_THAT(refused([](DatasetData& data) { data.cameras[1].focal[0] = 1e12; }),
             Contains("data set: camera 1: focal length out of range"));
  CHECK_THAT(refused([](DatasetData& data) { data.cameras[0].test = data.cameras[1].test = true; }),
             Contains("every photograph is held out"));
  CHECK_THAT(refused([](DatasetData& data) { data.cameras[1].width = 0; }, ErrorKind::usage), Contains("camera: "));
  CHECK_THAT(refused([](DatasetData& data) { data.test_every = 1; }, ErrorKind::usage), Contains("--test-every"));
  CHECK_THAT(refused([](DatasetData& data) { data.background = {0, NAN, 0}; }, ErrorKind::usage),
             Contains("background"));
}

TEST_CASE("a data set tells what it was read without") {
  const TemporaryFolder folder;
  tg::writeSample(folder / "scene", kScene, false);
  CHECK(Dataset::load(folder / "scene").warnings().empty());
  std::filesystem::remove(folder / "scene/train/r_2.png");
  const Dataset dataset = Dataset::load(folder / "scene");
  CHECK(dataset.size() == 7);
  CHECK(dataset.warnings() ==
        std::vector<std::string>{"1 of 8 listed images are missing and were skipped (the first: ./train/r_2)"});
}

TEST_CASE("a data set of a relative path is read from there wherever the program goes") {
  const TemporaryFolder folder;
  tg::writeSample(folder / "scene", kScene, false);
  ModelData data = Model::load(kSample).data();
  data.background = {0.1f, 0.2f, 0.3f};  // photographs are read again
  const Model model(data);
  const Dataset dataset = [&] {
    const WorkingFolder working(folder.path);
    CHECK(messageOf([] { Dataset::load("none"); }, ErrorKind::cannotRead) == "none: no such folder");
    std::filesystem::copy("scene", "spoilt", std::filesystem::copy_options::recursive);
    std::ofstream("spoilt/transforms_train.json") << "{";
    CHECK(messageOf([] { Dataset::load("spoilt"); }, ErrorKind::badData).find("spoilt/transforms_train.json: ") == 0);
    return Dataset::load("scene");
  }();
  CHECK(evaluate(model, dataset).views.size() == 2);
}

TEST_CASE("what is wrong with a data set of a relative path is said of relative paths") {
  using Catch::Matchers::EndsWith, Catch::Matchers::StartsWith;
  const TemporaryFolder folder;
  tg::writeSample(folder / "scene", kScene, false);
  const auto said = [](const std::filesystem::path& given) {
    return messageOf([&] { Dataset::load(given); }, ErrorKind::badData);
  };
  {
    const WorkingFolder working(folder.path);
    CHECK_THAT(said("."), StartsWith(".: ") && EndsWith(" (did you mean ./scene?)"));
    CHECK_THAT(said("scene/train"), StartsWith("scene/train: ") && EndsWith(" (did you mean scene/?)"));
    const std::string whole = folder.path.string();
    CHECK_THAT(said(whole), StartsWith(whole + ": ") && EndsWith(" (did you mean " + whole + "/scene?)"));
  }
  {
    const WorkingFolder working(folder / "scene");
    CHECK_THAT(said("train"), StartsWith("train: ") && EndsWith(" (did you mean ./?)"));
  }
  const WorkingFolder working("/");
  const std::filesystem::path place = folder.path.relative_path();
  CHECK_THAT(said(place), StartsWith(place.string() + ": ") && Contains("cameras.bin / cameras.txt") &&
                              EndsWith(" (did you mean " + place.string() + "/scene?)"));
}

TEST_CASE("a data set that the system does not show is refused with the system's reason") {
  const TemporaryFolder folder;
  std::filesystem::create_symlink("loop", folder / "loop");
  CHECK_THAT(messageOf([&] { Dataset::load(folder / "loop/scene"); }, ErrorKind::cannotRead),
             Contains("loop/scene: cannot be read: "));
  std::filesystem::create_directory(folder / "gone");
  const WorkingFolder working(folder / "gone");
  std::filesystem::remove(folder / "gone");
  CHECK(messageOf([] { Dataset::load("."); }, ErrorKind::cannotRead).find(".: cannot be read: ") == 0);
}

TEST_CASE("a conversion says what it did, and refuses what tgconvert refuses") {
  const TemporaryFolder folder;
  const ConvertReport report = convert(kSample, folder / "a.glb", {.measure = true});
  CHECK(report.input_format == "tgz");
  CHECK(report.output_format == "glb");
  CHECK(report.gaussians == 5000);
  CHECK(report.output_bytes == std::filesystem::file_size(folder / "a.glb"));
  REQUIRE(report.psnr);
  CHECK(*report.psnr > 40);
  const ConvertReport plain = convert(kSample, folder / "plain.ply", {.measure = true});
  CHECK(plain.psnr.has_value());
  CHECK_THAT(messageOf([&] { convert(kSample, folder / "a.glb"); }, ErrorKind::cannotWrite),
             Contains("a.glb: exists already"));
  CHECK(messageOf([&] { convert(kSample, folder / "b.glb", {.edits = {{"shrink", "2"}}}); }, ErrorKind::usage) ==
        "shrink: no such edit (docs/converter.md has them)");
  for (const std::string name : {"", "--"}) {
    CHECK(messageOf([&] { convert(kSample, folder / "b.glb", {.edits = {{name, "1"}}}); }, ErrorKind::usage) ==
          "\"" + name + "\": no such edit (docs/converter.md has them)");
  }
  CHECK(messageOf([&] { convert(kSample, folder / "b.glb", {.edits = {{"upright", "no"}}}); }, ErrorKind::usage) ==
        "upright: takes no value (expected \"\", found \"no\")");
  CHECK(convert(kSample, folder / "a.ply", {.edits = {{"decimate", "100"}}}).gaussians == 100);
  CHECK(convert(kSample, folder / "c.ply", {.edits = {{"--decimate", "100"}}}).gaussians == 100);
  const auto refused = [&](const std::string& name, const ConvertOptions& options) {
    return messageOf([&] { convert(kSample, folder / name, options); }, ErrorKind::usage);
  };
  for (const float steps : {0.0f, -1.0f, 65.0f, std::numeric_limits<float>::infinity(), std::nanf("")}) {
    CHECK_THAT(refused("b.sog", {.steps = steps}), Contains("--steps: out of range (expected 0.125 to 64, found "));
  }
  const std::string idle = "--psnr does nothing here: a .png is not read again";
  CHECK(refused("b.png", {.measure = true}) == idle);
  CHECK(refused("b.png", {.measure = true, .edits = {{"decimate", "100"}}}) == idle);
  CHECK(!std::filesystem::exists(folder / "b.png"));
}

TEST_CASE("a conversion says how far it is and ends where its caller throws") {
  const TemporaryFolder folder;
  std::vector<std::string> told;
  const auto tell = [&](const std::string& part, std::size_t done, std::size_t steps) {
    told.push_back(part + " " + std::to_string(done) + " " + std::to_string(steps));
  };
  convert(kSample, folder / "a.sog", {.edits = {{"decimate", "300"}}, .target_psnr = 30, .progress = tell});
  CHECK(told.size() == 10);
  CHECK(told.back() == "target 9 9");
  // An exception of a kind that the library turns into its own Error where it is its own.
  const auto fail = [&](const std::string& part, std::size_t done, std::size_t steps) {
    tell(part, done, steps);
    if (done == 1) throw std::system_error(std::make_error_code(std::errc::io_error));
  };
  const ConvertOptions fit = {.edits = {{"decimate", "300"}}, .viewer = "three", .progress = fail};
  CHECK_THROWS_AS(convert(kSample, folder / "a.glb", fit), std::system_error);
  CHECK(told.back() == "fit 1 288");
  CHECK(!std::filesystem::exists(folder / "a.glb"));
}

TEST_CASE("an option of a conversion that does nothing or has no such value is refused by its flag") {
  const TemporaryFolder folder;
  const auto refused = [&](const std::string& name, const ConvertOptions& options) {
    return messageOf([&] { convert(kSample, folder / name, options); }, ErrorKind::usage);
  };
  const std::vector<Camera> views = {lookAt({0, 0, -6}, {0, 0, 0}, {0, -1, 0}, 0.8, 40, 30)};
  for (const auto& [flag, options] : {std::pair<std::string, ConvertOptions>{"--quantize", {.quantize = true}},
                                      {"--meshopt", {.meshopt = true}},
                                      {"--steps", {.steps = 2.0f}},
                                      {"--target-size", {.target_size = 900}},
                                      {"--target-psnr", {.target_psnr = 40}},
                                      {"--texture-step", {.texture_step = 0.1f}},
                                      {"--no-cameras", {.cameras = false}},
                                      {"--views", {.views = views}},
                                      {"--base-only", {.base_only = true}},
                                      {"--lean", {.lean = true}},
                                      {"--atlas", {.atlas = "webp"}},
                                      {"--spz-version", {.spz_version = 4}},
                                      {"--spz-axes", {.spz_axes = "rdf"}}}) {
    CHECK_THAT(refused("a.ply", options), Contains(flag + " does nothing here: it is only for "));
  }
  CHECK(refused("a.sog", {.cameras = false}) ==
        "--no-cameras does nothing here: it is only for .tgz, lod-meta.json, .glb, .gltf or .html");
  CHECK_THAT(refused("a.tgz", {.viewer = "three"}), Contains("--for does nothing here"));
  CHECK(refused("a.glb", {.viewer_aim = "base"}) == "--for-aim does nothing here: it is only for --for");
  CHECK_THAT(refused("a.glb", {.measure = true, .dry_run = true}), Contains("--psnr does nothing beside --dry-run"));
  CHECK_THAT(refused("a.html", {.atlas = "exr"}), Contains("--atlas: a page reads no EXR"));
  CHECK(refused("a.glb", {.steps = 2, .target_psnr = 40}) ==
        "--steps, --target-size and --target-psnr exclude one another");
  CHECK(refused("a.glb", {.target_size = 0}).find("--target-size: out of range (expected 1 to ") == 0);
  CHECK(refused("a.glb", {.target_psnr = NAN}) == "--target-psnr: out of range (expected 1 to 100, found nan)");
  CHECK(refused("a.sog", {.texture_step = 1}).find("--texture-step: out of range") == 0);
  CHECK(refused("a.spz", {.spz_version = 5}) == "--spz-version: out of range (expected 3 to 4, found 5)");
  CHECK_THAT(refused("a.glb", {.atlas = "png9"}), Contains("--atlas: ") && Contains("png8"));
  CHECK_THAT(refused("a.glb", {.views = {Camera()}}), Contains("camera: "));
  CHECK(std::filesystem::is_empty(folder.path));
}

TEST_CASE("the options of a conversion are those of tgconvert") {
  const TemporaryFolder folder;
  const std::string path = folder.path.string();
  const auto converts = [&](const std::string& input, const std::string& name, const std::string& flags,
                            const ConvertOptions& options) {
    INFO(flags);
    const ConvertReport report = convert(input, folder / ("a" + name), options);
    program("tgconvert", input + " " + path + "/b" + name + " " + flags, folder);
    CHECK(bytesOf(folder / ("a" + name)) == bytesOf(folder / ("b" + name)));
    return report;
  };
  const ConvertReport sized = converts(kSample, ".sog", "--target-size 150000", {.target_size = 150000});
  CHECK(sized.output_bytes <= 150000);
  REQUIRE(sized.steps);
  CHECK(*sized.steps > 1);
  converts(kSample, ".glb", "--target-psnr 35 --no-cameras", {.target_psnr = 35, .cameras = false});
  CHECK(Model::load(folder / "a.glb").cameras().empty());
  converts(kSample, "_webp.glb", "--atlas webp --lean --steps 2 --texture-step 0.1",
           {.steps = 2, .texture_step = 0.1f, .lean = true, .atlas = "webp"});
  converts(path + "/a.glb", "_base.glb", "--base-only", {.base_only = true});
  CHECK(Model::load(folder / "a_base.glb").textureMode() == TextureMode::none);
  converts(kSample, ".spz", "--spz-version 3", {.spz_version = 3});
  converts(path + "/a.spz", ".ply", "--spz-axes rdf", {.spz_axes = "rdf"});
  converts(kSample, "_three.ply", "--for three --for-aim base --decimate 50",
           {.edits = {{"decimate", "50"}}, .viewer = "three", .viewer_aim = "base"});
  std::vector<Camera> views = {lookAt({0, 0, -6}, {0, 0, 0}, {0, -1, 0}, 0.8, 40, 30)};
  views[0].name = "front of all";
  convert(kSample, folder / "views.glb", {.views = views});
  CHECK(bytesOf(folder / "views.glb").find("front of all") != std::string::npos);
  const ConvertReport dry = convert(kSample, folder / "dry.glb", {.views = views, .dry_run = true});
  CHECK(dry.output_bytes == std::filesystem::file_size(folder / "views.glb"));
  CHECK_FALSE(std::filesystem::exists(folder / "dry.glb"));
}

TEST_CASE("every example runs on what the one before it made") {
  const TemporaryFolder folder;
  tg::writeSample(folder / "scene", kScene, false);
  const std::string path = folder.path.string();
  CHECK_THAT(example("train", path + "/scene " + path + "/model.tgz 5", folder), Contains("textured: 5 iterations"));
  CHECK_THAT(example("evaluate", path + "/model.tgz " + path + "/scene", folder), Contains("mean: "));
  CHECK_THAT(example("convert", path + "/model.tgz " + path + "/model.glb", folder), Contains("tgz -> glb"));
  CHECK_THAT(example("render", path + "/model.glb " + path + "/picture.png", folder), Contains("32 x 32 pixels"));
  CHECK(readImage(folder / "picture.png").data.size() == 32 * 32 * 3);
  CHECK(example("make", path + "/disc.tgz", folder).empty());
  CHECK_THAT(example("render", path + "/disc.tgz " + path + "/disc.png", folder), Contains("1 Gaussians, 256 x 256"));
}

TEST_CASE("a thread that cannot start is told as the programs tell it") {
  const auto starts = [] { throw std::system_error(std::make_error_code(std::errc::resource_unavailable_try_again)); };
  CHECK(messageOf([&] { guarded(starts); }, ErrorKind::device).find("no thread can be started: ") == 0);
}

TEST_CASE("a picture in 8 bits is that of a PNG") {
  const TemporaryFolder folder;
  Image image{3, 2, 1, {-1, 0.001f, 0.0019f, 0.002f, 0.5f, 7}};
  writeImage(folder / "a.png", image);
  const ByteImage bytes = toBytes(image);
  CHECK(bytes.data == std::vector<std::uint8_t>{0, 0, 0, 1, 128, 255});
  CHECK_FALSE(bytes.above_white);
  CHECK(toBytes({3, 2, 1, {0, 0, 0, 2, 1, 2}}).above_white);
  CHECK_FALSE(toBytes({3, 2, 1, {0, 0, 2, 2, 1, 1}}).above_white);
  CHECK_FALSE(toBytes({1, 1, 1, {1.0019f}}).above_white);  // of 255.5 at most, which rounding may leave
  CHECK(toBytes({1, 1, 1, {1.002f}}).above_white);
  CHECK(toBytes(readImage(folder / "a.png")).data == bytes.data);
  image.data[4] = NAN;
  CHECK(messageOf([&] { toBytes(image); }, ErrorKind::usage) ==
        "image: 8 bits hold finite numbers alone (found nan at column 1, row 1)");
  CHECK_THAT(messageOf([&] { toBytes(image, "frame 7"); }, ErrorKind::usage), Contains("frame 7: 8 bits hold"));
  image.data.pop_back();
  CHECK_THAT(messageOf([&] { toBytes(image); }, ErrorKind::usage), Contains("image: no picture"));
}

TEST_CASE("a picture that is none is not written") {
  const TemporaryFolder folder;
  Image image{2, 2, 3, std::vector<float>(11)};
  CHECK_THAT(messageOf([&] { writeImage(folder / "a.png", image); }, ErrorKind::usage),
             Contains("found 11 for 2 x 2 x 3"));
  CHECK_FALSE(std::filesystem::exists(folder / "a.png"));
  image.data.push_back(1);
  writeImage(folder / "a.png", image);
  CHECK(readImage(folder / "a.png").data.back() == 1);
  for (const float value : {NAN, INFINITY, -INFINITY}) {
    image.data.back() = value;
    for (const char* name : {"b.png", "b.JPG"}) {
      CHECK_THAT(messageOf([&] { writeImage(folder / name, image); }, ErrorKind::usage),
                 Contains(std::string(name) + ": 8 bits hold finite numbers alone (found "));
      CHECK_FALSE(std::filesystem::exists(folder / name));
    }
  }
  image.data.back() = 1e5f;
  CHECK_THAT(messageOf([&] { writeImage(folder / "a.exr", image); }, ErrorKind::cannotWrite),
             Contains("a.exr: value does not fit a half float"));
  const Image wide{70000, 1, 1, std::vector<float>(70000)};
  CHECK_THAT(messageOf([&] { writeImage(folder / "a.jpg", wide); }, ErrorKind::cannotWrite), Contains("a.jpg: JPEG: "));
}
