// SPDX-License-Identifier: Apache-2.0
// Files of the size, or with pictures as near to the source's, as somebody asked for.
#include <algorithm>

#include "converter/convert.h"
#include "converter/edit/quality.h"
#include "converter/gltf/meshopt.h"
#include "converter/scenes.h"
#include "converter/scratch.h"
#include "core/bundle/bundle.h"
#include "core/model/fallback.h"
#include "core/model/verbs.h"
#include "core/system/error.h"
#include "support/catch.h"
#include "support/message_of.h"

using namespace tg;

namespace {

std::filesystem::path source(const Scratch& scratch) {
  Bundle bundle;
  const test::TestScene scene = test::makeScene(test::SceneKind::ordinary, 29, 2000);
  bundle.model = scene.model;
  bundle.cameras = {scene.camera};
  const auto path = scratch.folder() / "source.tgz";
  writeBundle(path, bundle);
  return path;
}

}  // namespace

TEST_CASE("a file of the size that is asked for is at most 2 % smaller") {
  const Scratch scratch;
  const auto [name, sizes] = GENERATE(
      table<std::string, std::vector<std::uint64_t>>({{"a.sog", {110000, 160000}}, {"a.glb", {170000, 250000}}}));
  TG_SKIP_IF(name == "a.glb" && !hasMeshopt() ? std::string(missingMeshopt()) : std::string());
  const auto from = source(scratch), to = scratch.folder() / name;
  for (const std::uint64_t bytes : sizes) {
    const ConvertReport report = convert(from, to, {.overwrite = true, .target = {.bytes = bytes}});
    CAPTURE(bytes, report.steps);
    CHECK(report.output_bytes <= bytes);
    CHECK(static_cast<double>(report.output_bytes) >= 0.98 * static_cast<double>(bytes));
    CHECK(std::filesystem::file_size(to) == report.output_bytes);
  }
}

TEST_CASE("the finest steps that fit a size are found where bytes jump from steps to steps, and at their end") {
  const Scratch scratch;
  const auto to = scratch.folder() / "a.sog";
  const auto converted = [&](std::uint64_t bytes) {
    return convert("docs/sample.tgz", to, {.overwrite = true, .measure = Measure::never, .target = {.bytes = bytes}});
  };
  for (const std::uint64_t bytes : {22'000, 25'000, 53'700, 100'000, 215'000}) {
    const ConvertReport report = converted(bytes);
    CAPTURE(bytes, report.steps);
    CHECK(report.output_bytes <= bytes);
    CHECK(static_cast<double>(report.output_bytes) >= 0.987 * static_cast<double>(bytes));
  }
  const ConvertReport finest = converted(1'000'000);
  CHECK(finest.steps == kLeastSteps);
  const std::string said = "the finest steps take " + std::to_string(finest.output_bytes) + " bytes";
  CHECK(std::ranges::count(finest.warnings, said) == 1);
  const ConvertReport exact = converted(finest.output_bytes);  // steps of 1/6 take more than those of 1/8
  CHECK(exact.steps == kLeastSteps);
  CHECK(std::ranges::count(exact.warnings, said) == 0);
  CHECK(converted(finest.output_bytes - 1).steps > kLeastSteps);
}

TEST_CASE("a search for a target says how many of its trials are done and leaves no file where its listener throws") {
  const Scratch scratch;
  const auto from = source(scratch), to = scratch.folder() / "a.sog";
  const Target target = GENERATE(Target{.bytes = 110000}, Target{.psnr = 30});
  std::vector<std::size_t> told;
  const auto listener = [&](ConvertPart part, std::size_t done, std::size_t steps) {
    CHECK(part == ConvertPart::target);
    CHECK(steps == (target.bytes > 0 ? 13 : 9));
    CHECK(done == told.size());
    told.push_back(done);
  };
  convert(from, to, {.target = target, .listener = listener});
  CHECK(told.back() >= 9);  // as soon as a size is near
  std::filesystem::remove(to);
  const auto ends = [](ConvertPart, std::size_t done, std::size_t) {
    if (done == 3) throw 5;
  };
  CHECK_THROWS_AS(convert(from, to, {.target = target, .listener = ends}), int);
  CHECK(!std::filesystem::exists(to));
}

TEST_CASE("pictures of the likeness that is asked for are hardly nearer") {
  const Scratch scratch;
  const std::string name = GENERATE("a.sog", "a.glb");
  TG_SKIP_IF(name == "a.glb" && !hasMeshopt() ? std::string(missingMeshopt()) : std::string());
  const auto from = source(scratch), to = scratch.folder() / name;
  for (const double psnr : {30.0, 40.0}) {
    const ConvertReport report = convert(from, to, {.overwrite = true, .target = {.psnr = psnr}});
    CAPTURE(psnr, report.steps);
    REQUIRE(report.textured_psnr);
    CHECK(*report.textured_psnr >= psnr);
    CHECK(*report.textured_psnr < psnr + 1);
  }
}

TEST_CASE("a small file of a textured model is as near to it as one without its textures") {
  const Scratch scratch;
  const std::string name = GENERATE("a.sog", "a.glb");
  TG_SKIP_IF(name == "a.glb" && !hasMeshopt() ? std::string(missingMeshopt()) : std::string());
  const bool sog = name == "a.sog";
  Bundle sample = readBundle("docs/sample.tgz"), bare = sample;
  std::vector<std::uint32_t> some;
  for (std::uint32_t i = 0; i < sample.model.size(); i += 10) some.push_back(i);
  sample.model = select(sample.model, some);
  bare.model = bakeFallback(sample.model, FallbackScale::fitted);
  sample.cameras = bare.cameras = {sample.cameras[0], sample.cameras[30]};
  const auto textured = scratch.folder() / "textured.tgz", plain = scratch.folder() / "plain.tgz";
  writeBundle(textured, sample);
  writeBundle(plain, bare);
  const std::vector<Camera> views = qualityViews(sample.model, sample.cameras);
  for (const std::uint64_t bytes :
       sog ? std::vector<std::uint64_t>{5000, 7000, 9000} : std::vector<std::uint64_t>{17000, 24000}) {
    const auto psnrOf = [&](const std::filesystem::path& from) {
      const auto to = scratch.folder() / name;
      const ConvertReport report = convert(
          from, to, {.overwrite = true, .measure = Measure::never, .cameras = false, .target = {.bytes = bytes}});
      CHECK(report.output_bytes <= bytes);
      return renderedPsnr(sample.model, readModel(to).model, views, sample.background);
    };
    CAPTURE(name, bytes);
    CHECK(psnrOf(textured) >= psnrOf(plain) - 0.1);
  }
}

TEST_CASE("a scene that the near plane would hide gets the steps that it gets at its usual size") {
  const Scratch scratch;
  const auto to = scratch.folder() / "a.sog";
  const auto stepsAt = [&](const std::string& scale) {
    const ConvertReport report =
        convert(source(scratch), to, {.overwrite = true, .target = {.psnr = 35}, .edits = {{"--scale", scale}}});
    REQUIRE(report.textured_psnr);
    CHECK(*report.textured_psnr >= 35);
    CHECK(*report.textured_psnr < 36);
    return static_cast<double>(report.steps.value());
  };
  CHECK(stepsAt("0.005") == Approx(stepsAt("1")).epsilon(0.05));  // the search ends at 2.5 %
}

TEST_CASE("nothing is compared, and no likeness found, where no camera has the model in its picture") {
  const Scratch scratch;
  Bundle bundle = readBundle(source(scratch));
  bundle.cameras[0].translation.z = -100;  // behind it
  const auto from = scratch.folder() / "behind.tgz", to = scratch.folder() / "a.sog";
  writeBundle(from, bundle);
  const ConvertReport report = convert(from, to);
  CHECK(report.views == 0);
  CHECK(!report.textured_psnr);
  CHECK(std::ranges::count(report.warnings, std::string(kShowsNothing) + ": they are not compared") == 1);
  const auto aimed = [&] { convert(from, to, {.overwrite = true, .target = {.psnr = 35}}); };
  CHECK(test::messageOf(aimed, ErrorKind::usage) == to.string() + ": --target-psnr: " + kShowsNothing);
}

TEST_CASE("an edit says where it leaves means so far out that floats are coarser than what they show") {
  const Scratch scratch;
  const auto from = source(scratch), to = scratch.folder() / "a.tgz";
  const auto warningsAt = [&](const std::string& x) {
    const ConvertReport report =
        convert(from, to, {.overwrite = true, .measure = Measure::never, .edits = {{"--translate", x + ",0,0"}}});
    return std::ranges::count_if(report.warnings, [](const std::string& warning) {
      return warning.starts_with("means lie ") && warning.ends_with(" apart, and are rounded to that");
    });
  };
  CHECK(warningsAt("1000") == 0);
  CHECK(warningsAt("4000000") == 1);
  CHECK(describe(readModel(to)).find("bounds: (400") == std::string::npos);  // not one number for both ends
  CHECK(describe(readModel(to)).find("bounds: (3999") != std::string::npos);
}

TEST_CASE("targets that nothing reaches, or that a format has no steps for, are refused in words and write nothing") {
  const Scratch scratch;
  const auto from = source(scratch), to = scratch.folder() / "a.sog";
  const auto refusal = [&](const std::filesystem::path& path, const ConvertOptions& options) {
    return test::messageOf([&] { convert(from, path, options); }, ErrorKind::usage);
  };
  const std::string named = to.string() + ": ";
  CHECK(refusal(to, {.target = {.bytes = 1000}})
            .starts_with(named + "--target-size is out of reach (expected at least "));
  CHECK(refusal(to, {.target = {.psnr = 100}}).starts_with(named + "--target-psnr is out of reach (expected at most "));
  CHECK(refusal(to, {.target = {.psnr = 100.04}}).ends_with(" dB, found 100.0)"));
  CHECK(refusal(scratch.folder() / "a.spz", {.target = {.bytes = 100000}})
            .ends_with("a target is only for .sog, .glb, .gltf and .html"));
  CHECK(!std::filesystem::exists(to));
}
