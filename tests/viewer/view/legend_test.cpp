// SPDX-License-Identifier: Apache-2.0
// Legends: which pictures have one, what it says, and that it stays where it belongs.
#include "viewer/view/legend.h"

#include "core/system/error.h"
#include "support/catch.h"

using namespace tg;

namespace {

// The defaults but for one member.
template <typename T>
RenderSettings with(T RenderSettings::* member, T value) {
  RenderSettings settings;
  settings.*member = value;
  return settings;
}

}  // namespace

TEST_CASE("pictures of numbers have a legend, the others none") {
  for (const Output output : valuesOf<Output>()) {
    INFO(name(output));
    const auto legend = legendOf(output, {}, {0, 1});
    CHECK(legend.has_value() == hasLegend(output));
    INFO("viewer/view/legend.cpp: a title in titleOf() for each output of kNumberOutputs (render/settings.h)");
    CHECK((!legend || !legend->title.empty()));
  }
  for (const CompareMode mode : valuesOf<CompareMode>()) {
    INFO(name(mode));
    CHECK(legendOf({.mode = mode}).has_value() == hasLegend(mode));
  }
}

TEST_CASE("a legend says the numbers at the ends and in the middle of its colours") {
  using Numbers = std::array<std::string, 3>;
  CHECK(legendOf(Output::depth, {}, {2, 6, false, true})->numbers == Numbers{"2", "4", "6"});
  CHECK(legendOf(Output::texelDensity, {}, ownScale(Output::texelDensity, 1, 1))->numbers ==
        Numbers{"0.0156", "0.25", "4"});  // the middle of a logarithmic scale
  CHECK(legendOf(Output::texture, with(&RenderSettings::gain, 4.0f), {})->numbers == Numbers{"-0.25", "0", "0.25"});
  CHECK(legendOf({.mode = CompareMode::difference, .gain = 5})->numbers == Numbers{"0", "0.1", "0.2"});
  CHECK(legendOf({.mode = CompareMode::difference, .gain = 5, .with_sign = true})->numbers[0] == "-0.2");
  CHECK(legendOf({.mode = CompareMode::flip})->numbers == Numbers{"0", "0.5", "1"});
}

TEST_CASE("a legend has the colours of its picture: near is bright") {
  const Legend depth = *legendOf(Output::depth, {}, {2, 6, false, true});
  CHECK(depth.color(0) == glm::vec3(1));
  CHECK(depth.color(1).x == Approx(0.15f));
  const Legend turbo = *legendOf(Output::depth, with(&RenderSettings::colors, Colors::turbo), {2, 6, false, true});
  CHECK(turbo.color(0).x > turbo.color(0).z);  // red ends the rainbow: near
}

TEST_CASE("a legend is drawn in the lower left corner and leaves the rest alone") {
  const Legend legend = *legendOf(Output::count, {}, {0, 12});
  const Image picture(400, 300, 3, 0.5f);
  const Image drawn = withLegend(picture, legend);
  REQUIRE(drawn.data.size() == picture.data.size());
  int changed = 0, bright = 0;
  for (int y = 0; y < 300; ++y) {
    for (int x = 0; x < 400; ++x) {
      const bool other = drawn.at(x, y, 0) != 0.5f || drawn.at(x, y, 2) != 0.5f;
      changed += other;
      bright += drawn.at(x, y, 2) == 1.0f;
      if (x >= 200 || y < 220) CHECK_FALSE(other);
    }
  }
  CHECK(changed > 5000);
  CHECK(bright > 200);  // letters and the bar's white end
  // A picture of four times the height has letters of four times the size.
  const Image large = withLegend(Image(1600, 1440, 3), legend);
  int large_bright = 0;
  for (std::size_t i = 2; i < large.data.size(); i += 3) large_bright += large.data[i] == 1.0f;
  CHECK(large_bright > 12 * bright);
  CHECK_THROWS_WITH(withLegend(Image(100, 300, 3), legend), Contains("--legend: the picture is too small"));
}
