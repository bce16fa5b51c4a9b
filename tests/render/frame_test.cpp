// SPDX-License-Identifier: Apache-2.0
// The outputs of a frame by name, as numbers and as pictures.
#include "core/system/error.h"
#include "render/renderer.h"
#include "support/catch.h"

using namespace tg;

namespace {

constexpr Output kOutputs[] = {Output::final, Output::base,   Output::texture, Output::alpha,
                               Output::depth, Output::normal, Output::count};

// Two pixels: one that two splats cover, one that is empty.
Frame twoPixels() {
  Frame frame(2, 1);
  frame.base = {{0.5f, 0.25f, 1.5f}, {0.0f, 0.0f, 0.0f}};
  frame.texture = {{0.25f, -0.5f, 0.0f}, {0.0f, 0.0f, 0.0f}};
  frame.alpha = {0.75f, 0.0f};
  frame.depth = {4.0f, 0.0f};
  frame.normal = {{0.0f, -0.5f, -0.5f}, {0.0f, 0.0f, 0.0f}};
  frame.count = {2.0f, 0.0f};
  return frame;
}

// The defaults but for one member.
template <typename T>
RenderSettings with(T RenderSettings::* member, T value) {
  RenderSettings settings;
  settings.*member = value;
  return settings;
}

std::vector<float> firstPixel(const Image& image) { return {image.data.begin(), image.data.begin() + image.channels}; }

}  // namespace

TEST_CASE("outputs are found by their names and by no others") {
  for (const Output output : valuesOf<Output>()) CHECK(parse<Output>(name(output)) == output);
  CHECK(name(Output::depthMedian) == "depth-median");
  CHECK(name(Output::texelDensity) == "texel-density");
  CHECK(parse<SplatOrder>("per-pixel") == SplatOrder::perPixel);
  CHECK(parse<TextureFilter>("footprint") == TextureFilter::footprint);
  CHECK(parse<Antialiasing>("screen") == Antialiasing::screen);
  CHECK_FALSE(parse<SplatOrder>("perPixel"));
  CHECK(name(Output::final) == "final");
  CHECK(name(Output::count) == "count");
  for (const char* text : {"", "Final", "final ", "rgb"}) CHECK_FALSE(parse<Output>(text));
}

TEST_CASE("extract gives the numbers as they are") {
  const Frame frame = twoPixels();
  CHECK(firstPixel(extract(frame, Output::final)) == std::vector<float>{0.75f, -0.25f, 1.5f});
  CHECK(firstPixel(extract(frame, Output::base)) == std::vector<float>{0.5f, 0.25f, 1.5f});
  CHECK(firstPixel(extract(frame, Output::texture)) == std::vector<float>{0.25f, -0.5f, 0.0f});
  CHECK(firstPixel(extract(frame, Output::normal)) == std::vector<float>{0.0f, -0.5f, -0.5f});
  CHECK(extract(frame, Output::alpha).data == frame.alpha);
  CHECK(extract(frame, Output::depth).data == frame.depth);
  CHECK(extract(frame, Output::count).data == frame.count);
}

TEST_CASE("visualize gives pictures between 0 and 1") {
  const Frame frame = twoPixels();
  for (Output output : kOutputs) {
    const Image image = visualize(frame, output);
    CHECK(image.channels == 3);
    for (float value : image.data) CHECK((value >= 0.0f && value <= 1.0f));
  }
  CHECK(firstPixel(visualize(frame, Output::final)) == std::vector<float>{0.75f, 0.0f, 1.0f});
  CHECK(firstPixel(visualize(frame, Output::texture)) == std::vector<float>{0.625f, 0.25f, 0.5f});
  CHECK(firstPixel(visualize(frame, Output::alpha)) == std::vector<float>{0.75f, 0.75f, 0.75f});
  // y up, z to the viewer
  CHECK(firstPixel(visualize(frame, Output::normal)) == std::vector<float>{0.5f, 0.75f, 0.75f});
  CHECK(firstPixel(visualize(frame, Output::count)) == std::vector<float>{1.0f, 1.0f, 1.0f});
}

TEST_CASE("exposure brightens the colours before they are clamped, and nothing else") {
  const Frame frame = twoPixels();
  const RenderSettings darker = with(&RenderSettings::exposure, -1.0f);
  const RenderSettings brighter = with(&RenderSettings::exposure, 1.0f);
  CHECK(firstPixel(visualize(frame, Output::base, darker)) == std::vector<float>{0.25f, 0.125f, 0.75f});
  CHECK(firstPixel(visualize(frame, Output::final, brighter)) == std::vector<float>{1.0f, 0.0f, 1.0f});
  CHECK(firstPixel(visualize(frame, Output::texture, brighter)) == firstPixel(visualize(frame, Output::texture)));
}

TEST_CASE("gain is on the colour of textures, and on nothing else") {
  const Frame frame = twoPixels();
  const RenderSettings twice = with(&RenderSettings::gain, 2.0f);
  CHECK(firstPixel(visualize(frame, Output::texture, twice)) == std::vector<float>{0.75f, 0.0f, 0.5f});
  for (const Output output : kOutputs) {
    if (output != Output::texture) CHECK(visualize(frame, output, twice).data == visualize(frame, output).data);
  }
}

TEST_CASE("percentiles of what is there span the colours, and the scale says which numbers they are") {
  Frame frame(101, 1, {Output::depth, Output::count});
  for (int i = 1; i <= 100; ++i) frame.depth[i] = frame.count[i] = static_cast<float>(i == 100 ? 1000 : i);
  const RenderSettings settings = with(&RenderSettings::range, PercentRange{10, 90});
  ValueScale scale;
  Image image = visualize(frame, Output::count, settings, &scale);
  CHECK(scale == ValueScale{11, 90, false, false});  // of the 100 numbers, those at places 10 and 89
  CHECK(image.at(90, 0, 2) == 1.0f);                 // white from the 90th on
  CHECK(image.at(11, 0, 0) == 0.0f);
  CHECK(image.at(50, 0, 0) > 0.0f);
  image = visualize(frame, Output::depth, settings, &scale);
  CHECK(scale == ValueScale{11, 90, false, true});
  CHECK(image.at(5, 0, 0) == 1.0f);
  CHECK(image.at(100, 0, 0) == Approx(0.15f));
  CHECK(image.at(0, 0, 0) == 0.0f);  // nothing was hit
  (void)visualize(frame, Output::count, {}, &scale);
  CHECK(scale == ValueScale{0, 1000, false, false});
}

TEST_CASE("numbers have the colours of the map asked for, and are black where nothing is") {
  Frame frame(3, 1, {Output::count, Output::depth, Output::texelDensity});
  frame.count = {0, 1, 2};
  frame.depth = {0, 3, 7};
  frame.texel_density = {0, 1.0f / 64, 4};
  const auto color = [](const Image& image, int x) {
    return glm::ivec3(glm::round(255.0f * glm::vec3(image.at(x, 0, 0), image.at(x, 0, 1), image.at(x, 0, 2))));
  };
  const RenderSettings turbo = with(&RenderSettings::colors, Colors::turbo);
  const RenderSettings viridis = with(&RenderSettings::colors, Colors::viridis);
  const RenderSettings grey = with(&RenderSettings::colors, Colors::grey);
  CHECK(color(visualize(frame, Output::count, turbo), 2) == glm::ivec3(122, 4, 3));
  CHECK(color(visualize(frame, Output::count, turbo), 0) == glm::ivec3(0));
  CHECK(color(visualize(frame, Output::count, viridis), 2) == glm::ivec3(253, 231, 37));
  CHECK(color(visualize(frame, Output::count, grey), 1) == glm::ivec3(128));
  CHECK(color(visualize(frame, Output::depth, viridis), 1) == glm::ivec3(253, 231, 37));  // near is bright
  CHECK(color(visualize(frame, Output::depth, viridis), 2) == glm::ivec3(68, 1, 84));
  CHECK(color(visualize(frame, Output::texelDensity, viridis), 1) == glm::ivec3(68, 1, 84));
  CHECK(color(visualize(frame, Output::texelDensity, viridis), 2) == glm::ivec3(253, 231, 37));
  for (const RenderSettings& settings : {turbo, viridis, grey, with(&RenderSettings::range, PercentRange{2, 98})}) {
    CHECK(mapsOnHost(Output::depth, settings));
    CHECK_FALSE(mapsOnHost(Output::final, settings));
  }
  CHECK_FALSE(mapsOnHost(Output::count, {}));
}

TEST_CASE("scales follow a frame's numbers for the outputs of kRangedOutputs alone") {
  for (const Output output : valuesOf<Output>()) {
    if (!kNumberOutputs.has(output)) continue;
    INFO(name(output));
    CHECK((ownScale(output, 1, 2) != ownScale(output, 3, 4)) == kRangedOutputs.has(output));
  }
}

TEST_CASE("a frame gives no output that it does not hold") {
  const Frame picture(2, 1, {Output::final});
  CHECK(extract(picture, Output::final).data == std::vector<float>(6, 0.0f));
  for (const Output output : {Output::base, Output::alpha, Output::overdraw, Output::centers}) {
    CHECK_THROWS_AS(extract(picture, output), Error);
    CHECK_THROWS_AS(visualize(picture, output), Error);
  }
}

TEST_CASE("texel density is shown by its logarithm on a fixed scale") {
  Frame frame(4, 1, {Output::texelDensity});
  frame.texel_density = {0.0f, 1.0f / 64, 0.25f, 4.0f};
  const Image image = visualize(frame, Output::texelDensity);
  CHECK(image.at(0, 0, 0) == 0.0f);
  CHECK(image.at(1, 0, 0) == 0.0f);
  CHECK(image.at(2, 0, 0) == 1.0f);
  CHECK(image.at(2, 0, 1) == Approx(0.5f));
  CHECK(image.at(3, 0, 2) == 1.0f);
}

TEST_CASE("a depth picture is brightest where it is near and black where nothing is") {
  Frame frame(3, 1);
  frame.depth = {2.0f, 6.0f, 0.0f};
  frame.count = {1.0f, 1.0f, 0.0f};
  const Image image = visualize(frame, Output::depth);
  CHECK(image.at(0, 0, 0) == 1.0f);
  CHECK(image.at(1, 0, 0) == Approx(0.15f));
  CHECK(image.at(2, 0, 0) == 0.0f);
  CHECK(firstPixel(visualize(Frame(1, 1), Output::depth)) == std::vector<float>{0.0f, 0.0f, 0.0f});
}
