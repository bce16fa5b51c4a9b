// SPDX-License-Identifier: Apache-2.0
// tgview --render, from the command line to the file.
#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <sstream>

#include "core/bundle/bundle.h"
#include "core/bundle/camera_file.h"
#include "core/bundle/ply.h"
#include "core/file/file.h"
#include "core/image/drawn.h"
#include "core/image/metrics.h"
#include "render/renderer.h"
#include "support/catch.h"
#include "support/scenes.h"
#include "viewer/process.h"
#include "viewer/view/compare.h"

using namespace tg;
using test::ProcessResult;
using test::Workshop;

namespace {

constexpr std::array kOutputs = {Output::final, Output::base,   Output::texture, Output::alpha,
                                 Output::depth, Output::normal, Output::count};

bool contains(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

Frame cpuFrame(const Bundle& bundle, int camera, const RenderSettings& settings) {
  const auto renderer = makeCpuRenderer();
  renderer->setModel(bundle.model);
  return renderer->render(bundle.cameras.at(camera), settings);
}

// Largest difference relative to the value: half floats keep 11 bits.
double halfError(const Image& a, const Image& b) {
  double worst = 0;
  for (std::size_t i = 0; i < a.data.size(); ++i) {
    worst = std::max(worst, std::abs(a.data[i] - b.data[i]) / std::max(1e-3, double{std::abs(b.data[i])}));
  }
  return worst;
}

}  // namespace

TEST_CASE("the flag --render writes every output of the first test camera") {
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  const Bundle bundle = readBundle(shop / "model.tgz");
  RenderSettings settings;
  settings.background = bundle.background;
  for (const Output output : kOutputs) {
    const std::string show(name(output));
    INFO(show);
    settings.outputs = {output};  // as --render asks: a whole frame's picture rounds differently
    const Frame frame = cpuFrame(bundle, 1, settings);
    const ProcessResult picture =
        shop.tgview({"model.tgz", "--render", show + ".png", "--show", show, "--backend", "cpu"});
    REQUIRE(picture.exit_code == 0);
    CHECK(picture.err.empty());
    CHECK(contains(picture.out, show + ".png: 96x72"));
    CHECK(std::isinf(psnr8Bit(shop.read(show + ".png"), visualize(frame, output))));
    CHECK(isDrawn(readFile(shop / (show + ".png"), 1 << 20)));
    const ProcessResult numbers =
        shop.tgview({"model.tgz", "--render", show + ".exr", "--show", show, "--backend", "cpu"});
    REQUIRE(numbers.exit_code == 0);
    const Image exr = shop.read(show + ".exr");
    const Image expected = extract(frame, output);
    REQUIRE(exr.channels == expected.channels);
    CHECK(halfError(exr, expected) < 1e-3);
  }
}

TEST_CASE("Vulkan, OpenGL and CPU render the same pictures") {
  TG_SKIP_IF(test::noDevice());
  const std::vector<std::string> devices = test::deviceBackends();
  std::vector<std::string> backends = devices;
  backends.emplace_back("cpu");
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  for (const Output output : kOutputs) {
    const std::string show(name(output));
    INFO(show);
    for (const std::string& backend : backends) {
      const ProcessResult result = shop.tgview(
          {"model.tgz", "--render", backend + ".png", "--show", show, "--backend", backend, "--size", "160x120"});
      INFO(result.err);
      REQUIRE(result.exit_code == 0);
    }
    for (const std::string& device : devices) CHECK(psnr(shop.read(device + ".png"), shop.read("cpu.png")) > 45);
  }
}

TEST_CASE("the flag --render under validation: no message") {
  TG_SKIP_IF(test::noDevice());
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  for (const std::string& backend : test::deviceBackends()) {
    const ProcessResult result = shop.tgview({"model.tgz", "--render", "a.png", "--backend", backend, "--validation"});
    CHECK(result.err == "");
    CHECK(result.exit_code == 0);
  }
}

TEST_CASE("texture terms, intersection, background, camera and size change the picture as they say") {
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  const Bundle bundle = readBundle(shop / "model.tgz");
  const auto render = [&shop](std::vector<std::string> flags) {
    flags.insert(flags.begin(), {"model.tgz", "--render", "a.png", "--backend", "cpu"});
    const ProcessResult result = shop.tgview(flags);
    INFO(result.err);
    REQUIRE(result.exit_code == 0);
    return shop.read("a.png");
  };
  const auto expected = [&bundle](int camera, TextureMode textures, std::optional<IntersectionModel> intersection,
                                  glm::vec3 background) {
    RenderSettings settings;
    settings.textures = textures;
    settings.intersection = intersection;
    settings.background = background;
    settings.outputs = {Output::final};
    return visualize(cpuFrame(bundle, camera, settings), Output::final);
  };
  const glm::vec3 white(1.0f);
  CHECK(std::isinf(psnr8Bit(render({"--textures", "off"}), expected(1, TextureMode::none, {}, white))));
  CHECK(std::isinf(psnr8Bit(render({"--textures", "rgb"}), expected(1, TextureMode::rgb, {}, white))));
  CHECK(psnr8Bit(render({"--textures", "off"}), render({"--textures", "rgba"})) < 60);
  CHECK(std::isinf(
      psnr8Bit(render({"--intersection", "plane"}), expected(1, TextureMode::rgba, IntersectionModel::plane, white))));
  CHECK(std::isinf(psnr8Bit(render({"--camera", "2", "--background", "0.25,0.5,0.75"}),
                            expected(2, TextureMode::rgba, {}, {0.25f, 0.5f, 0.75f}))));
  CHECK(std::isinf(psnr8Bit(render({"--outside", "base"}), render({}))));
  for (const TextureOutside outside : {TextureOutside::clip, TextureOutside::edge}) {
    RenderSettings settings;
    settings.outside = outside;
    settings.background = white;
    settings.outputs = {Output::final};
    const Image picture = render({"--outside", std::string(name(outside))});
    CHECK(std::isinf(psnr8Bit(picture, visualize(cpuFrame(bundle, 1, settings), Output::final))));
    CHECK_FALSE(std::isinf(psnr8Bit(picture, render({}))));
  }
  const std::string cameras = formatCameras({bundle.cameras[2]});
  shop.write("camera.json", cameras);
  CHECK(std::isinf(psnr8Bit(render({"--camera", "camera.json"}), render({"--camera", "2"}))));
  const Image wide = render({"--size", "200x72"});
  CHECK(wide.width == 200);
  // The middle of a wider image is the camera's own.
  Image middle(96, 72, 3);
  for (int y = 0; y < 72; ++y) {
    for (int x = 0; x < 96; ++x) {
      for (int c = 0; c < 3; ++c) middle.at(x, y, c) = wide.at(x + 52, y, c);
    }
  }
  CHECK(psnr8Bit(middle, render({})) > 45);
}

TEST_CASE("beside its photograph a picture has the camera fitted into its half once, and the file is named") {
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  std::filesystem::create_directory(shop / "images");
  const ProcessResult alone = shop.tgview(
      {"model.tgz", "--camera", "1", "--size", "100x200", "--backend", "cpu", "--render", "images/view1.png"});
  REQUIRE(alone.exit_code == 0);
  std::filesystem::copy(shop / "images/view1.png", shop / "images/view1.jpg");
  const ProcessResult both = shop.tgview({"model.tgz", "--camera", "1", "--size", "200x200", "--backend", "cpu",
                                          "--photos", "images", "--compare-mode", "side", "--render", "both.png"});
  INFO(both.err);
  REQUIRE(both.exit_code == 0);
  CHECK(contains(both.out, "images/view1.png"));
  const Image picture = shop.read("both.png"), half = shop.read("images/view1.png");
  REQUIRE(picture.width == 200);
  Image left(100, 200, 3);
  for (int y = 0; y < 200; ++y) {
    for (int x = 0; x < 100; ++x) {
      for (int c = 0; c < 3; ++c) left.at(x, y, c) = picture.at(x, y, c);
    }
  }
  CHECK(std::isinf(psnr8Bit(left, half)));
  // Both are whole where nobody says how large they are.
  REQUIRE(shop.tgview({"model.tgz", "--camera", "1", "--backend", "cpu", "--render", "one.png"}).exit_code == 0);
  REQUIRE(shop.tgview({"model.tgz", "--camera", "1", "--backend", "cpu", "--photos", "images", "--compare-mode", "side",
                       "--render", "two.png"})
              .exit_code == 0);
  const Image one = shop.read("one.png"), two = shop.read("two.png");
  CHECK(two.width == 2 * one.width);
  CHECK(two.height == one.height);
}

TEST_CASE("a photograph is exposed like the model, figures against it are not, and depth has none") {
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  std::filesystem::create_directory(shop / "images");
  REQUIRE(shop.tgview({"model.tgz", "--camera", "1", "--backend", "cpu", "--render", "images/view1.png"}).exit_code ==
          0);
  const auto compared = [&](std::vector<std::string> more) {
    more.insert(more.begin(),
                {"model.tgz", "--camera", "1", "--backend", "cpu", "--compare-mode", "side", "--render", "both.png"});
    const ProcessResult result = shop.tgview(more);
    INFO(result.err);
    REQUIRE(result.exit_code == 0);
    return result.out.substr(result.out.find("both.png"));
  };
  const auto figuresOf = [](const std::string& line) {
    return line.find("PSNR") == std::string::npos ? "" : line.substr(line.find("PSNR"));
  };
  const std::string figures = figuresOf(compared({"--photos", "images"}));
  CHECK(std::atof(figures.c_str() + 5) > 50);  // but for the rounding to bytes
  CHECK(figuresOf(compared({"--photos", "images", "--exposure", "1"})) == figures);
  const Image both = shop.read("both.png");
  Image left(both.width / 2, both.height, 3), right = left;
  for (int y = 0; y < left.height; ++y) {
    for (int x = 0; x < left.width; ++x) {
      for (int c = 0; c < 3; ++c) {
        left.at(x, y, c) = both.at(x, y, c);
        right.at(x, y, c) = both.at(x + left.width, y, c);
      }
    }
  }
  CHECK(psnr8Bit(left, right) > 45);
  for (const char* output : {"depth", "texture"}) {
    CHECK(figuresOf(compared({"--photos", "images", "--show", output})).empty());
  }
  CHECK(contains(compared({"--compare", "model.tgz", "--show", "depth"}), " of the colours"));
  CHECK_FALSE(contains(compared({"--compare", "model.tgz"}), " of the colours"));
}

TEST_CASE("photographs with a lens are said to be no picture of a pinhole's") {
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  std::filesystem::create_directories(shop / "data/images");
  const std::vector<std::string> render = {"model.tgz", "--camera", "1", "--backend", "cpu", "--render"};
  const auto with = [&](std::vector<std::string> more) {
    more.insert(more.begin(), render.begin(), render.end());
    const ProcessResult result = shop.tgview(more);
    INFO(result.err);
    REQUIRE(result.exit_code == 0);
    return result.err;
  };
  with({"data/images/view1.png"});
  shop.write("data/transforms.json", R"({"k1": 0.2, "frames": [{}]})");
  const std::string warning =
      "data: warning: photographs have a lens, the model's pictures have none: tgtrain undistort DATASET OUT makes "
      "ones to compare with\n";
  CHECK(contains(with({"both.png", "--photos", "data"}), warning));
  CHECK_FALSE(contains(with({"both.png", "--photos", "data", "--quiet"}), warning));
  shop.write("data/transforms.json", R"({"k1": 0, "frames": [{}]})");
  CHECK_FALSE(contains(with({"both.png", "--photos", "data"}), warning));
}

TEST_CASE("with --quiet a picture is written without a word, a mistake is still said") {
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  const ProcessResult written = shop.tgview({"model.tgz", "--render", "a.png", "--backend", "cpu", "--quiet"});
  CHECK(written.exit_code == 0);
  CHECK(written.out.empty());
  CHECK(written.err.empty());
  CHECK(std::filesystem::exists(shop / "a.png"));
  const ProcessResult turned =
      shop.tgview({"model.tgz", "--turntable", "2", "-o", "turn", "--backend", "cpu", "--quiet", "--size", "32x24"});
  CHECK(turned.exit_code == 0);
  CHECK((turned.out + turned.err).empty());
  CHECK(contains(shop.tgview({"model.tgz", "--quiet", "--render", "a.bmp"}).err, "unknown image format"));
}

TEST_CASE("the flag --list-cameras names them all") {
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  const ProcessResult result = shop.tgview({"model.tgz", "--list-cameras"});
  CHECK(result.exit_code == 0);
  CHECK(std::count(result.out.begin(), result.out.end(), '\n') == 3);
  CHECK(contains(result.out, "view2.png"));
  writeSplatPly(shop / "\x1b.ply", test::sampleModel());
  CHECK(shop.tgview({"\x1b.ply", "--list-cameras"}).err == "?.ply: the model has no cameras\n");
}

TEST_CASE("what is printed and lost is a failure") {
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  for (const char* flag : {"--list-cameras", "--inspect=10,10", "--version"}) {
    CAPTURE(flag);
    const ProcessResult result = shop.tgview({"model.tgz", flag}, {"sh", "-c", "exec \"$0\" \"$@\" >/dev/full"});
    CHECK(result.exit_code == 4);
    CHECK(contains(result.err, "tgview: standard output: cannot write"));
  }
}

TEST_CASE("a model without cameras is shown whole") {
  const Workshop shop;
  writeSplatPly(shop / "splats.ply", test::sampleModel());
  const ProcessResult result =
      shop.tgview({"splats.ply", "--render", "a.png", "--show", "alpha", "--size", "80x60", "--backend", "cpu"});
  REQUIRE(result.exit_code == 0);
  const Image image = shop.read("a.png");
  double sum = 0;
  for (float value : image.data) sum += value;
  CHECK(sum / static_cast<double>(image.data.size()) > 0.1);
}

TEST_CASE("the list of devices names each with its limits, and --device takes its number") {
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  const ProcessResult list = shop.tgview({"--list-devices"});
  INFO(list.out << list.err);
  CHECK(list.exit_code == 0);
  CHECK(contains(list.out, "--backend cpu"));
  std::istringstream lines(list.out);
  int numbered = 0, used = 0;
  for (std::string line; std::getline(lines, line);) {
    if (!contains(line, std::to_string(numbered) + "  ")) continue;
    const std::string number = std::to_string(numbered++);
    const bool usable = contains(line, ", on the CPU") || contains(line, ", on a GPU");
    const ProcessResult shot = shop.tgview({"model.tgz", "--render", "a.png", "--device", number, "--validation"});
    INFO(number << ": " << line << shot.err);
    CHECK(shot.exit_code == (usable ? 0 : 5));
    const std::string other = contains(line, "Vulkan") ? "opengl" : "vulkan";
    CHECK(shop.tgview({"model.tgz", "--render", "a.png", "--device", number, "--backend", other}).exit_code == 1);
    if (!usable) continue;
    ++used;
    std::getline(lines, line);
    CHECK(contains(line, "MiB"));
  }
  CHECK(numbered >= 2);
  CHECK(shop.tgview({"model.tgz", "--render", "a.png", "--device", "99"}).exit_code == 1);
  if (used > 0) CHECK(std::filesystem::exists(shop / "a.png"));
}

TEST_CASE("a driver that is Vulkan but for a few features is listed like any other") {
  // Its manifest says so, and the loader hides such drivers from those who do not ask.
  const std::filesystem::path manifests = "/usr/share/vulkan/icd.d";
  std::filesystem::path manifest;
  std::error_code none;
  for (const auto& entry : std::filesystem::directory_iterator(manifests, none)) {
    if (entry.path().filename().string().starts_with("lvp_icd")) manifest = entry.path();
  }
  TG_SKIP_IF(manifest.empty() ? "no lavapipe" : "");
  const std::string text((std::istreambuf_iterator<char>(std::ifstream(manifest).rdbuf())), {});
  const std::size_t at = text.find("\"library_path\"");
  REQUIRE(at != std::string::npos);
  const Workshop shop;
  shop.write("icd.json", text.substr(0, at) + "\"is_portability_driver\": true, " + text.substr(at));
  const std::string path = (shop / "icd.json").string();
  const ProcessResult list = shop.tgview({"--list-devices"}, {"VK_DRIVER_FILES=" + path, "VK_ICD_FILENAMES=" + path});
  INFO(list.out);
  CHECK(contains(list.out, "Vulkan, llvmpipe"));
}

TEST_CASE("without any device: auto says so once and uses the CPU, vulkan and opengl fail") {
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  const std::vector<std::string> no_driver = {"VK_DRIVER_FILES=/nonexistent.json", "VK_ICD_FILENAMES=/nonexistent.json",
                                              "__EGL_VENDOR_LIBRARY_FILENAMES=/nonexistent.json"};
  const ProcessResult automatic = shop.tgview({"model.tgz", "--render", "a.png"}, no_driver);
  CHECK(automatic.exit_code == 0);
  CHECK(std::count(automatic.err.begin(), automatic.err.end(), '\n') == 1);
  CHECK(contains(automatic.err, "rendering on the CPU"));
  for (const char* backend : {"vulkan", "opengl"}) {
    const ProcessResult asked = shop.tgview({"model.tgz", "--render", "b.png", "--backend", backend}, no_driver);
    INFO(asked.err);
    CHECK(asked.exit_code == 5);
  }
  CHECK_FALSE(std::filesystem::exists(shop / "b.png"));
  const ProcessResult device = shop.tgview({"model.tgz", "--render", "b.png", "--device", "no such device"});
  CHECK(device.exit_code == 5);
}

TEST_CASE("without a display the window is refused with the way out") {
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  for (const std::vector<std::string>& display : {std::vector<std::string>{}, {"DISPLAY=:9873"}}) {
    const ProcessResult result = shop.tgview({"model.tgz"}, display);
    CHECK(result.exit_code == 5);
    CHECK(contains(result.err, "--render"));
    CHECK(std::count(result.err.begin(), result.err.end(), '\n') == 1);
  }
}

TEST_CASE("colour maps, percentiles and gain give the same picture on every backend, the one that visualize() makes") {
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  const Bundle bundle = readBundle(shop / "model.tgz");
  std::vector<std::string> backends = test::deviceBackends();
  backends.emplace_back("cpu");
  for (const auto& [show, row, value] : std::vector<std::array<std::string, 3>>{{"depth", "colors", "turbo"},
                                                                                {"count", "colors", "viridis"},
                                                                                {"overdraw", "range", "2,98"},
                                                                                {"texel-density", "colors", "grey"},
                                                                                {"texture", "gain", "8"}}) {
    RenderSettings settings;
    settings.background = bundle.background;
    settings.outputs = {*parse<Output>(show)};
    renderSetting(row).set(settings, value, "");
    const Image expected = visualize(cpuFrame(bundle, 1, settings), *parse<Output>(show), settings);
    for (const std::string& backend : backends) {
      INFO(show << " --" << row << " " << value << " on " << backend);
      const ProcessResult result =
          shop.tgview({"model.tgz", "--render", "a.png", "--show", show, "--" + row, value, "--backend", backend});
      INFO(result.err);
      REQUIRE(result.exit_code == 0);
      // Backends sum in other orders: a splat more or less at a threshold.
      CHECK(psnr8Bit(shop.read("a.png"), expected) > (backend == "cpu" ? 1e9 : 35));
    }
  }
}

TEST_CASE("a legend and a FLIP map are drawn where they are asked for") {
  const Workshop shop;
  test::writeSample(shop / "a.tgz");
  test::writeSample(shop / "b.tgz", 200);
  const auto render = [&](std::vector<std::string> more) {
    more.insert(more.begin(), {"a.tgz", "--render", "out.png", "--backend", "cpu", "--size", "320x240"});
    const ProcessResult result = shop.tgview(more);
    INFO(result.err);
    REQUIRE(result.exit_code == 0);
    CHECK(isDrawn(readFile(shop / "out.png", 1 << 24)));
    return shop.read("out.png");
  };
  const Image plain = render({"--show", "count"}), legend = render({"--show", "count", "--legend"});
  CHECK(legend.data != plain.data);
  CHECK(legend.at(300, 10, 0) == plain.at(300, 10, 0));
  CHECK(std::isinf(psnr8Bit(render({"--show", "count", "--legend"}), legend)));
  const Image first = render({}), flip = render({"--compare", "b.tgz", "--compare-mode", "flip"});
  const ProcessResult other = shop.tgview({"b.tgz", "--render", "b.png", "--backend", "cpu", "--size", "320x240"});
  REQUIRE(other.exit_code == 0);
  CHECK(psnr8Bit(flip, flipOf(first, shop.read("b.png"), {})) > 45);  // of pictures before they were rounded
  const Image weak = render({"--compare", "b.tgz", "--compare-mode", "difference"});
  const Image strong = render({"--compare", "b.tgz", "--compare-mode", "difference", "--gain", "4"});
  CHECK(psnr8Bit(strong, differenceOf(first, shop.read("b.png"), {}, {.gain = 4})) > 40);
  CHECK(psnr8Bit(strong, weak) < 40);
}

TEST_CASE("numbers of two models have the colours of one range") {
  const Workshop shop;
  test::writeSample(shop / "many.tgz");
  test::writeSample(shop / "few.tgz", 40);
  for (const std::string range : {"0,100", "0,99"}) {
    const ProcessResult result =
        shop.tgview({"few.tgz", "--compare", "many.tgz", "--compare-mode", "side", "--show", "count", "--range", range,
                     "--render", "out.png", "--backend", "cpu", "--size", "320x120"});
    INFO(result.err);
    REQUIRE(result.exit_code == 0);
    const Image both = shop.read("out.png");
    float few = 0, many = 0;
    for (int y = 0; y < 120; ++y) {
      for (int x = 0; x < 160; ++x) {
        few = std::max(few, both.at(x, y, 2));
        many = std::max(many, both.at(x + 160, y, 2));
      }
    }
    CHECK(many == 1.0f);  // the most of both is white
    CHECK(few < 0.9f);
  }
}

TEST_CASE("an empty file name, and a flag in the place of one, are refused as such") {
  const Workshop shop;
  for (const std::vector<std::string>& arguments :
       {std::vector<std::string>{""}, {"", "--render", "a.png"}, {"model.tgz", "--render", ""}}) {
    const ProcessResult result = shop.tgview(arguments);
    CHECK(result.exit_code == 1);
    CHECK(contains(result.err, ": an empty file name\n"));
  }
  const ProcessResult flag = shop.tgview({"model.tgz", "--render", "-q"});
  CHECK(flag.exit_code == 1);
  CHECK(contains(flag.err, "--render: expected a file name, found \"-q\"\n"));
}

TEST_CASE("a flag that would do nothing is refused by name") {
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  const std::vector<std::string> render = {"--render", "a.png", "--backend", "cpu"};
  const std::vector<std::string> numbers = {"--render", "a.exr", "--backend", "cpu"};
  const std::vector<std::string> path = {"--path", "cameras.json", "-o", "frames"};
  struct Idle {
    std::vector<std::string> run, flag;
    std::string said;
  };
  const std::vector<Idle> cases = {
      {render, {"--gain", "2"}, "does nothing to final"},
      {render, {"--colors", "turbo"}, "does nothing to final (expected --show with one of alpha, depth"},
      {render, {"--range", "2,98"}, "does nothing to final"},
      {render,
       {"--legend"},
       "there are no numbers to explain (expected a picture, and --show with one of texture, alpha"},
      {render,
       {"--exposure", "1", "--show", "depth"},
       "does nothing to depth (expected --show with one of final, base)"},
      {render, {"--background", "white", "--show", "normal"}, "does nothing to normal"},
      {render, {"--textures", "off", "--show", "centers"}, "does nothing to centers"},
      {render, {"--sh-degree", "1", "--show", "count"}, "does nothing to count"},
      {render, {"--timings"}, "does nothing with --render (expected a window)"},
      {render, {"--session", "s.json"}, "(expected a window)"},
      {render, {"--no-session"}, "(expected a window)"},
      {render, {"--frames-in-flight", "1"}, "(expected a window)"},
      {render, {"--elevation", "10"}, "(expected --turntable)"},
      {render, {"--radius", "3"}, "(expected --turntable)"},
      {render, {"--fps", "25"}, "does nothing with --render"},
      {render, {"--up", "+z"}, "does nothing for the view of a camera"},
      {numbers, {"--exposure", "1"}, "does nothing with --render to .exr (expected a picture)"},
      {numbers, {"--colors", "grey", "--show", "depth"}, "(expected a picture)"},
      {numbers, {"--legend", "--show", "depth"}, "(expected a picture"},
      {{"--list-cameras"}, {"--show", "depth"}, "does nothing with --list-cameras"},
      {{"--list-cameras"}, {"--render", "a.png"}, "does nothing with --list-cameras"},
      {{"--list-cameras"}, {"--near", "1"}, "does nothing with --list-cameras"},
      {{"--list-cameras"}, {"--follow"}, "does nothing with --list-cameras"},
      {{"--inspect", "5,5"}, {"--show", "depth"}, "does nothing with --inspect"},
      {{"--inspect", "5,5"}, {"--backend", "cpu"}, "does nothing with --inspect"},
      {{"--inspect", "5,5"}, {"--exposure", "1"}, "does nothing with --inspect"},
      {{"--inspect", "5,5"}, {"--compare", "model.tgz"}, "does nothing with --inspect"},
      {path, {"--camera", "1"}, "does nothing with --output"},
      {path, {"--up", "+z"}, "does nothing with --output"},
      {path, {"--elevation", "10"}, "(expected --turntable)"},
      {{"--benchmark", "cameras.json"}, {"--colors", "turbo", "--show", "depth"}, "does nothing with --benchmark"},
      {{"--compare", "model.tgz", "--render", "a.png"}, {"--legend"}, "side and wipe have none"},
      {render, {"--device", "0"}, "is of Vulkan and OpenGL"},
      {{}, {"--legend"}, "does nothing in a window"},
      {{}, {"--quiet"}, "does nothing in a window"},
      {{}, {"--radius", "2"}, "does nothing in a window (expected --turntable)"},
  };
  for (const auto& [run, flag, said] : cases) {
    std::vector<std::string> arguments = {"model.tgz"};
    arguments.insert(arguments.end(), run.begin(), run.end());
    arguments.insert(arguments.end(), flag.begin(), flag.end());
    const ProcessResult result = shop.tgview(arguments);
    INFO(flag.front() << ": " << result.err);
    CHECK(result.exit_code == 1);
    CHECK(contains(result.err, flag.front() + ": "));
    CHECK(contains(result.err, said));
    CHECK(std::count(result.err.begin(), result.err.end(), '\n') == 1);
  }
  const ProcessResult two = shop.tgview({"model.tgz", "model.tgz", "--inspect", "5,5"});
  CHECK(two.exit_code == 1);
  CHECK_FALSE(std::filesystem::exists(shop / "a.png"));
  CHECK_FALSE(std::filesystem::exists(shop / "frames"));
}

TEST_CASE("every wrong use is one line and its exit code, and leaves no file") {
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  const std::string whole = [&shop] {
    std::string bytes(std::filesystem::file_size(shop / "model.tgz"), '\0');
    std::ifstream(shop / "model.tgz", std::ios::binary).read(bytes.data(), static_cast<std::streamsize>(bytes.size()));
    return bytes;
  }();
  shop.write("short.tgz", std::string_view(whole).substr(0, whole.size() / 2));
  shop.write("empty.tgz", "");
  shop.write("text.ply", "hello\n");
  shop.write("bad.json", "[{]");
  shop.write("none.json", "[]");
  shop.write("no.json", R"([{"id":0,"img_name":"a","width":0,"height":-4,"position":[0,0,0],)"
                        R"("rotation":[[1,0,0],[0,1,0],[0,0,1]],"fx":1,"fy":1}])");
  std::filesystem::create_directory(shop / "folder");
  struct Case {
    std::vector<std::string> arguments;
    int exit_code;
  };
  const std::vector<std::string> render = {"model.tgz", "--render", "a.png", "--backend", "cpu"};
  const auto with = [&render](std::vector<std::string> more) {
    more.insert(more.begin(), render.begin(), render.end());
    return more;
  };
  const std::vector<Case> cases = {
      {{}, 5},  // a window, and there is no display
      {{"--render", "a.png"}, 1},
      {{"--list-cameras"}, 1},
      {{"--follow"}, 1},
      {{"model.tgz", "--unknown"}, 1},
      {with({"--show", "colour"}), 1},
      {with({"--textures", "on"}), 1},
      {with({"--intersection", "mesh"}), 1},
      {with({"--outside", "skip"}), 1},
      {with({"--size", "0x7"}), 1},
      {with({"--background", "red"}), 1},
      {with({"--camera", "3"}), 1},
      {with({"--script", "s.txt"}), 1},
      {{"model.tgz", "--render", "a.png", "--backend", "metal"}, 1},
      {{"model.tgz", "--render", "a.bmp"}, 1},
      {{"model.tgz", "--backend", "metal"}, 1},
      {{"missing.tgz", "--render", "a.png"}, 2},
      {{"folder", "--render", "a.png"}, 2},
      {with({"--camera", "missing.json"}), 2},
      {{"short.tgz", "--render", "a.png"}, 3},
      {{"empty.tgz", "--render", "a.png"}, 3},
      {{"text.ply", "--render", "a.png"}, 3},
      {{"short.tgz"}, 3},
      {with({"--camera", "bad.json"}), 3},
      {with({"--camera", "none.json"}), 3},
      {with({"--camera", "no.json"}), 3},
      {{"model.tgz", "--render", "no/such/folder/a.png", "--backend", "cpu"}, 4},
      {{"model.tgz", "--render", "folder/../folder/x/a.exr", "--backend", "cpu"}, 4},
  };
  for (const Case& wrong : cases) {
    const ProcessResult result = shop.tgview(wrong.arguments);
    std::string line;
    for (const std::string& word : wrong.arguments) line += " " + word;
    INFO("tgview" << line << "\n" << result.err);
    CHECK(result.exit_code == wrong.exit_code);
    if (wrong.exit_code != 1) CHECK(std::count(result.err.begin(), result.err.end(), '\n') == 1);
    CHECK_FALSE(result.err.empty());
    CHECK_FALSE(std::filesystem::exists(shop / "a.png"));
  }
}

TEST_CASE("the flag --serve is refused without one model, with other outputs and where nothing can listen") {
  const Workshop shop;
  test::writeSample(shop / "model.tgz");
  for (const std::vector<std::string>& wrong : {std::vector<std::string>{"--serve", "0"},
                                                {"model.tgz", "model.tgz", "--serve", "0"},
                                                {"model.tgz", "--serve", "0", "--render", "a.png"},
                                                {"model.tgz", "--serve", "0", "--inspect", "1,1"},
                                                {"model.tgz", "--serve", "0", "--show", "depth"},
                                                {"model.tgz", "--serve", "0", "--exposure", "1"},
                                                {"model.tgz", "--serve", "0", "--size", "9x9"},
                                                {"model.tgz", "--serve", "0", "--no-session"},
                                                {"model.tgz", "--serve", "here"},
                                                {"model.tgz", "--serve", "0", "--serve-token", "short"},
                                                {"model.tgz", "--serve-token", "long-enough"}}) {
    const ProcessResult result = shop.tgview(wrong);
    INFO(result.err);
    CHECK(result.exit_code == 1);
    CHECK(contains(result.err, "--serve"));
    CHECK(result.out.empty());
  }
  CHECK(shop.tgview({"missing.tgz", "--serve", "0"}).exit_code == 2);
  CHECK(shop.tgview({"model.tgz", "--serve", "192.0.2.1:80"}).exit_code == 5);
}
