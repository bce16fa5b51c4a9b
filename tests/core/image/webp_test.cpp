// SPDX-License-Identifier: Apache-2.0
// WebP as a container of bytes.
#include "core/image/webp.h"

#include <array>
#include <span>

#include "core/file/file.h"
#include "core/image/image.h"
#include "core/system/error.h"
#include "support/address_space.h"
#include "support/catch.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"

using namespace tg;

namespace {

BytePixels pattern(int width, int height) {
  BytePixels pixels(width, height);
  for (std::size_t i = 0; i < pixels.data.size(); ++i) pixels.data[i] = static_cast<std::uint8_t>(i * i * 37 >> 3);
  for (std::size_t i = 0; i < pixels.size(); i += 3) pixels.data[4 * i + 3] = 0;
  return pixels;
}

// With sides of 16384 in the header (14 bits each behind the byte 0x2f), without the bytes for them.
std::vector<std::uint8_t> wide(std::vector<std::uint8_t> webp) {
  REQUIRE(webp.at(20) == 0x2f);
  for (const std::size_t at : {21, 22, 23}) webp[at] = 0xff;
  webp[24] |= 0x0f;
  return webp;
}

// One pixel each.
constexpr std::array<std::uint8_t, 42> kLossy = {0x52, 0x49, 0x46, 0x46, 0x22, 0x00, 0x00, 0x00, 0x57, 0x45, 0x42,
                                                 0x50, 0x56, 0x50, 0x38, 0x20, 0x16, 0x00, 0x00, 0x00, 0x30, 0x01,
                                                 0x00, 0x9d, 0x01, 0x2a, 0x01, 0x00, 0x01, 0x00, 0x0e, 0xc0, 0xfe,
                                                 0x25, 0xa4, 0x00, 0x03, 0x70, 0x00, 0x00, 0x00, 0x00};
constexpr std::array<std::uint8_t, 82> kLossyWithAlpha = {
    0x52, 0x49, 0x46, 0x46, 0x4a, 0x00, 0x00, 0x00, 0x57, 0x45, 0x42, 0x50, 0x56, 0x50, 0x38, 0x58, 0x0a,
    0x00, 0x00, 0x00, 0x10, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x41, 0x4c, 0x50, 0x48,
    0x0c, 0x00, 0x00, 0x00, 0x11, 0x07, 0x10, 0x11, 0xfd, 0x0f, 0x44, 0x44, 0xff, 0x03, 0x00, 0x00, 0x56,
    0x50, 0x38, 0x20, 0x18, 0x00, 0x00, 0x00, 0x14, 0x01, 0x00, 0x9d, 0x01, 0x2a, 0x01, 0x00, 0x01, 0x00,
    0x00, 0x00, 0xfe, 0x00, 0x00, 0x0d, 0xc0, 0x00, 0xfe, 0xe6, 0xb5, 0x00, 0x00, 0x00};
constexpr std::array<std::uint8_t, 90> kAnimation = {
    0x52, 0x49, 0x46, 0x46, 0x52, 0x00, 0x00, 0x00, 0x57, 0x45, 0x42, 0x50, 0x56, 0x50, 0x38, 0x58, 0x0a, 0x00,
    0x00, 0x00, 0x12, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x41, 0x4e, 0x49, 0x4d, 0x06, 0x00,
    0x00, 0x00, 0xff, 0xff, 0xff, 0xff, 0x00, 0x00, 0x41, 0x4e, 0x4d, 0x46, 0x26, 0x00, 0x00, 0x00, 0x00, 0x00,
    0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x64, 0x00, 0x00, 0x00, 0x56, 0x50, 0x38, 0x4c,
    0x0d, 0x00, 0x00, 0x00, 0x2f, 0x00, 0x00, 0x00, 0x10, 0x07, 0x10, 0x11, 0x11, 0x88, 0x88, 0xfe, 0x07, 0x00};

}  // namespace

TEST_CASE("WebP: every byte comes back, the colour of transparent pixels, too") {
  for (const auto& [width, height] : {std::pair{1, 1}, std::pair{17, 5}, std::pair{64, 64}}) {
    const BytePixels in = pattern(width, height);
    const BytePixels out = decodeWebp(encodeWebp(in), "a.webp");
    CHECK(out.width == width);
    CHECK(out.height == height);
    CHECK(out.data == in.data);
  }
}

TEST_CASE("WebP: a picture has alpha where its file says so") {
  const BytePixels transparent = pattern(17, 5);
  BytePixels opaque = transparent;
  for (std::size_t i = 0; i < opaque.size(); ++i) opaque.data[4 * i + 3] = 255;
  const TemporaryFolder folder;
  for (const auto& [pixels, channels] : {std::pair{transparent, 4}, std::pair{opaque, 3}}) {
    writeFileAtomically(folder / "a.jpg", encodeWebp(pixels));  // told by its bytes
    const Image image = readImage(folder / "a.jpg");
    REQUIRE(image.channels == channels);
    CHECK(image.width == 17);
    bool same = true;
    for (int i = 0; i < 17 * 5 * channels; ++i) {
      const std::size_t at = static_cast<std::size_t>(i), from = at / channels * 4 + at % channels;
      same = same && image.data[at] == static_cast<float>(pixels.data[from]) / 255.0f;
    }
    CHECK(same);
  }
  const Image lossy = decodeImage(kLossy, "a.webp");
  CHECK(lossy.channels == 3);
  CHECK(lossy.width == 1);
  const Image both = decodeImage(kLossyWithAlpha, "a.webp");
  CHECK(both.channels == 4);
}

TEST_CASE("WebP: a picture that is cut or flipped or animated or too large is refused in words") {
  const auto refusal = [](std::span<const std::uint8_t> bytes) {
    return test::messageOf([&] { decodeImage(bytes, "a.webp"); });
  };
  const std::vector<std::uint8_t> good = encodeWebp(pattern(40, 30));
  for (std::size_t length = 0; length < good.size(); ++length) {
    REQUIRE(refusal(std::span(good).first(length)).find("a.webp: ") == 0);
  }
  CHECK(refusal(std::span(good).first(12)) == "a.webp: no WebP file");
  CHECK(refusal(std::span(good).first(11)) == "a.webp: unknown image format (expected PNG, JPEG, WebP or EXR)");
  for (std::size_t bit = 0; bit < 8 * good.size(); bit += 7) {
    std::vector<std::uint8_t> bad = good;
    bad[bit / 8] ^= static_cast<std::uint8_t>(1 << bit % 8);
    const std::string said = refusal(bad);
    CHECK((said == "accepted" || said.find("a.webp: ") == 0));
  }
  CHECK(refusal(kAnimation) == "a.webp: an animated WebP (expected a single picture)");
  TG_SKIP_IF(test::noAddressSpaceLimit());
  const test::AddressSpaceLimit limit(std::uint64_t{256} << 20);
  CHECK_THAT(refusal(wide(good)), Contains("file is too short for its image size"));
}

TEST_CASE("WebP: the same pixels give the same bytes") {
  CHECK(encodeWebp(pattern(40, 30)) == encodeWebp(pattern(40, 30)));
}

TEST_CASE("WebP: broken files are refused in words") {
  const std::vector<std::uint8_t> good = encodeWebp(pattern(40, 30));
  const auto refusal = [](std::vector<std::uint8_t> bytes) {
    return test::messageOf([&] { decodeWebp(bytes, "a.webp"); });
  };
  CHECK(refusal({}) == "a.webp: no WebP file");
  CHECK(refusal({'G', 'I', 'F'}) == "a.webp: no WebP file");
  CHECK(refusal({good.begin(), good.begin() + static_cast<std::ptrdiff_t>(good.size() / 2)}) ==
        "a.webp: broken WebP file");
  CHECK(refusal(wide(good)).find("file is too short for its image size") != std::string::npos);
  // One colour takes hardly a byte, which is fine where as many pixels are expected.
  const BytePixels grey(4200, 4200);
  const std::vector<std::uint8_t> small = encodeWebp(grey);
  CHECK(refusal(small).find("file is too short for its image size") != std::string::npos);
  CHECK(decodeWebp(small, "a.webp", 4150 * 4200).size() == grey.size());
}
