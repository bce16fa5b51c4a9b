// SPDX-License-Identifier: Apache-2.0
// Pages that stream a scene beside them: what stands in them, and what reads them. What a browser shows: tests/web.
#include <fstream>
#include <string>

#include "converter/convert.h"
#include "converter/glb.h"
#include "converter/html/html.h"
#include "converter/lod/lod_scene.h"
#include "converter/scenes.h"
#include "converter/scratch.h"
#include "core/bundle/bundle.h"
#include "core/system/error.h"
#include "support/catch.h"

using namespace tg;

namespace {

// The address in a page.
std::string addressIn(const std::filesystem::path& page) {
  const std::string text = Glb::slurp(page);
  const std::size_t tag = text.find(kHtmlStreamTag);
  REQUIRE(tag != std::string::npos);
  for (const char* word : {"@TITLE@", "@BYTES@", "@PAYLOAD@"}) CHECK(text.find(word) == std::string::npos);
  const std::size_t begin = tag + kHtmlStreamTag.size() + 1;
  return text.substr(begin, text.find('"', begin) - begin);
}

}  // namespace

TEST_CASE("a streaming page names its scene by a relative address, whatever letters are in it") {
  const Scratch scratch;
  const std::filesystem::path page = scratch.folder() / "a & <b>.html";
  for (const auto& [scene, address] :
       {std::pair("lod-meta.json", "lod-meta.json"), std::pair("fox/lod-meta.json", "fox/lod-meta.json"),
        std::pair("a b/\"</script>\\#?%:lod-meta.json", "a%20b/%22%3C/script%3E%5C%23%3F%25%3Alod-meta.json"),
        std::pair("../up/./x/../lod-meta.json", "../up/lod-meta.json"),
        std::pair("\xc3\xa9/lod-meta.json", "%C3%A9/lod-meta.json")}) {
    writeStreamingHtml(page, addressFrom(page, scratch.folder() / scene));
    CHECK(addressIn(page) == address);
  }
  CHECK(Glb::slurp(page).find("<title>a &amp; &lt;b></title>") != std::string::npos);
  CHECK_THROWS_WITH(readHtmlGlb(page),
                    Catch::Matchers::EndsWith("the page holds no model, but streams one: read its lod-meta.json"));
}

TEST_CASE("a scene with levels becomes a page that streams it, an edited one a page that holds it") {
  const Scratch scratch;
  const test::TestScene scene = test::makeScene(test::SceneKind::ordinary, 61, 300);
  Bundle source;
  source.model = scene.model;
  source.cameras = {scene.camera};
  writeBundle(scratch.folder() / "model.tgz", source);
  const std::filesystem::path meta = scratch.folder() / "out/lod-meta.json", page = scratch.folder() / "out/page.html";
  convert(scratch.folder() / "model.tgz", meta, {.measure = Measure::never});

  const ConvertReport forecast = convert(meta, page, {.dry_run = true});
  CHECK(!std::filesystem::exists(page));
  const ConvertReport report = convert(meta, page);
  CHECK(report.gaussians == 300);
  CHECK(report.cameras == 1);
  CHECK(report.output_bytes == std::filesystem::file_size(page));
  CHECK(report.output_bytes == forecast.output_bytes);
  REQUIRE(report.warnings.size() == 1);
  CHECK(report.warnings.front() ==
        "the page holds no model: it streams lod-meta.json from the server that both lie on");
  CHECK(addressIn(page) == "lod-meta.json");
  CHECK_THROWS_AS(convert(meta, page), Error);  // it exists
  const std::filesystem::path link = scratch.folder() / "page.html";
  std::filesystem::create_symlink("out/page.html", link);
  CHECK_THROWS_WITH(convert(meta, link, {.overwrite = true}), Contains("is a symbolic link into another folder"));

  const ConvertReport whole = convert(meta, page, {.overwrite = true, .measure = Measure::never, .steps = 1.0f});
  CHECK(whole.output_bytes > report.output_bytes);
  CHECK(!readHtmlGlb(page).empty());

  std::ofstream(meta, std::ios::trunc) << "{\"lodLevels\": 1";
  CHECK_THROWS_AS(convert(meta, page, {.overwrite = true}), Error);
  CHECK(!readHtmlGlb(page).empty());  // what was there stays
}
