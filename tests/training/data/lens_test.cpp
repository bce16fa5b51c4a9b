// SPDX-License-Identifier: Apache-2.0
// Lens models against values of COLMAP and OpenCV, their inverse, and photographs of a known pattern.
#include "training/data/lens.h"

#include <cmath>
#include <limits>

#include "core/system/error.h"
#include "support/catch.h"

using tg::Camera;
using tg::Image;
using tg::Lens;
using tg::Undistortion;

namespace {

struct NamedLens {
  Lens lens;
  glm::dvec2 first, second;  // where (0.3, -0.2) and (-0.5, 0.4) go
};

// COLMAP's Camera.img_from_cam (pycolmap 3.x); OpenCV's projectPoints and fisheye.projectPoints give the same digits
// for all but FOV and THIN_PRISM_FISHEYE, which it does not have.
std::vector<NamedLens> lenses() {
  return {
      {{.model = "SIMPLE_RADIAL", .radial = {-0.1}}, {0.2961, -0.1974}, {-0.4795, 0.3836}},
      {{.model = "RADIAL", .radial = {0.05, 0.08}}, {0.3023556, -0.2015704}, {-0.516974, 0.4135792}},
      {{.model = "OPENCV", .radial = {-0.12, 0.03}, .tangential = {0.002, -0.003}},
       {0.2943021, -0.1962014},
       {-0.4814515, 0.3849972}},
      {{.model = "FULL_OPENCV",
        .radial = {0.3, 0.2, 0.05},
        .radial_divisor = {0.4, 0.1, 0.02},
        .tangential = {0.001, -0.002}},
       {0.296058787, -0.197415858},
       {-0.492863467, 0.394044774}},
      {{.model = "OPENCV_FISHEYE", .fisheye = true, .radial = {0.02, -0.01, 0.003, 0.001}},
       {0.288578285, -0.192385523},
       {-0.447199644, 0.357759715}},
      {{.model = "RADIAL_FISHEYE", .fisheye = true, .radial = {0.02, -0.01}},
       {0.288576743, -0.192384495},
       {-0.447149186, 0.357719349}},
      {{.model = "FOV", .fov = 0.9}, {0.309884754, -0.206589836}, {-0.48066183, 0.384529464}},
      {{.model = "THIN_PRISM_FISHEYE",
        .fisheye = true,
        .radial = {0.02, -0.01, 0.003, 0.001},
        .tangential = {0.002, -0.003},
        .thin_prism = {0.004, -0.005}},
       {0.287979543, -0.192265775},
       {-0.44869491, 0.358242314}},
  };
}

Camera camera(int width = 96, int height = 64) {
  Camera c;
  c.size = {width, height};
  c.focal = {80, 78};
  c.center = {47.5, 33};
  return c;
}

// Smooth enough for pixels to show it: a photograph of the plane's point.
double pattern(glm::dvec2 plane, int channel) {
  return 0.5 + 0.2 * std::sin(9 * plane.x + channel) + 0.2 * std::cos(8 * plane.y - 2 * channel);
}

// What the lens's camera takes of the pattern; black where no point of the plane lands.
Image photograph(const Lens& lens, const Camera& of, int channels) {
  Image image(of.size.x, of.size.y, channels);
  const double valid_radius = lens.validRadius();
  for (int y = 0; y < of.size.y; ++y) {
    for (int x = 0; x < of.size.x; ++x) {
      const auto plane = lens.undistort(glm::dvec2(ray(of, {x + 0.5, y + 0.5})), valid_radius);
      for (int c = 0; plane && c < channels; ++c) image.at(x, y, c) = static_cast<float>(pattern(*plane, c));
    }
  }
  return image;
}

}  // namespace

TEST_CASE("lens models put points where COLMAP and OpenCV do", "[lens]") {
  for (const NamedLens& named : lenses()) {
    INFO(named.lens.model);
    const glm::dvec2 first = named.lens.distort({0.3, -0.2});
    const glm::dvec2 second = named.lens.distort({-0.5, 0.4});
    CHECK(glm::length(first - named.first) < 2e-9);
    CHECK(glm::length(second - named.second) < 2e-9);
    CHECK_FALSE(named.lens.isPinhole());
  }
  CHECK(Lens{.model = "OPENCV"}.isPinhole());
  CHECK_FALSE(Lens{.model = "OPENCV_FISHEYE", .fisheye = true}.isPinhole());
}

TEST_CASE("undistorting inverts distorting, to the edge of what the lens can show", "[lens]") {
  for (const NamedLens& named : lenses()) {
    INFO(named.lens.model);
    const double valid_radius = named.lens.validRadius();
    for (double r = 0; r < std::min(1.2, 0.95 * valid_radius); r += 0.1) {
      for (double angle = 0; angle < 6.2; angle += 0.7) {
        const glm::dvec2 plane(r * std::cos(angle), r * std::sin(angle));
        const auto again = named.lens.undistort(named.lens.distort(plane), valid_radius);
        REQUIRE(again);
        CHECK(glm::length(*again - plane) < 1e-6);
      }
    }
  }
  // r (1 - 0.3 r^2) turns back at r = 1 / sqrt(0.9); farther out than its value there, nothing lands.
  const Lens folding{.model = "SIMPLE_RADIAL", .radial = {-0.3}};
  CHECK(std::abs(folding.validRadius() - 1 / std::sqrt(0.9)) < 2e-3);
  CHECK(folding.undistort({0.69, 0}, folding.validRadius()));
  CHECK_FALSE(folding.undistort({0.72, 0}, folding.validRadius()));
  const Lens fisheye{.model = "OPENCV_FISHEYE", .fisheye = true};
  CHECK_FALSE(fisheye.undistort({2.0, 0}, fisheye.validRadius()));  // behind the camera
}

TEST_CASE("an undistorted photograph is the pinhole's, in every model and kind of image", "[lens]") {
  for (const NamedLens& named : lenses()) {
    INFO(named.lens.model);
    for (const int channels : {1, 3, 4}) {
      const Undistortion undistortion(named.lens, camera(), "a.png");
      const Camera& pinhole = undistortion.pinhole;
      Image image = photograph(named.lens, camera(), channels);
      for (std::size_t i = 3; channels == 4 && i < image.data.size(); i += 4) image.data[i] = 0.5f;
      const Undistortion::Result result = undistortion.apply(image, {});
      REQUIRE(result.image.width == pinhole.size.x);
      REQUIRE(result.image.height == pinhole.size.y);
      REQUIRE(result.image.channels == channels);
      double worst = 0;
      std::size_t hidden = 0;
      for (int y = 0; y < pinhole.size.y; ++y) {
        for (int x = 0; x < pinhole.size.x; ++x) {
          const bool shows = result.mask[static_cast<std::size_t>(y) * pinhole.size.x + x] != 0;
          hidden += !shows;
          // Two pixels from the border, whose neighbours are all there.
          if (!shows || x < 2 || y < 2 || x >= pinhole.size.x - 2 || y >= pinhole.size.y - 2) continue;
          const glm::dvec2 plane(ray(pinhole, {x + 0.5, y + 0.5}));
          for (int c = 0; c < std::min(channels, 3); ++c) {
            worst = std::max(worst, std::abs(result.image.at(x, y, c) - pattern(plane, c)));
          }
          if (channels == 4) worst = std::max(worst, std::abs(result.image.at(x, y, 3) - 0.5));
        }
      }
      CHECK(worst < 1.5e-3);
      CHECK(hidden <= result.mask.size() / 100);  // corners at most
      // The pose and the scale are the photograph's; pixels stay on its grid.
      CHECK(pinhole.focal.x == camera().focal.x);
      CHECK(pinhole.center.x + undistortion.origin.x == camera().center.x);
      CHECK(pinhole.center.y + undistortion.origin.y == camera().center.y);
    }
  }
}

TEST_CASE("a barrel lens gives a larger picture, a pincushion a smaller one, a weak one the same pixels", "[lens]") {
  const Undistortion barrel({.model = "OPENCV", .radial = {-0.2}}, camera(), "a.png");
  CHECK(barrel.pinhole.size.x > 98);
  CHECK(barrel.origin.x < 0);
  const Undistortion pincushion({.model = "OPENCV", .radial = {0.2}}, camera(), "a.png");
  CHECK(pincushion.pinhole.size.x < 94);
  CHECK(pincushion.origin.x > 0);
  const Undistortion weak({.model = "OPENCV", .radial = {1e-12}}, camera(), "a.png");
  CHECK(weak.pinhole.size.x == 96);
  CHECK(weak.pinhole.size.y == 64);
  const Image image = photograph({}, camera(), 3);
  const Undistortion::Result result = weak.apply(image, {});
  for (std::size_t i = 0; i < image.data.size(); ++i) REQUIRE(std::abs(result.image.data[i] - image.data[i]) < 1e-6);
  // A fisheye that sees nearly half a sphere: at most half a picture is added at each end.
  Camera wide = camera();
  wide.focal.x = wide.focal.y = 32;
  const Undistortion fisheye({.model = "OPENCV_FISHEYE", .fisheye = true}, wide, "a.png");
  CHECK(fisheye.pinhole.size.x <= 192);
  CHECK(fisheye.pinhole.size.y <= 128);
  CHECK(fisheye.pinhole.size.x > 150);
}

TEST_CASE("undistorting hides what masks hide and what no photograph shows", "[lens]") {
  const Undistortion undistortion({.model = "OPENCV", .radial = {0.15}}, camera(), "a.png");
  const Image image(96, 64, 3, 0.5f);
  std::vector<std::uint8_t> mask(96 * 64, 255);
  for (std::size_t y = 0; y < 64; ++y) {
    for (std::size_t x = 0; x < 30; ++x) mask[y * 96 + x] = 0;
  }
  const Undistortion::Result result = undistortion.apply(image, mask);
  const int row = undistortion.pinhole.size.y / 2;
  const auto counts = [&](int x) {
    return result.mask[static_cast<std::size_t>(row) * undistortion.pinhole.size.x + x] != 0;
  };
  // The mask's edge at x = 30 lies at (30 - cx) / fx = r (1 + 0.15 r^2) on the plane.
  const double edge = undistortion.lens.undistort({(30 - 47.5) / 80, 0}, undistortion.valid_radius)->x;
  const int pixel = static_cast<int>(std::floor(edge * 80 + undistortion.pinhole.center.x));
  CHECK_FALSE(counts(pixel - 1));
  CHECK(counts(pixel + 2));

  // Half of the pixels that this lens adds show nothing: their corners lie beyond the photograph.
  Camera narrow = camera();
  narrow.focal.x = narrow.focal.y = 40;
  const Undistortion folding({.model = "SIMPLE_RADIAL", .radial = {-0.3}}, narrow, "a.png");
  const Undistortion::Result corners = folding.apply(image, {});
  CHECK(corners.mask[0] == 0);
  CHECK(corners.mask[corners.mask.size() / 2 + static_cast<std::size_t>(folding.pinhole.size.x / 2)] == 255);
}

TEST_CASE("what a mask hides is nowhere in the pixels that count", "[lens]") {
  const Undistortion undistortion({.model = "OPENCV", .radial = {-0.15}}, camera(), "a.png");
  std::vector<std::uint8_t> mask(96 * 64, 255);
  Image black(96, 64, 3, 0.5f), white = black;
  for (int y = 0; y < 64; ++y) {
    for (int x = 24; x < 40; ++x) {
      mask[static_cast<std::size_t>(y) * 96 + static_cast<std::size_t>(x)] = 0;
      for (int c = 0; c < 3; ++c) {
        black.at(x, y, c) = 0.0f;
        white.at(x, y, c) = 1.0f;
      }
    }
  }
  const Undistortion::Result a = undistortion.apply(black, mask), b = undistortion.apply(white, mask);
  REQUIRE(a.mask == b.mask);
  int counted = 0, differ = 0;
  for (std::size_t i = 0; i < a.mask.size(); ++i) {
    if (a.mask[i] == 0) continue;
    ++counted;
    differ += a.image.data[3 * i] != b.image.data[3 * i];
  }
  CHECK(counted > 3000);
  CHECK(differ == 0);
}

TEST_CASE("an implausible lens is refused with what would remain", "[lens]") {
  const auto refused = [](const Lens& lens, const Camera& seen_by = camera()) {
    try {
      const Undistortion undistortion(lens, seen_by, "a.png");
      return std::to_string(undistortion.pinhole.size.x);
    } catch (const tg::Error& error) {
      return std::string(error.what());
    }
  };
  CHECK_THAT(refused({.model = "OPENCV", .radial = {1e6}}),
             Contains("a.png: the lens distortion (OPENCV) is implausible (expected that undistorting keeps at least a "
                      "fifth of 96 x 64 pixels a side, found "));
  CHECK_THAT(refused({.model = "FOV", .fov = 4.0}), Contains("a.png: the lens distortion (FOV) is implausible"));
  Camera aside = camera();
  aside.center.y = 6e9;  // more pixels away than an int counts
  CHECK_THAT(refused({.model = "OPENCV", .radial = {32, 2}, .tangential = {0, 1}}, aside),
             Catch::Matchers::EndsWith(" x 0)"));
  for (const double value : {1e300, -1e300, std::numeric_limits<double>::max()}) {
    const Lens extreme{.model = "FULL_OPENCV",
                       .radial = {value, -value, value, value},
                       .radial_divisor = {-value, value, value},
                       .tangential = {value, value}};
    CHECK_THAT(refused(extreme), Contains("implausible") || Contains("1"));
  }
}
