// SPDX-License-Identifier: Apache-2.0
// The reference against published numbers: single intersections, compositing, gradients (the conformance table of the
// method), each to half a unit of the last printed digit; and to 1e-12 against long double formulas written
// differently (inverse covariance instead of local frames).
#include <cmath>
#include <glm/gtc/constants.hpp>
#include <string>

#include "render/reference/reference.h"
#include "render/reference/splat.h"
#include "support/catch.h"

using namespace tg;

namespace {

constexpr double kC0 = 0.28209479177387814;

// Within `units` of the last digit that `text` prints; half a unit is rounding.
void checkPrinted(double value, const std::string& text, double units = 0.5) {
  const std::size_t point = text.find('.');
  const int digits = point == std::string::npos ? 0 : static_cast<int>(text.size() - point - 1);
  INFO("printed " << text << ", computed " << value);
  CHECK(std::abs(value - std::stod(text)) <= (units + 1e-4) * std::pow(10.0, -digits));
}
void checkPrinted(glm::dvec3 value, const std::string& x, const std::string& y, const std::string& z,
                  double units = 0.5) {
  checkPrinted(value.x, x, units);
  checkPrinted(value.y, y, units);
  checkPrinted(value.z, z, units);
}
// The table's colours were computed with the eight digits of C0 that 3DGS prints: 2e-9 of the colour.
constexpr double kEightDigitC0 = 0.6;

Camera tableCamera() {
  Camera camera;
  camera.size.x = camera.size.y = 64;
  camera.focal.x = camera.focal.y = 100;
  camera.center.x = camera.center.y = 32.5;
  return camera;
}

struct Gaussian {
  glm::dvec3 mean{0, 0, 5};
  glm::dvec4 rotation{1, 0, 0, 0};
  glm::dvec3 scale{0.5, 0.25, 0.01};
  double opacity = 0.8;
  glm::dvec3 sh{0.2, -0.1, 0.3};
};

glm::dvec4 aboutY(double degrees) {
  const double half = glm::radians(degrees) / 2;
  return {std::cos(half), 0, std::sin(half), 0};
}

void append(ReferenceModel& model, const Gaussian& g, std::uint16_t size = 4) {
  model.mean.push_back(g.mean);
  model.rotation.push_back(g.rotation);
  model.log_scale.push_back(glm::log(g.scale));
  model.opacity_logit.push_back(g.opacity < 1 ? std::log(g.opacity / (1 - g.opacity)) : 1e3);
  model.sh.push_back(g.sh);
  model.rects.push_back({static_cast<std::uint32_t>(model.texels.size()), size, size});
  for (int v = 0; v < size; ++v) {
    for (int u = 0; u < size; ++u) model.texels.push_back({0.1 * u, 0.2 * v, 0.05 * (u + v), 1 - 0.1 * u - 0.05 * v});
  }
}

ReferenceModel single(const Gaussian& g, IntersectionModel intersection) {
  ReferenceModel model;
  model.texture_mode = TextureMode::rgba;
  model.intersection = intersection;
  append(model, g);
  return model;
}

RenderSettings whiteBackground() {
  RenderSettings settings;
  settings.background = glm::vec3(1.0f);
  return settings;
}

struct Pixel {
  int x, y;
};

// The only hit at a pixel, with the cut at 1/255 off; fails when there is none.
ReferenceHit hitAt(const ReferenceModel& model, Pixel pixel) {
  const auto hits = traceReference(model, tableCamera(), {}, pixel.x + 0.5, pixel.y + 0.5, {.cutoffs = false});
  REQUIRE(hits.size() == 1);
  return hits[0];
}
bool isDrawn(const ReferenceModel& model, Pixel pixel) {
  return !traceReference(model, tableCamera(), {}, pixel.x + 0.5, pixel.y + 0.5).empty();
}

// A row of the table; empty strings are not printed there.
struct Row {
  const char *t, *u, *v, *value, *texel_u, *texel_v, *texture_alpha, *alpha;
};
void checkRow(const ReferenceHit& hit, const Row& row) {
  const std::pair<double, const char*> columns[] = {{hit.t, row.t},
                                                    {hit.u, row.u},
                                                    {hit.v, row.v},
                                                    {hit.value, row.value},
                                                    {hit.texel_u, row.texel_u},
                                                    {hit.texel_v, row.texel_v},
                                                    {hit.texture_alpha, row.texture_alpha},
                                                    {hit.alpha, row.alpha}};
  for (const auto& [value, text] : columns) {
    if (*text) checkPrinted(value, text);
  }
}

// The same numbers by another road: x on the ray o + t d with the camera at the origin, the inverse covariance
// Q = R diag(1/s^2) R^T, all in long double.
struct LongHit {
  long double t, u, v, value;
};
LongHit longHit(const Gaussian& g, Pixel pixel, IntersectionModel model) {
  using Vec = glm::vec<3, long double>;
  const glm::vec<4, long double> q = glm::vec<4, long double>(g.rotation) /
                                     std::sqrt(static_cast<long double>(glm::dot(
                                         glm::vec<4, long double>(g.rotation), glm::vec<4, long double>(g.rotation))));
  // Columns of R: each basis vector turned by v + 2 w (n x v) + 2 n x (n x v).
  const Vec n(q[1], q[2], q[3]);
  Vec axis[3];
  for (int k = 0; k < 3; ++k) {
    Vec e(0);
    e[k] = 1;
    axis[k] = e + 2.0L * q[0] * glm::cross(n, e) + 2.0L * glm::cross(n, glm::cross(n, e));
  }
  const Vec mean(g.mean);
  const Vec d((pixel.x + 0.5L - 32.5L) / 100.0L, (pixel.y + 0.5L - 32.5L) / 100.0L, 1.0L);
  const auto form = [&](Vec x, Vec y) {
    long double sum = 0;
    for (int k = 0; k < 3; ++k) {
      const long double s = g.scale[k];
      sum += glm::dot(axis[k], x) * glm::dot(axis[k], y) / (s * s);
    }
    return sum;
  };
  int c = 0;
  for (int k = 1; k < 3; ++k) {
    if (g.scale[k] < g.scale[c]) c = k;
  }
  const int a = c == 0 ? 1 : 0, b = c == 2 ? 1 : 2;
  LongHit hit;
  const bool plane = model == IntersectionModel::plane;
  hit.t = plane ? glm::dot(axis[c], mean) / glm::dot(axis[c], d) : form(d, mean) / form(d, d);
  const Vec x = hit.t * d - mean;
  hit.u = glm::dot(axis[a], x) / static_cast<long double>(g.scale[a]);
  hit.v = glm::dot(axis[b], x) / static_cast<long double>(g.scale[b]);
  hit.value = std::exp(-0.5L * (plane ? hit.u * hit.u + hit.v * hit.v : form(x, x)));
  return hit;
}

const Gaussian kA;
const Gaussian kE{.rotation = aboutY(90), .scale = {0.01, 0.25, 0.5}};
const Gaussian kF{.mean = {0.2, -0.1, 5}, .rotation = aboutY(45)};
const Gaussian kG{
    .mean = {0.3, -0.2, 4}, .rotation = {0.9, 0.2, -0.3, 0.1}, .scale = {0.4, 0.3, 0.05}, .opacity = 0.95};
const Gaussian kI{.rotation = aboutY(89)};
const Gaussian kJ{.rotation = aboutY(80), .scale = {0.5, 0.25, 0.2}};

constexpr auto kP = IntersectionModel::plane;
constexpr auto kM = IntersectionModel::maxResponse;

}  // namespace

// The Gaussian of the table, 3.1 sigma from its mean along u: (63.5 - 32.5) / 100 x 5 / 0.5, and 0 along v.
TEST_CASE("3.1 sigma from the mean a Gaussian shows its base, nothing, or the texture's border") {
  ReferenceModel model = single({}, IntersectionModel::plane);
  const Pixel beyond{63, 32};
  const ReferenceHit base = hitAt(model, beyond);
  // exp(-3.1^2 / 2), times the opacity 0.8.
  checkRow(base, {"5", "3.1", "0", "0.0081887", "0", "0", "1", "0.0065510"});
  CHECK(base.texture == glm::dvec3(0.0));
  CHECK(isDrawn(model, beyond));

  model.outside = TextureOutside::clip;
  CHECK(traceReference(model, tableCamera(), {}, 63.5, 32.5, {.cutoffs = false}).empty());
  CHECK(traceReference(model, tableCamera(), {}, 62.5, 32.5, {.cutoffs = false}).size() == 1);  // 3 sigma
  RenderSettings settings;
  settings.outside = TextureOutside::base;
  CHECK(traceReference(model, tableCamera(), settings, 63.5, 32.5, {.cutoffs = false}).size() == 1);
  settings.textures = TextureMode::none;
  settings.outside = TextureOutside::clip;
  CHECK(traceReference(model, tableCamera(), settings, 63.5, 32.5, {.cutoffs = false}).size() == 1);

  // Texel 3 along u, half way between 1 and 2 along v: alpha 1 - 0.3 - 0.075.
  model.outside = TextureOutside::edge;
  const ReferenceHit edge = hitAt(model, beyond);
  checkRow(edge, {"5", "3.1", "0", "0.0081887", "3", "1.5", "0.625", "0.0040944"});
  checkPrinted(edge.texture, "0.3", "0.3", "0.225");

  model.rects[0] = {};
  for (const TextureOutside outside : valuesOf<TextureOutside>()) {
    model.outside = outside;
    checkRow(hitAt(model, beyond), {"5", "3.1", "0", "0.0081887", "0", "0", "1", "0.0065510"});
  }
}

TEST_CASE("the reference meets every intersection of the conformance table") {
  checkPrinted(hitAt(single(kA, kP), {32, 32}).base, "0.556418958", "0.471790521", "0.584628437", kEightDigitC0);
  for (auto model : {kP, kM}) {
    checkRow(hitAt(single(kA, model), {32, 32}), {"5", "0", "0", "1", "1.5", "1.5", ".775", ".62"});
  }
  const Row b_plane{"5", "1", "1", ".367879441171", "2", "2", ".7", ".206012487056"};
  checkRow(hitAt(single(kA, kP), {42, 37}), b_plane);
  checkRow(hitAt(single(kA, kM), {42, 37}), {"4.999960000", ".999992000", ".999992000", ".367882384195", "1.999996",
                                             "1.999996", ".700000600", ".206014311731"});
  checkRow(hitAt(single(kA, kP), {62, 32}), {"5", "3", "0", ".011108996538", "3", "1.5", ".625", ".005554498269"});
  CHECK(isDrawn(single(kA, kP), {62, 32}));
  const ReferenceHit d = hitAt(single(kA, kP), {63, 32});
  checkRow(d, {"5", "3.1", "0", ".008188701014", "", "", "1", ".006550960811"});
  CHECK(d.texture == glm::dvec3(0.0));
  CHECK(isDrawn(single(kA, kP), {63, 32}));
  checkRow(hitAt(single(kE, kP), {42, 37}), b_plane);
  checkRow(hitAt(single(kF, kP), {40, 30}), {"4.814814815", ".523782801", ".014814815", ".871722664797", "1.761891",
                                             "1.507407", ".748440490", ".521946030419"});
  checkRow(hitAt(single(kF, kM), {40, 30}), {"4.814931836", ".523630547", ".014805453", ".871757484927", "1.761815",
                                             "1.507403", ".748448336", ".521972351405"});
  checkRow(hitAt(single(kG, kP), {45, 25}), {"4.116748166", ".628438264", "-.387632437", ".761399738172", "1.814219",
                                             "1.306184", ".753268898", ".544861804421"});
  checkRow(hitAt(single(kG, kM), {45, 25}), {"4.112408694", ".620749404", "-.390700520", ".762787771569", "1.810375",
                                             "1.304650", ".753730043", ".546189256707"});
  checkRow(hitAt(single(kI, kP), {33, 32}), {"3.178842406", "3.642870", "0", ".001313249", "", "", "1", ".001050599"});
  CHECK_FALSE(isDrawn(single(kI, kP), {33, 32}));
  checkRow(hitAt(single(kI, kM), {33, 32}),
           {"3.810371466", "2.380224698", "0", ".013096312303", "2.690112", "1.5", ".655988765", ".006872826988"});
  CHECK(isDrawn(single(kI, kM), {33, 32}));
  checkRow(hitAt(single(kJ, kP), {35, 32}), {"4.272998619", "1.476433", "0", ".336240921", "", "", "", ".188611882"});
  checkRow(hitAt(single(kJ, kM), {35, 32}), {"4.866889465", ".312884", "0", ".793758304", "", "", "", ".482195972"});
}

TEST_CASE("an opacity of nearly one is clamped to 0.99 and then has no gradient") {
  for (auto intersection : {kP, kM}) {
    ReferenceModel model = single({.opacity = 0.9999}, intersection);
    for (glm::dvec4& texel : model.texels) texel.a = 1.0;
    checkRow(hitAt(model, {32, 32}), {"5", "0", "0", "1", "1.5", "1.5", "1", ".99"});
    Camera camera = tableCamera();
    camera.center.x = camera.center.y = 0.5;
    camera.size.x = camera.size.y = 1;
    const glm::dvec3 v_color(1.0);
    const auto gradient = backwardReference(model, camera, {}, {&v_color, 1});
    CHECK(gradient.opacity_logit[0] == 0.0);
    CHECK(gradient.texels[5].a == 0.0);
    CHECK(gradient.texels[5].r > 0.0);
  }
}

TEST_CASE("a 2 x 2 texture is bilinear between its corners") {
  ReferenceModel model = single({.opacity = 1.0}, kP);
  model.rects[0] = {0, 2, 2};
  const glm::dvec4 on(1.0), off(0.0);
  model.texels = {on, off, off, on};
  checkRow(hitAt(model, {42, 32}), {"5", "1", "0", ".606530660", ".666667", ".5", ".5", ".303265330"});
}

TEST_CASE("every intersection agrees with long double inverse covariances to 1e-12") {
  const struct {
    Gaussian gaussian;
    Pixel pixel;
  } cases[] = {{kA, {32, 32}}, {kA, {42, 37}}, {kA, {62, 32}}, {kA, {63, 32}}, {kE, {42, 37}},
               {kF, {40, 30}}, {kG, {45, 25}}, {kI, {33, 32}}, {kJ, {35, 32}}};
  for (const auto& [gaussian, pixel] : cases) {
    for (auto model : {kP, kM}) {
      const ReferenceHit hit = hitAt(single(gaussian, model), pixel);
      const LongHit expected = longHit(gaussian, pixel, model);
      CHECK(std::abs(hit.t - expected.t) < 1e-12L);
      CHECK(std::abs(hit.u - expected.u) < 1e-12L);
      CHECK(std::abs(hit.v - expected.v) < 1e-12L);
      CHECK(std::abs(hit.value - expected.value) < 1e-12L);
      const bool inside = std::abs(expected.u) <= 3 && std::abs(expected.v) <= 3;
      const long double texel_u = (expected.u + 3) / 2, texel_v = (expected.v + 3) / 2;
      // The table's texture is affine, so bilinear look-up is exact.
      const long double factor = inside ? 1 - 0.1L * texel_u - 0.05L * texel_v : 1;
      CHECK(std::abs(hit.texture_alpha - factor) < 1e-12L);
      CHECK(std::abs(hit.alpha - static_cast<long double>(gaussian.opacity) * expected.value * factor) < 1e-12L);
    }
  }
  CHECK(std::abs(hitAt(single(kA, kP), {32, 32}).alpha - 0.62) < 1e-12);
  CHECK(std::abs(hitAt(single(kA, kP), {42, 37}).alpha - 0.8 * 0.7 * std::exp(-1.0L)) < 1e-12L);
}

TEST_CASE("two splats composite front to back over white") {
  ReferenceModel model = single(kA, kP);
  append(model,
         {.mean = {0, 0, 6}, .scale = {1, 1, 0.01}, .opacity = 0.6, .sh = (glm::dvec3(0.1, 0.2, 0.3) - 0.5) / kC0});
  const RenderSettings white = whiteBackground();
  const auto hits = traceReference(model, tableCamera(), white, 42.5, 37.5);
  REQUIRE(hits.size() == 2);
  checkPrinted(hits[0].alpha, ".206012487056");
  checkPrinted(hits[1].alpha, ".353343426801");
  checkPrinted(hits[0].base + hits[0].texture, ".756418958", ".871790521", ".784628437", kEightDigitC0);
  checkPrinted(hits[1].base + hits[1].texture, ".28", ".53", ".4725");
  checkPrinted(hits[1].transmittance, ".793987513");
  const auto frame = renderReference(model, tableCamera(), white);
  const std::size_t pixel = 37 * 64 + 42;
  checkPrinted(1.0 - frame.alpha[pixel], ".513437244283");
  checkPrinted(frame.color(pixel), ".74782307", ".84172862", ".80764050");
  CHECK(frame.count[pixel] == 2.0);
  const double weight[] = {hits[0].alpha, hits[1].transmittance * hits[1].alpha};
  CHECK(frame.depth[pixel] == Approx((weight[0] * 5 + weight[1] * 6) / (weight[0] + weight[1])).epsilon(1e-14));
  CHECK(frame.normal[pixel].z == Approx(-(weight[0] + weight[1])).epsilon(1e-14));

  // The colour behind the front splat includes textures: dL/d(alpha of the front), L the sum of the channels, read
  // back from dL/d(logit) = dL/d(alpha) G a_tex o (1 - o) of a picture that has this pixel alone.
  std::vector<glm::dvec3> v_color(64 * 64, glm::dvec3(0.0));
  v_color[pixel] = glm::dvec3(1.0);
  const auto gradient = backwardReference(model, tableCamera(), white, v_color);
  checkPrinted(gradient.opacity_logit[0] / (hits[0].alpha * 0.2), "0.019705252");
}

TEST_CASE("the gradients of case G are the published ones") {
  const struct {
    IntersectionModel model;
    const char *color[3], *transmittance, *mean[3], *log_scale[3], *rotation[4], *logit, *sh[3], *texel_21[4],
        *texel_12[4], *screen[2], *screen_abs;
  } tables[] = {
      {kP,
       {".857159504", ".854536760", ".858689319"},
       ".455138196",
       {"-2.288612132", "-.330238197", ".274402903"},
       {"-.417314682", "-.059760931", "0.000000000"},
       {"-.156723538", "-.219127510", "-.749220007", "-.398893164"},
       "-.042884951",
       {".153702677", ".307405355", ".461108032"},
       {".30780248", ".61560496", ".92340744", "-.643236422"},
       {".030993422", ".061986845", ".092980267", "-.064769128"},
       {"-2.929423529", "-.422704892"},
       "2.959763780"},
      {kM,
       {".856601522", ".854014792", ".858198159"},
       ".453810743",
       {"-2.265899762", "-.304466124", ".273254340"},
       {"-.405544975", "-.062551219", "-.006044463"},
       {"-.146536201", "-.215734362", "-.712395040", "-.386890584"},
       "-.043038721",
       {".154077145", ".308154289", ".462231434"},
       {".307774511", ".615549022", ".923323533", "-.643521441"},
       {".031552970", ".063105940", ".094658909", "-.065973665"},
       {"-2.900351695", "-.389716638"},
       "2.926417437"},
  };
  const RenderSettings white = whiteBackground();
  const std::size_t pixel = 25 * 64 + 45;
  std::vector<glm::dvec3> v_color(64 * 64, glm::dvec3(0.0));
  v_color[pixel] = {1, 2, 3};
  for (const auto& table : tables) {
    const ReferenceModel model = single(kG, table.model);
    const auto frame = renderReference(model, tableCamera(), white);
    const auto g = backwardReference(model, tableCamera(), white, v_color);
    checkPrinted(1.0 - frame.alpha[pixel], table.transmittance);
    checkPrinted(g.opacity_logit[0], table.logit);
    checkPrinted(g.screen_abs[0], table.screen_abs);
    for (int k = 0; k < 2; ++k) checkPrinted(g.screen[0][k], table.screen[k]);
    for (int k = 0; k < 3; ++k) {
      checkPrinted(frame.color(pixel)[k], table.color[k]);
      checkPrinted(g.mean[0][k], table.mean[k]);
      checkPrinted(g.log_scale[0][k], table.log_scale[k]);
      checkPrinted(g.sh[0][k], table.sh[k]);
    }
    for (int k = 0; k < 4; ++k) {
      checkPrinted(g.rotation[0][k], table.rotation[k]);
      checkPrinted(g.texels[1 * 4 + 2][k], table.texel_21[k]);  // [iu = 2][iv = 1]
      checkPrinted(g.texels[2 * 4 + 1][k], table.texel_12[k]);
    }
  }
}

TEST_CASE("the spherical harmonics are the published ones") {
  const char* expected[16] = {".2820947918",  "-.3257350079", ".3257350079",  "-.1628675040",
                              ".2427885401",  "-.4855770803", ".1051305218",  "-.2427885401",
                              "-.1820914051", ".0437069326",  ".4282387322",  "-.3724076885",
                              "-.1934988391", "-.1862038442", "-.3211790492", ".2403881294"};
  const auto basis = reference::shBasis(glm::dvec3(1, 2, 2) / 3.0);
  // Function 15 is sqrt(35 / (32 pi)) 11 / 27 = .24038812923; the table's last digit is 1.7 units off.
  for (int k = 0; k < 16; ++k) checkPrinted(basis[k], expected[k], k == 15 ? 1.8 : 0.5);
}

TEST_CASE("the spherical harmonics are orthonormal to 1e-12") {
  // Exact for polynomials of degree 6: the trapezoid rule in the angle around z, Gauss-Legendre of order 4 in z.
  const double z_nodes[] = {
      -std::sqrt(3.0 / 7 + 2.0 / 7 * std::sqrt(1.2)), -std::sqrt(3.0 / 7 - 2.0 / 7 * std::sqrt(1.2)),
      std::sqrt(3.0 / 7 - 2.0 / 7 * std::sqrt(1.2)), std::sqrt(3.0 / 7 + 2.0 / 7 * std::sqrt(1.2))};
  const double outer = (18 - std::sqrt(30.0)) / 36, inner = (18 + std::sqrt(30.0)) / 36;
  const double z_weights[] = {outer, inner, inner, outer};
  constexpr int kSteps = 8;
  double gram[16][16] = {};
  for (int n = 0; n < 4; ++n) {
    for (int step = 0; step < kSteps; ++step) {
      const double angle = glm::two_pi<double>() * step / kSteps;
      const double r = std::sqrt(1 - z_nodes[n] * z_nodes[n]);
      const auto basis = reference::shBasis({r * std::cos(angle), r * std::sin(angle), z_nodes[n]});
      const double weight = z_weights[n] * glm::two_pi<double>() / kSteps;
      for (int i = 0; i < 16; ++i) {
        for (int j = 0; j < 16; ++j) gram[i][j] += weight * basis[i] * basis[j];
      }
    }
  }
  for (int i = 0; i < 16; ++i) {
    for (int j = 0; j < 16; ++j) CHECK(std::abs(gram[i][j] - (i == j ? 1.0 : 0.0)) < 1e-12);
  }
}
