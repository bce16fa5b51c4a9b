// SPDX-License-Identifier: Apache-2.0
// .ksplat of every compression level: every number where it belongs, and nothing but errors from broken files.
#include <cmath>
#include <limits>

#include "converter/formats/read_ksplat.h"
#include "converter/scenes.h"
#include "converter/scratch.h"
#include "converter/splat_files.h"
#include "core/system/error.h"
#include "support/catch.h"
#include "support/message_of.h"

using namespace tg;
using test::messageOf;

namespace {

Bundle parse(const std::string& bytes) {
  return parseKsplat({reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()}, "a.ksplat");
}
std::string refused(const std::string& bytes) {
  return messageOf([&] { checkModel(parse(bytes).model, "a.ksplat"); });
}
std::string refused(const KsplatParts& parts) { return refused(parts.whole()); }

// A file with another number at a byte of it.
template <typename T>
std::string patched(const KsplatParts& parts, std::size_t at, T value) {
  std::string bytes = parts.whole();
  std::memcpy(bytes.data() + at, &value, sizeof(value));
  return bytes;
}

constexpr std::size_t kFirst = 4096, kSecond = 4096 + 1024;  // headers of sections

}  // namespace

TEST_CASE(".ksplat of every level and degree: every number where it belongs") {
  for (const int level : {0, 1, 2}) {
    for (const int degree : {0, 1, 2}) {
      CAPTURE(level, degree);
      const Bundle loaded = parse(KsplatParts{.level = level, .degree = degree}.whole());
      const GaussianModel& model = loaded.model;
      CHECK(loaded.warnings.empty());
      REQUIRE(model.size() == 5);
      REQUIRE(model.sh_degree == degree);
      checkModel(model, "a.ksplat");
      for (std::size_t i = 0; i < 5; ++i) {
        CAPTURE(i);
        const float at = static_cast<float>(i);
        CHECK(largest(model.mean[i] - glm::vec3(at, -at, 0.5f * at)) < 1e-6);
        CHECK(largest(model.log_scale[i] - glm::vec3(0.0f, std::log(0.5f), std::log(0.25f))) < 1e-6);
        CHECK(model.rotation[i] == glm::vec4(0.5f, -0.5f, 0.0f, 1.0f));
        CHECK(model.opacity_logit[i] == Approx(std::log(0.25)));
        const glm::vec3* sh = model.sh.data() + i * model.shCount();
        CHECK(largest(sh[0] - glm::vec3(0.5f, -0.5f, 128 / 255.0f - 0.5f) / 0.2820948f) < 1e-5);
        for (std::size_t k = 1; k < model.shCount(); ++k) {
          for (std::size_t c = 0; c < 3; ++c) {
            CAPTURE(k, c);
            // The second section has no SH.
            CHECK(sh[k][static_cast<int>(c)] == Approx(i < 3 ? KsplatParts::sh(level, k, c) : 0.0f).margin(1e-6));
          }
        }
      }
    }
  }
}

TEST_CASE(".ksplat: a range of SH that is not said is -1.5 to 1.5") {
  const GaussianModel model = parse(KsplatParts{.level = 2, .degree = 1, .sh_low = 0, .sh_high = 0}.whole()).model;
  CHECK(model.sh[1].x == -1.5f);
  CHECK(model.sh[1].y == Approx(-1.5 + 3.0 * 30 / 255));
}

TEST_CASE(".ksplat: what has no logarithm or is not finite is repaired or dropped with a warning") {
  KsplatParts parts{.level = 1, .degree = 1};
  parts.scale[1] = -0.5f;
  for (float& component : parts.rotation) component = 0.0f;
  parts.first_sh = std::numeric_limits<float>::infinity();  // of the first section's three
  const Bundle loaded = parse(parts.whole());
  CHECK(loaded.model.size() == 2);
  CHECK(loaded.model.mean[0].x == Approx(3.0));
  CHECK(loaded.model.rotation[0] == glm::vec4(1, 0, 0, 0));
  CHECK(loaded.model.log_scale[0].y == Approx(std::log(0.5)));
  CHECK(loaded.repairs == std::vector<std::string>{"3 splats with values that are not finite: dropped",
                                                   "2 splats with a negative scale: sign dropped",
                                                   "2 splats with a quaternion of length 0: not turned"});
  parts.scale[0] = std::numeric_limits<float>::quiet_NaN();
  CHECK(refused(parts) == "a.ksplat: no splat is left: none had finite values");
}

TEST_CASE(".ksplat: sections without splats say nothing") {
  for (const int level : {0, 1, 2}) {
    CAPTURE(level);
    const KsplatParts parts{.level = level, .degree = 1};
    const GaussianModel model = parse(parts.whole()).model;
    for (const std::uint16_t degree : {std::uint16_t{0}, std::uint16_t{2}}) {
      std::string more = patched(parts, 4, std::uint32_t{4});
      std::string empty(1024, '\0');
      std::memcpy(empty.data() + 40, &degree, sizeof(degree));
      more.insert(kSecond, empty).insert(kSecond + 2 * 1024, empty);
      CHECK(refused(more) == "accepted");
      CHECK(parse(more).model == model);
      const std::uint32_t one = 1;
      std::memcpy(more.data() + kSecond + 4, &one, sizeof(one));
      CHECK(refused(more) != "accepted");
    }
  }
}

TEST_CASE(".ksplat: headers that lie are refused by name before memory is taken") {
  const KsplatParts good{.level = 1, .degree = 1};
  const std::size_t size = good.whole().size();
  CHECK(refused(good) == "accepted");
  CHECK(refused(std::string(100, '\0')) ==
        "a.ksplat: .ksplat: the file ends inside the header (expected at least 4096 bytes, found 100)");
  CHECK(refused(patched(good, 1, std::uint8_t{2})) == "a.ksplat: .ksplat: version 0.2 is not supported (expected 0.1)");
  CHECK(refused(patched(good, 20, std::uint16_t{3})) ==
        "a.ksplat: .ksplat: wrong compression level (expected at most 2, found 3)");
  CHECK(refused(patched(good, 12, std::uint32_t{0})) ==
        "a.ksplat: .ksplat: wrong number of splats (expected 1 to 64000000, found 0)");
  CHECK(refused(patched(good, 12, std::uint32_t{6})) ==
        "a.ksplat: .ksplat: the sections hold another number of splats (expected 6, found 5)");
  CHECK(refused(patched(good, 4, std::uint32_t{0xFFFFFFFF})) ==
        "a.ksplat: .ksplat: too many sections for the file (expected at most 2, found 4294967295)");
  CHECK(refused(patched(good, 4, std::uint32_t{0})).find("another number of splats (expected 5, found 0)") !=
        std::string::npos);
  CHECK(refused(patched(good, 36, std::numeric_limits<float>::infinity())) ==
        "a.ksplat: .ksplat: the range of SH is not finite");
  CHECK(refused(good.whole() + "more") == "a.ksplat: .ksplat: 4 bytes follow the splats (expected none)");

  CHECK(refused(patched(good, kSecond + 4, std::uint32_t{60000000})) ==
        "a.ksplat: .ksplat: section 1: the file is too short for 60000000 splats in 2 buckets (expected at least " +
            std::to_string(size + (60000000 - 2) * 24ull) + " bytes, found " + std::to_string(size) + ")");
  CHECK(refused(patched(good, kFirst + 40, std::uint16_t{3})) ==
        "a.ksplat: .ksplat: section 0: wrong SH degree (expected at most 2, found 3)");
  CHECK(refused(patched(good, kFirst + 16, std::numeric_limits<float>::quiet_NaN())) ==
        "a.ksplat: .ksplat: section 0: the size of a block is not finite");
  CHECK(refused(patched(good, kFirst + 12, std::uint32_t{3})) ==
        "a.ksplat: .ksplat: section 0: full and other buckets are not all (expected 3, found 2)");
  CHECK(refused(patched(good, kFirst + 20, std::uint16_t{16})) ==
        "a.ksplat: .ksplat: section 0: wrong size of a bucket (expected 12, found 16)");
  for (const std::uint32_t length : {0u, 2u, 0xFFFFFFFFu}) {
    KsplatParts parts = good;
    parts.first_length = length;
    CHECK(refused(parts) ==
          "a.ksplat: .ksplat: section 0: the buckets hold another number of splats (expected 3, found " +
              std::to_string(2 + std::uint64_t{length}) + ")");
  }
  // Counts whose bytes no number of 32 bits holds.
  std::string huge = patched(good, kFirst + 12, std::uint32_t{0xFFFFFFFF});
  const std::uint32_t full = 0xFFFFFFFE;
  std::memcpy(huge.data() + kFirst + 32, &full, 4);
  CHECK(refused(huge).find("section 0: the file is too short for 3 splats in 4294967295 buckets (expected at least ") !=
        std::string::npos);
}

TEST_CASE(".ksplat: truncated and spoilt files are errors or sound models") {
  for (const int level : {0, 1, 2}) {
    const std::string good = KsplatParts{.level = level, .degree = 2}.whole();
    for (std::size_t length = 0; length < good.size(); length += length < 4096 + 2048 ? 61 : 1) {
      CAPTURE(level, length);
      CHECK_THROWS_AS(parse(good.substr(0, length)), Error);
    }
    for (std::size_t bit = 0; bit < good.size() * 8; ++bit) {
      if (good[bit / 8] == 0 && bit / 8 < 6000 && bit / 8 % 1024 > 64) continue;  // what headers do not use
      std::string bad = good;
      bad[bit / 8] = static_cast<char>(bad[bit / 8] ^ (1 << bit % 8));
      CAPTURE(level, bit);
      CHECK(refused(bad).find('\n') == std::string::npos);
    }
  }
}

TEST_CASE("a .ksplat is known by its extension") {
  const Scratch scratch;
  const auto file = scratch.write("a.ksplat", KsplatParts{.level = 2, .degree = 2}.whole());
  const Bundle loaded = readModel(file);
  CHECK(loaded.format == "ksplat");
  CHECK(loaded.model.sh_degree == 2);
}
