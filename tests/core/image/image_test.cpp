// SPDX-License-Identifier: Apache-2.0
// Image files: round trips, conversions, and refusal of everything broken.
#include <zlib.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <random>

#include "core/file/file.h"
#include "core/image/drawn.h"
#include "core/image/image.h"
#include "core/system/error.h"
#include "support/address_space.h"
#include "support/catch.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"

using tg::Image;

namespace {

Image bytesImage(int width, int height, int channels) {
  std::mt19937 random(7);
  Image image(width, height, channels);
  for (float& v : image.data) v = static_cast<float>(random() & 255u) / 255.0f;
  return image;
}

Image smooth(int width, int height, int channels) {
  Image image(width, height, channels);
  const auto share = [](int part, int whole) { return static_cast<float>(part) / static_cast<float>(whole); };
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      for (int c = 0; c < channels; ++c) {
        image.at(x, y, c) = 0.2f + 0.5f * share(x, width) + 0.1f * static_cast<float>(c) + 0.1f * share(y, height);
      }
    }
  }
  return image;
}

// Every proper prefix throws tg::Error: no crash, no silent half picture.
void requireEveryTruncationFails(const std::vector<std::uint8_t>& bytes, std::size_t step) {
  for (std::size_t length = 0; length < bytes.size(); length += step) {
    REQUIRE_THROWS_AS(tg::decodeImage(std::span(bytes).first(length), "cut"), tg::Error);
  }
}

}  // namespace

TEST_CASE("8-bit values survive PNG exactly with 1, 3 and 4 channels") {
  for (int channels : {1, 3, 4}) {
    const Image image = bytesImage(17, 5, channels);
    const Image back = tg::decodeImage(tg::encodePng(image), "x.png");
    REQUIRE(back.channels == channels);
    REQUIRE(back.data == image.data);
  }
}

TEST_CASE("PNG clamps to [0, 1], rounds to nearest, and stores NaN as 0") {
  Image image(4, 1, 1);
  image.data = {-3.0f, 2.0f, 0.5f, NAN};
  const Image back = tg::decodeImage(tg::encodePng(image), "x.png");
  REQUIRE(back.data == std::vector<float>{0.0f, 1.0f, 128.0f / 255.0f, 0.0f});
}

TEST_CASE("PNG bytes are the same every time") {
  REQUIRE(tg::encodePng(bytesImage(31, 9, 3)) == tg::encodePng(bytesImage(31, 9, 3)));
}

TEST_CASE("a PNG cut anywhere is refused") { requireEveryTruncationFails(tg::encodePng(bytesImage(9, 9, 3)), 1); }

TEST_CASE("a PNG with a flipped bit is refused or still a picture, never a crash") {
  const std::vector<std::uint8_t> good = tg::encodePng(bytesImage(6, 6, 3));
  for (std::size_t i = 0; i < good.size() * 8; ++i) {
    std::vector<std::uint8_t> bad = good;
    bad[i / 8] ^= static_cast<std::uint8_t>(1u << (i % 8));
    try {
      tg::decodeImage(bad, "flipped");
    } catch (const tg::Error&) {
    }
  }
}

// Files made by hand; each is one line of Python with zlib and struct.
const std::vector<std::uint8_t> kGrey16WithGamma = {
    0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a, 0x00, 0x00, 0x00, 0x0d, 0x49, 0x48, 0x44, 0x52, 0x00, 0x00,
    0x00, 0x02, 0x00, 0x00, 0x00, 0x01, 0x10, 0x00, 0x00, 0x00, 0x00, 0x81, 0xd9, 0xfc, 0x15, 0x00, 0x00, 0x00,
    0x04, 0x67, 0x41, 0x4d, 0x41, 0x00, 0x01, 0x86, 0xa0, 0x31, 0xe8, 0x96, 0x5f, 0x00, 0x00, 0x00, 0x0d, 0x49,
    0x44, 0x41, 0x54, 0x78, 0x9c, 0x63, 0x60, 0x60, 0x68, 0x60, 0x04, 0x00, 0x01, 0x06, 0x00, 0x82, 0x23, 0xc9,
    0x17, 0x45, 0x00, 0x00, 0x00, 0x00, 0x49, 0x45, 0x4e, 0x44, 0xae, 0x42, 0x60, 0x82,
};
const std::vector<std::uint8_t> kPaletteWithTransparency = {
    0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a, 0x00, 0x00, 0x00, 0x0d, 0x49, 0x48, 0x44, 0x52, 0x00,
    0x00, 0x00, 0x03, 0x00, 0x00, 0x00, 0x01, 0x02, 0x03, 0x00, 0x00, 0x00, 0x66, 0x8e, 0xfc, 0x27, 0x00,
    0x00, 0x00, 0x09, 0x50, 0x4c, 0x54, 0x45, 0xff, 0x00, 0x00, 0x00, 0xff, 0x00, 0x00, 0x00, 0x33, 0xbf,
    0x98, 0x43, 0x11, 0x00, 0x00, 0x00, 0x02, 0x74, 0x52, 0x4e, 0x53, 0xff, 0x80, 0x08, 0x0f, 0xb3, 0x6a,
    0x00, 0x00, 0x00, 0x0a, 0x49, 0x44, 0x41, 0x54, 0x78, 0x9c, 0x63, 0x90, 0x00, 0x00, 0x00, 0x1a, 0x00,
    0x19, 0x2d, 0x88, 0xf4, 0x36, 0x00, 0x00, 0x00, 0x00, 0x49, 0x45, 0x4e, 0x44, 0xae, 0x42, 0x60, 0x82,
};
const std::vector<std::uint8_t> kGreyAlpha = {
    0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a, 0x00, 0x00, 0x00, 0x0d, 0x49, 0x48, 0x44, 0x52, 0x00,
    0x00, 0x00, 0x01, 0x00, 0x00, 0x00, 0x01, 0x08, 0x04, 0x00, 0x00, 0x00, 0xb5, 0x1c, 0x0c, 0x02, 0x00,
    0x00, 0x00, 0x0b, 0x49, 0x44, 0x41, 0x54, 0x78, 0x9c, 0x63, 0x30, 0x4e, 0x03, 0x00, 0x00, 0xcf, 0x00,
    0x9a, 0x0b, 0xf5, 0xdc, 0x22, 0x00, 0x00, 0x00, 0x00, 0x49, 0x45, 0x4e, 0x44, 0xae, 0x42, 0x60, 0x82,
};
const std::vector<std::uint8_t> kHeaderOf100000Squared = {
    0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a, 0x00, 0x00, 0x00, 0x0d, 0x49, 0x48, 0x44, 0x52, 0x00, 0x01,
    0x86, 0xa0, 0x00, 0x01, 0x86, 0xa0, 0x08, 0x02, 0x00, 0x00, 0x00, 0x27, 0x30, 0x9c, 0x9f, 0x00, 0x00, 0x00,
    0x0c, 0x49, 0x44, 0x41, 0x54, 0x78, 0x9c, 0x63, 0x60, 0xa0, 0x3d, 0x00, 0x00, 0x00, 0x64, 0x00, 0x01, 0x86,
    0x64, 0x3c, 0x35, 0x00, 0x00, 0x00, 0x00, 0x49, 0x45, 0x4e, 0x44, 0xae, 0x42, 0x60, 0x82,
};
const std::vector<std::uint8_t> kHeaderOf16000Squared = {
    0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a, 0x00, 0x00, 0x00, 0x0d, 0x49, 0x48, 0x44, 0x52, 0x00, 0x00,
    0x3e, 0x80, 0x00, 0x00, 0x3e, 0x80, 0x08, 0x02, 0x00, 0x00, 0x00, 0xce, 0x1c, 0x48, 0x89, 0x00, 0x00, 0x00,
    0x0c, 0x49, 0x44, 0x41, 0x54, 0x78, 0x9c, 0x63, 0x60, 0xa0, 0x3d, 0x00, 0x00, 0x00, 0x64, 0x00, 0x01, 0x86,
    0x64, 0x3c, 0x35, 0x00, 0x00, 0x00, 0x00, 0x49, 0x45, 0x4e, 0x44, 0xae, 0x42, 0x60, 0x82,
};

TEST_CASE("16-bit grey PNG keeps its precision, and a gAMA chunk does not linearise it") {
  const Image image = tg::decodeImage(kGrey16WithGamma, "x.png");
  REQUIRE(image.channels == 1);
  REQUIRE(image.data == std::vector<float>{0.0f, 32769.0f / 65535.0f});
}

TEST_CASE("a palette with transparency becomes RGBA") {
  const Image image = tg::decodeImage(kPaletteWithTransparency, "x.png");
  REQUIRE(image.channels == 4);
  REQUIRE(image.data == std::vector<float>{1, 0, 0, 1, 0, 1, 0, 128.0f / 255.0f, 0, 0, 0.2f, 1});
}

TEST_CASE("grey with alpha becomes RGBA") {
  const Image image = tg::decodeImage(kGreyAlpha, "x.png");
  REQUIRE(image.data == std::vector<float>{0.2f, 0.2f, 0.2f, 0.4f});
}

TEST_CASE("a PNG whose header promises more than the limit, or more than its bytes can hold, is refused at once") {
  REQUIRE_THROWS_WITH(tg::decodeImage(kHeaderOf100000Squared, "x.png"), Contains("image size out of range"));
  REQUIRE_THROWS_WITH(tg::decodeImage(kHeaderOf16000Squared, "x.png"), Contains("file is too short"));
  std::vector<std::uint8_t> packed = kHeaderOf16000Squared;  // grey of one bit a pixel
  std::ranges::copy(std::array<std::uint8_t, 9>{1, 0, 0, 0, 0, 0x69, 0x05, 0xe2, 0x73}, packed.begin() + 24);
  REQUIRE_THROWS_WITH(tg::decodeImage(packed, "x.png"), Contains("file is too short"));
}

TEST_CASE("a PNG whose header promises a row of gigabytes is refused before memory is taken for it") {
  TG_SKIP_IF(tg::test::noAddressSpaceLimit());
  std::vector<std::uint8_t> wide = kHeaderOf16000Squared;  // 2^29 x 1 pixels of 64 bits
  std::ranges::copy(std::array<std::uint8_t, 17>{0x20, 0, 0, 0, 0, 0, 0, 1, 16, 6, 0, 0, 0, 0x13, 0x39, 0x38, 0x01},
                    wide.begin() + 16);
  const tg::test::AddressSpaceLimit limit(std::uint64_t{1} << 30);
  CHECK(tg::test::messageOf([&] { tg::decodeImage(wide, "x.png"); }) ==
        "x.png: image size out of range (expected 1 to 268435456 pixels, found 536870912 x 1)");
}

TEST_CASE("packed texts of a PNG take no memory") {
  TG_SKIP_IF(tg::test::noAddressSpaceLimit());
  const std::vector<std::uint8_t> text(7'500'000, 'a');
  uLongf size = compressBound(text.size());
  std::vector<std::uint8_t> chunk = {'z', 'T', 'X', 't', 'k', 0, 0};
  const std::size_t head = chunk.size();
  chunk.resize(head + size);
  REQUIRE(compress2(&chunk[head], &size, text.data(), text.size(), 9) == Z_OK);
  chunk.resize(head + size);
  const auto number = [&](auto at, std::size_t value) {
    for (int shift = 0; shift < 32; shift += 8) at = chunk.insert(at, static_cast<std::uint8_t>(value >> shift));
  };
  const uLong sum = crc32(0, chunk.data(), static_cast<uInt>(chunk.size()));
  number(chunk.begin(), head - 4 + size);
  number(chunk.end(), sum);
  constexpr std::size_t header_bytes = 33;
  std::vector<std::uint8_t> png = tg::encodePng(Image(2000, 2000, 1, 1.0f));
  for (int k = 0; k < 30; ++k) png.insert(png.begin() + header_bytes, chunk.begin(), chunk.end());
  const tg::test::AddressSpaceLimit limit(std::uint64_t{64} << 20);
  CHECK(tg::decodeImage(png, "x.png").at(1999, 1999, 0) == 1.0f);
}

TEST_CASE("JPEG keeps a smooth picture within its quality, in colour and grey") {
  const tg::TemporaryFolder folder;
  for (int channels : {1, 3}) {
    const Image image = smooth(33, 18, channels);
    tg::writeImage(folder / "a.jpg", image);
    const Image back = tg::readImage(folder / "a.jpg");
    REQUIRE(back.width == 33);
    REQUIRE(back.channels == channels);
    for (std::size_t i = 0; i < image.data.size(); ++i) REQUIRE(back.data[i] == Approx(image.data[i]).margin(0.03));
  }
}

TEST_CASE("a picture that was drawn says so in its file, and is the same picture") {
  const tg::TemporaryFolder folder;
  for (const char* name : {"a.png", "a.jpg"}) {
    tg::writeImage(folder / name, smooth(33, 18, 3));
    const std::vector<std::uint8_t> plain = tg::readFile(folder / name, 1 << 20);
    const Image image = tg::readImage(folder / name);
    tg::writeDrawn(folder / name, smooth(33, 18, 3));
    const std::vector<std::uint8_t> drawn = tg::readFile(folder / name, 1 << 20);
    CHECK_FALSE(tg::isDrawn(plain));
    CHECK(tg::isDrawn(drawn));
    CHECK(tg::isDrawn(std::span(drawn).first(tg::kDrawnBytes)));
    CHECK_FALSE(tg::isDrawn(std::span(drawn).first(20)));
    CHECK(drawn.size() > plain.size());
    CHECK(tg::readImage(folder / name).data == image.data);
  }
  tg::writeDrawn(folder / "a.exr", smooth(33, 18, 3));
  CHECK(tg::readImage(folder / "a.exr").width == 33);
  CHECK(tg::encodeDrawnPng(smooth(9, 9, 1)) == tg::encodeDrawnPng(smooth(9, 9, 1)));
}

TEST_CASE("JPEG keeps the colours of neighbouring pixels apart") {
  const tg::TemporaryFolder folder;
  Image image(16, 16, 3);
  for (int y = 0; y < 16; ++y) {
    for (int x = 0; x < 16; ++x) image.at(x, y, x % 2 ? 0 : 2) = 0.8f;
  }
  tg::writeImage(folder / "a.jpg", image);
  const Image back = tg::readImage(folder / "a.jpg");
  for (std::size_t i = 0; i < image.data.size(); ++i) REQUIRE(back.data[i] == Approx(image.data[i]).margin(0.1));
}

TEST_CASE("a JPEG cut anywhere is refused") {
  const tg::TemporaryFolder folder;
  tg::writeImage(folder / "a.jpg", bytesImage(40, 24, 3));
  requireEveryTruncationFails(tg::readFile(folder / "a.jpg", 1 << 20), 1);
}

TEST_CASE("values that a half float holds survive EXR exactly, whatever the channels are called") {
  Image image(5, 3, 4);
  for (std::size_t i = 0; i < image.data.size(); ++i) image.data[i] = (static_cast<float>(i) - 30.0f) / 64.0f;
  const std::vector<std::string> names = {"R", "G", "B", "alpha"};
  const std::vector<std::uint8_t> bytes = tg::encodeExr(image, names);
  REQUIRE(bytes == tg::encodeExr(image, names));
  REQUIRE(tg::decodeExr(bytes, names, "x.exr").data == image.data);
  // A subset in another order.
  const std::vector<std::string> two = {"alpha", "G"};
  const Image part = tg::decodeExr(bytes, two, "x.exr");
  REQUIRE(part.at(4, 2, 0) == image.at(4, 2, 3));
  REQUIRE(part.at(4, 2, 1) == image.at(4, 2, 1));
  // As a picture: the channel named alpha is straight and stays so.
  REQUIRE(tg::decodeImage(bytes, "x.exr").data == image.data);
}

TEST_CASE("EXR pictures store alpha premultiplied and come back straight") {
  const tg::TemporaryFolder folder;
  Image image(4, 1, 4);
  image.data = {1.0f, 0.5f, 0.25f, 0.5f, 1.0f, 1.0f, 1.0f, 1.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.5f, 0.0f, 1.0f, 0.25f};
  tg::writeImage(folder / "a.exr", image);
  REQUIRE(tg::readImage(folder / "a.exr").data == image.data);
  const std::vector<std::string> premultiplied = {"R"};
  REQUIRE(tg::decodeExr(tg::readFile(folder / "a.exr", 1 << 20), premultiplied, "a").at(0, 0, 0) == 0.5f);
}

TEST_CASE("EXR names a missing channel and refuses values beyond half floats") {
  const Image image(2, 2, 3, 0.5f);
  const std::vector<std::string> rgb = {"R", "G", "B"}, depth = {"Z"};
  REQUIRE_THROWS_WITH(tg::decodeExr(tg::encodeExr(image, rgb), depth, "x.exr"),
                      Contains("x.exr: missing channel (expected Z, found B, G, R)"));
  REQUIRE_THROWS_AS(tg::encodeExr(Image(1, 1, 3, 1e6f), rgb), tg::Error);
  REQUIRE_THROWS_AS(tg::encodeExr(image, depth), tg::Error);
  REQUIRE_THROWS_AS(tg::encodeExr(Image(0, 2, 3), rgb), tg::Error);
  REQUIRE_THROWS_AS(tg::encodeExr(Image(2, 0, 3), rgb), tg::Error);
}

TEST_CASE("EXR lines that are not compressed are read, with each type of value") {
  std::vector<std::uint8_t> bytes;
  const auto text = [&](const std::string& word) {
    bytes.insert(bytes.end(), word.c_str(), word.c_str() + word.size() + 1);
  };
  const auto number = [&](auto value) {
    const auto* first = reinterpret_cast<const std::uint8_t*>(&value);
    bytes.insert(bytes.end(), first, first + sizeof(value));
  };
  const auto attribute = [&](const char* name, const char* type, std::int32_t size) {
    text(name), text(type), number(size);
  };
  number(std::int32_t{20000630}), number(std::int32_t{2});
  attribute("channels", "chlist", 3 * 18 + 1);
  for (const std::int32_t type : {0, 1, 2}) {  // unsigned, half, float
    text(std::string(1, static_cast<char>('A' + type)));
    for (const std::int32_t value : {type, 0, 1, 1}) number(value);
  }
  text("");
  attribute("compression", "compression", 1), text("");
  for (const char* name : {"dataWindow", "displayWindow"}) {
    attribute(name, "box2i", 16);
    for (int i = 0; i < 4; ++i) number(std::int32_t{0});
  }
  attribute("lineOrder", "lineOrder", 1), text("");
  attribute("pixelAspectRatio", "float", 4), number(1.0f);
  attribute("screenWindowCenter", "v2f", 8), number(0.0f), number(0.0f);
  attribute("screenWindowWidth", "float", 4), number(1.0f);
  text("");
  number(static_cast<std::uint64_t>(bytes.size() + 8));
  number(std::int32_t{0}), number(std::int32_t{10});
  number(std::uint32_t{7}), number(std::uint16_t{0x3800}), number(0.1f);
  const std::vector<std::string> names = {"A", "B", "C"};
  REQUIRE(tg::decodeExr(bytes, names, "x.exr").data == std::vector<float>{7.0f, 0.5f, 0.1f});
}

TEST_CASE("an EXR cut anywhere is refused") {
  const std::vector<std::string> rgb = {"R", "G", "B"};
  requireEveryTruncationFails(tg::encodeExr(bytesImage(20, 40, 3), rgb), 1);
}

TEST_CASE("an EXR with a flipped bit is refused or still a picture, never a crash") {
  const std::vector<std::string> rgb = {"R", "G", "B"};
  const std::vector<std::uint8_t> good = tg::encodeExr(bytesImage(3, 2, 3), rgb);
  for (std::size_t i = 0; i < good.size() * 8; ++i) {
    std::vector<std::uint8_t> bad = good;
    bad[i / 8] ^= static_cast<std::uint8_t>(1u << (i % 8));
    try {
      tg::decodeImage(bad, "flipped");
    } catch (const tg::Error&) {
    }
  }
}

TEST_CASE("an EXR whose data window is huge is refused before anything is allocated") {
  const std::vector<std::string> rgb = {"R", "G", "B"};
  std::vector<std::uint8_t> bytes = tg::encodeExr(Image(2, 2, 3, 0.5f), rgb);
  const char* attribute = "dataWindow\0box2i\0";
  const auto found = std::search(bytes.begin(), bytes.end(), attribute, attribute + 17);
  REQUIRE(found != bytes.end());
  const std::size_t max_x = static_cast<std::size_t>(found - bytes.begin()) + 17 + 4 + 8;
  for (std::uint32_t value : {60000u, 0x3fffffffu, 0x7fffffffu, 0xffffffffu}) {
    for (std::size_t axis : {std::size_t{0}, std::size_t{4}}) std::memcpy(&bytes[max_x + axis], &value, 4);
    REQUIRE_THROWS_AS(tg::decodeImage(bytes, "x.exr"), tg::Error);
  }
}

TEST_CASE("an EXR attribute counts by its name and its type") {
  const std::vector<std::string> rgb = {"R", "G", "B"};
  const std::vector<std::uint8_t> good = tg::encodeExr(Image(2, 2, 3, 0.5f), rgb);
  for (const auto& [name, type] : {std::pair<std::string, std::string>{"dataWindow", "box2i"},
                                   {"channels", "chlist"},
                                   {"compression", "compression"}}) {
    const std::string both = name + '\0' + type + '\0';
    const auto at = std::search(good.begin(), good.end(), both.begin(), both.end()) - good.begin();
    for (std::size_t letter : {std::size_t{0}, name.size() + 1}) {
      std::vector<std::uint8_t> bad = good;
      bad.at(static_cast<std::size_t>(at) + letter) = 'x';
      REQUIRE_THROWS_WITH(tg::decodeImage(bad, "x.exr"), Contains("lacks dataWindow, channels or compression"));
    }
  }
}

TEST_CASE("lists of texts in an EXR header must fit their attribute") {
  const std::vector<std::string> rgb = {"R", "G", "B"};
  const std::vector<std::uint8_t> good = tg::encodeExr(Image(2, 2, 3, 0.5f), rgb);
  const auto refusal = [&](std::uint8_t length, const std::string& text = "ab") {
    const std::string attribute = std::string("who\0stringvector\0", 17) + static_cast<char>(4 + text.size()) +
                                  std::string(3, '\0') + static_cast<char>(length) + std::string(3, '\0') + text;
    std::vector<std::uint8_t> bytes = good;
    bytes.insert(bytes.begin() + 8, attribute.begin(), attribute.end());  // behind the version
    return tg::test::messageOf([&] { tg::decodeImage(bytes, "x.exr"); });
  };
  REQUIRE_THAT(refusal(2), !Contains("attribute who"));
  REQUIRE_THAT(refusal(0, ""), !Contains("attribute who"));
  REQUIRE(refusal(3) == "x.exr: attribute who is broken");
  REQUIRE(refusal(255) == "x.exr: attribute who is broken");
}

TEST_CASE("EXR attributes have the sizes of their types: the library reads these whatever the header says") {
  const std::vector<std::string> rgb = {"R", "G", "B"};
  const std::vector<std::uint8_t> good = tg::encodeExr(Image(2, 2, 3, 0.5f), rgb);
  const auto refusal = [&](const std::string& attribute) {
    std::vector<std::uint8_t> bytes = good;
    bytes.insert(bytes.begin() + 8, attribute.begin(), attribute.end());  // behind the version
    return tg::test::messageOf([&] { tg::decodeImage(bytes, "x.exr"); });
  };
  const auto attribute = [](const std::string& name, const std::string& type, const std::string& value) {
    return name + '\0' + type + '\0' + static_cast<char>(value.size()) + std::string(3, '\0') + value;
  };
  // A text of 1.8 GB that lies in what the library does not take for the attribute's value.
  const std::string text("a\0string\0null", 13);
  REQUIRE(refusal(attribute("b", "int", std::string(4, '\0') + text)) ==
          "x.exr: attribute b has a wrong size (expected 4, found 17 bytes)");
  REQUIRE(refusal(attribute("compression", "compression", '\0' + text)) ==
          "x.exr: attribute compression has a wrong size (expected 1, found 14 bytes)");
  REQUIRE(refusal(attribute("dataWindow", "box2i", std::string(16, '\0') + text)) ==
          "x.exr: attribute dataWindow has a wrong size (expected 16, found 29 bytes)");
  REQUIRE(refusal(attribute("b", "floatvector", "12345")) ==
          "x.exr: attribute b has a wrong size (expected 4, found 5 bytes)");
  const std::string channel =
      std::string("R\0", 2) + '\1' + std::string(7, '\0') + std::string("\1\0\0\0\1\0\0\0\0", 9);
  for (const std::string name : {"channels", "b"}) {
    REQUIRE(refusal(attribute(name, "chlist", channel + text)) ==
            "x.exr: attribute " + name + " goes on behind its last channel");
  }
  REQUIRE_THAT(refusal(attribute("b", "m33f", std::string(36, '\0'))), !Contains("attribute b"));
  REQUIRE_THAT(refusal(attribute("b", "floatvector", std::string(8, '\0'))), !Contains("attribute b"));
  REQUIRE_THAT(refusal(attribute("b", "of another program", "12345")), !Contains("attribute b"));
}

TEST_CASE("a PNG of 16 bits holds its numbers to half a step") {
  for (const int channels : {1, 3, 4}) {
    Image image(5, 3, channels);
    for (std::size_t i = 0; i < image.data.size(); ++i) {
      image.data[i] = static_cast<float>(i * 977 % 4096) / 4096.0f;
    }
    const Image read = tg::decodeImage(tg::encodePng16(image), "x.png");
    REQUIRE(read.data.size() == image.data.size());
    for (std::size_t i = 0; i < image.data.size(); ++i) {
      REQUIRE(std::abs(read.data[i] - image.data[i]) <= 0.5001f / 65535.0f);
    }
  }
}

TEST_CASE("unknown files and extensions are named") {
  const tg::TemporaryFolder folder;
  REQUIRE_THROWS_WITH(tg::decodeImage(std::vector<std::uint8_t>{'G', 'I', 'F', '8'}, "a.gif"),
                      Contains("a.gif: unknown image format"));
  try {
    tg::writeImage(folder / "a.bmp", Image(1, 1, 3));
    FAIL("expected an error");
  } catch (const tg::Error& e) {
    REQUIRE(e.kind == tg::ErrorKind::usage);
  }
  REQUIRE_THROWS_AS(tg::writeImage(folder / "a.png", Image(0, 0, 3)), tg::Error);
  REQUIRE_THROWS_AS(tg::writeImage(folder / "a.png", Image(2, 2, 2)), tg::Error);
}

TEST_CASE("compositing puts straight alpha over the background") {
  Image image(2, 1, 4);
  image.data = {1.0f, 0.0f, 0.5f, 0.25f, 0.2f, 0.4f, 0.6f, 1.0f};
  const float white[3] = {1, 1, 1};
  REQUIRE(tg::compositeOver(image, white).data == std::vector<float>{1.0f, 0.75f, 0.875f, 0.2f, 0.4f, 0.6f});
  REQUIRE(tg::compositeOver(Image(1, 1, 3, 0.3f), white).data == std::vector<float>{0.3f, 0.3f, 0.3f});
  REQUIRE(tg::compositeOver(Image(1, 1, 1, 0.3f), white).data == std::vector<float>{0.3f, 0.3f, 0.3f});
}

TEST_CASE("downsampling averages boxes, weighs colour by alpha and cuts partial boxes") {
  Image grey(5, 2, 1);
  grey.data = {0, 2, 4, 6, 9, 2, 4, 6, 8, 9};
  REQUIRE(tg::downsample(grey, 2).data == std::vector<float>{2, 6});
  Image alpha(2, 2, 4);
  alpha.data = {1, 0, 0, 1, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 1};
  REQUIRE(tg::downsample(alpha, 2).data == std::vector<float>{0.5f, 0.5f, 0.0f, 0.5f});
  REQUIRE_THROWS_AS(tg::downsample(grey, 3), tg::Error);
  REQUIRE_THROWS_AS(tg::downsample(grey, 0), tg::Error);
}
