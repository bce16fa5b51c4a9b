// SPDX-License-Identifier: Apache-2.0
// Files of the size, or with pictures as near to the source's, as somebody asked for.
#include "converter/convert.h"
#include "converter/gltf/meshopt.h"
#include "converter/scenes.h"
#include "converter/scratch.h"
#include "core/bundle/bundle.h"
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

TEST_CASE("targets that nothing reaches, or that a format has no steps for, are refused in words and write nothing") {
  const Scratch scratch;
  const auto from = source(scratch), to = scratch.folder() / "a.sog";
  const auto refusal = [&](const std::filesystem::path& path, const ConvertOptions& options) {
    return test::messageOf([&] { convert(from, path, options); }, ErrorKind::usage);
  };
  CHECK(refusal(to, {.target = {.bytes = 1000}}).starts_with("--target-size is out of reach (expected at least "));
  CHECK(refusal(to, {.target = {.psnr = 100}}).starts_with("--target-psnr is out of reach (expected at most "));
  CHECK(refusal(to, {.target = {.psnr = 100.04}}).ends_with(" dB, found 100.0)"));
  CHECK(refusal(scratch.folder() / "a.spz", {.target = {.bytes = 100000}})
            .ends_with("a target is only for .sog, .glb, .gltf and .html"));
  CHECK(!std::filesystem::exists(to));
}
