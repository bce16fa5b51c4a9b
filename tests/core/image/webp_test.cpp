// SPDX-License-Identifier: Apache-2.0
// WebP as a container of bytes.
#include "core/image/webp.h"

#include "core/system/error.h"
#include "support/catch.h"
#include "support/message_of.h"

using namespace tg;

namespace {

BytePixels pattern(int width, int height) {
  BytePixels pixels(width, height);
  for (std::size_t i = 0; i < pixels.data.size(); ++i) pixels.data[i] = static_cast<std::uint8_t>(i * i * 37 >> 3);
  for (std::size_t i = 0; i < pixels.size(); i += 3) pixels.data[4 * i + 3] = 0;
  return pixels;
}

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
  // Sides of 16384 in the header (14 bits each behind the byte 0x2f), without the bytes for them.
  std::vector<std::uint8_t> wide = good;
  REQUIRE(wide[20] == 0x2f);
  for (const std::size_t at : {21, 22, 23}) wide[at] = 0xff;
  wide[24] |= 0x0f;
  CHECK(refusal(wide).find("file is too short for its image size") != std::string::npos);
  // One colour takes hardly a byte, which is fine where as many pixels are expected.
  const BytePixels grey(4200, 4200);
  const std::vector<std::uint8_t> small = encodeWebp(grey);
  CHECK(refusal(small).find("file is too short for its image size") != std::string::npos);
  CHECK(decodeWebp(small, "a.webp", 4150 * 4200).size() == grey.size());
}
