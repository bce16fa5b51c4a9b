// SPDX-License-Identifier: Apache-2.0
// Photographs as cameras leave them: turned, of several formats, with EXIF; and which files are none.
#include "training/photos/photograph.h"

#include <libheif/heif.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <fstream>
#include <initializer_list>
#include <memory>
#include <vector>

#include "core/file/file.h"
#include "core/image/drawn.h"
#include "core/image/webp.h"
#include "core/system/error.h"
#include "support/catch.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"
#include "training/photos/child.h"
#include "training/photos/heif_references.h"
#include "training/photos/heif_sizes.h"
#include "training/photos/prepare.h"

namespace fs = std::filesystem;

namespace {

using Bytes = std::vector<std::uint8_t>;

// A TIFF block, little-endian: an IFD with entries of a value each, then one that the tag 0x8769 points to.
struct Entry {
  int tag;
  int type;  // 2 text, 3 short, 5 rational
  std::uint32_t value;
  std::string text = {};
};
void put(Bytes& bytes, std::uint32_t value, int count) {
  for (int i = 0; i < count; ++i) bytes.push_back(static_cast<std::uint8_t>(value >> 8 * i));
}
Bytes exifBlock(std::vector<Entry> main, const std::vector<Entry>& camera) {
  Bytes bytes = {'I', 'I', 42, 0, 8, 0, 0, 0};
  const std::size_t camera_at = 8 + 2 + 12 * (main.size() + 1) + 4;
  main.push_back({0x8769, 4, static_cast<std::uint32_t>(camera_at)});
  std::size_t data_at = camera_at + 2 + 12 * camera.size() + 4;
  Bytes data;
  for (const std::vector<Entry>& entries : {main, camera}) {
    put(bytes, static_cast<std::uint32_t>(entries.size()), 2);
    for (const Entry& entry : entries) {
      put(bytes, entry.tag, 2);
      put(bytes, entry.type, 2);
      put(bytes, entry.type == 2 ? static_cast<std::uint32_t>(entry.text.size() + 1) : 1, 4);
      if (entry.type == 2) {
        put(bytes, static_cast<std::uint32_t>(data_at + data.size()), 4);
        data.insert(data.end(), entry.text.begin(), entry.text.end());
        data.push_back(0);
      } else {
        put(bytes, entry.value, 4);
      }
    }
    put(bytes, 0, 4);
  }
  bytes.insert(bytes.end(), data.begin(), data.end());
  return bytes;
}

const Bytes kBlock = exifBlock({{0x010f, 2, 0, "Phone Company"}, {0x0110, 2, 0, "Phone 7"}, {0x0112, 3, 6}},
                               {{0xa002, 3, 40}, {0xa003, 3, 30}, {0xa405, 3, 26}});

// 40 x 30, red on the left, blue on the right; a green top row.
tg::Image picture() {
  tg::Image image(40, 30, 3, 0.0f);
  for (int y = 0; y < 30; ++y) {
    for (int x = 0; x < 40; ++x) image.at(x, y, x < 20 ? 0 : 2) = 1;
  }
  return image;
}

void writePictures(const fs::path& folder, std::initializer_list<const char*> names) {
  for (const char* name : names) {
    fs::create_directories((folder / name).parent_path());
    tg::writeImage(folder / name, picture());
  }
}

void writeJpegWithExif(const fs::path& path, const Bytes& block) {
  tg::writeImage(path, picture());
  Bytes jpeg = tg::readFile(path, 1 << 20);
  Bytes segment = {0xff, 0xe1};
  const std::size_t size = block.size() + 8;
  segment.push_back(static_cast<std::uint8_t>(size >> 8));
  segment.push_back(static_cast<std::uint8_t>(size & 255));
  for (const char c : {'E', 'x', 'i', 'f', '\0', '\0'}) segment.push_back(static_cast<std::uint8_t>(c));
  segment.insert(segment.end(), block.begin(), block.end());
  jpeg.insert(jpeg.begin() + 2, segment.begin(), segment.end());
  tg::writeFileAtomically(path, jpeg);
}

}  // namespace

TEST_CASE("a photograph is turned as its EXIF says, and its lens is known", "[photos]") {
  const tg::TemporaryFolder folder;
  writeJpegWithExif(folder / "a.jpg", kBlock);
  const tg::TakenPhotograph photograph = tg::readPhotograph(folder / "a.jpg");
  CHECK(photograph.image.width == 30);
  CHECK(photograph.image.height == 40);
  CHECK(photograph.as_stored == tg::PictureFormat::none);
  // Orientation 6: what is stored on the left is the top.
  CHECK(photograph.image.at(15, 5, 0) > 0.9f);
  CHECK(photograph.image.at(15, 35, 2) > 0.9f);
  CHECK(photograph.facts.camera == "Phone Company Phone 7");
  CHECK(photograph.facts.focal_per_diagonal == Approx(26 / 43.2666).epsilon(1e-4));

  tg::writeImage(folder / "plain.jpg", picture());
  CHECK(tg::readPhotograph(folder / "plain.jpg").as_stored == tg::PictureFormat::jpeg);
  CHECK(tg::readPhotograph(folder / "plain.jpg").facts.focal_per_diagonal == 0);
}

TEST_CASE("the eight orientations put the stored corner where TIFF says", "[photos]") {
  tg::Image stored(3, 2, 1);
  for (int i = 0; i < 6; ++i) stored.data[i] = static_cast<float>(i);
  const std::vector<std::vector<float>> expected = {{0, 1, 2, 3, 4, 5}, {2, 1, 0, 5, 4, 3}, {5, 4, 3, 2, 1, 0},
                                                    {3, 4, 5, 0, 1, 2}, {0, 3, 1, 4, 2, 5}, {3, 0, 4, 1, 5, 2},
                                                    {5, 2, 4, 1, 3, 0}, {2, 5, 1, 4, 0, 3}};
  for (int orientation = 1; orientation <= 8; ++orientation) {
    const tg::Image image = tg::turned(stored, orientation);
    CAPTURE(orientation);
    CHECK(image.width == (orientation < 5 ? 3 : 2));
    CHECK(image.data == expected[orientation - 1]);
  }
}

TEST_CASE("a cropped photograph has no known lens, and a broken block says nothing", "[photos]") {
  CHECK(tg::readExif(kBlock, 30, 40).focal_per_diagonal > 0);
  CHECK(tg::readExif(kBlock, 40, 40).focal_per_diagonal == 0);
  // COLMAP would find what is refused in a copy with the bytes of such a file.
  const tg::TemporaryFolder folder;
  const auto stored = [&](int width, int equivalent) {
    writeJpegWithExif(folder / "a.jpg", exifBlock({}, {{0xa002, 3, static_cast<std::uint32_t>(width)},
                                                       {0xa003, 3, 30},
                                                       {0xa405, 3, static_cast<std::uint32_t>(equivalent)}}));
    return tg::readPhotograph(folder / "a.jpg").as_stored != tg::PictureFormat::none;
  };
  CHECK(stored(40, 26));
  CHECK_FALSE(stored(60, 26));
  CHECK_FALSE(stored(40, 1));
  CHECK(stored(40, 0));
  for (std::size_t length = 0; length < kBlock.size(); ++length) {
    tg::readExif(std::span(kBlock).first(length), 40, 30);
  }
  for (std::size_t i = 0; i < kBlock.size(); ++i) {
    Bytes broken = kBlock;
    broken[i] = 0xff;
    const tg::ExifFacts facts = tg::readExif(broken, 40, 30);
    CHECK((facts.orientation >= 1 && facts.orientation <= 8));
  }
}

TEST_CASE("reduced photographs keep the mean of what each pixel covers", "[photos]") {
  const tg::Image image = picture();
  const tg::Image same = tg::reducedTo(image, 40, 30);
  CHECK(same.data == image.data);
  const tg::Image small = tg::reducedTo(image, 3, 2);
  REQUIRE(small.data.size() == 18);
  CHECK(small.at(0, 1, 0) == Approx(1).margin(1e-6));
  CHECK(small.at(1, 0, 0) == Approx(0.5).margin(1e-6));
  CHECK(small.at(1, 0, 2) == Approx(0.5).margin(1e-6));
  CHECK(small.at(2, 0, 0) == Approx(0).margin(1e-6));
}

TEST_CASE("what is transparent has no share in a reduced photograph's colour", "[photos]") {
  tg::Image image(2, 1, 4, 0.0f);
  image.data = {1, 0.5f, 0, 1, 0, 1, 1, 0};
  const tg::Image small = tg::reducedTo(image, 1, 1);
  CHECK(small.data == std::vector<float>{1, 0.5f, 0, 0.5f});
}

TEST_CASE("hostile photographs end in an error or in a picture, wherever they are cut or changed", "[photos]") {
  const tg::TemporaryFolder folder;
  writeJpegWithExif(folder / "a.jpg", kBlock);
  const Bytes whole = tg::readFile(folder / "a.jpg", 1 << 20);
  const auto decode = [](const Bytes& bytes) {
    try {
      const tg::TakenPhotograph photograph = tg::decodePhotograph(bytes, "hostile");
      CHECK(tg::hasImageShape(photograph.image));
    } catch (const tg::Error& error) {
      CHECK(error.kind == tg::ErrorKind::badData);
    }
  };
  for (std::size_t length = 0; length < whole.size(); length += 3) decode({whole.begin(), whole.begin() + length});
  for (std::size_t i = 0; i < whole.size(); i += 2) {
    Bytes changed = whole;
    changed[i] ^= 0x41;
    decode(changed);
  }
}

namespace {

void number(Bytes& bytes, std::size_t value, int count) {
  for (int k = count - 1; k >= 0; --k) bytes.push_back(static_cast<std::uint8_t>(value >> 8 * k));
}
Bytes box(const char* type, std::initializer_list<Bytes> parts) {
  Bytes content;
  for (const Bytes& part : parts) content.insert(content.end(), part.begin(), part.end());
  Bytes bytes;
  number(bytes, 8 + content.size(), 4);
  bytes.insert(bytes.end(), type, type + 4);
  bytes.insert(bytes.end(), content.begin(), content.end());
  return bytes;
}
Bytes heicOf(const Bytes& meta) {
  Bytes file = box("ftyp", {{'h', 'e', 'i', 'c', 0, 0, 0, 0, 'm', 'i', 'f', '1'}});
  file.insert(file.end(), meta.begin(), meta.end());
  return file;
}

}  // namespace

TEST_CASE("a HEIC whose pictures are made of each other is refused before libheif follows them", "[photos]") {
  // Each reference is a picture and one that it is made of; "auxl": an alpha and the picture that has it.
  struct Reference {
    const char* type;
    int from, to;
  };
  const auto heic = [](const std::vector<Reference>& references, bool wide = false) {
    Bytes iref = {wide, 0, 0, 0};
    for (const Reference& reference : references) {
      Bytes ends;
      number(ends, static_cast<std::size_t>(reference.from), wide ? 4 : 2);
      number(ends, 1, 2);
      number(ends, static_cast<std::size_t>(reference.to), wide ? 4 : 2);
      const Bytes entry = box(reference.type, {ends});
      iref.insert(iref.end(), entry.begin(), entry.end());
    }
    return heicOf(box("meta", {{0, 0, 0, 0}, box("iref", {iref})}));
  };
  const auto said = [](const Bytes& file) {
    return tg::test::messageOf([&] { tg::checkHeifReferences(file, "a.heic"); });
  };
  const std::string circle = "a.heic: broken HEIC: pictures are made of each other (expected at most 4, found 5)";
  CHECK(said(heic({{"dimg", 2, 2}})) == circle);
  CHECK(said(heic({{"dimg", 2, 2}}, true)) == circle);
  CHECK(said(heic({{"dimg", 1, 2}, {"dimg", 2, 3}, {"dimg", 3, 1}})) == circle);
  CHECK(said(heic({{"dimg", 1, 2}, {"auxl", 1, 2}})) == circle);
  CHECK(said(heic({{"dimg", 1, 2}, {"dimg", 2, 3}, {"dimg", 3, 4}, {"dimg", 4, 5}, {"dimg", 5, 6}})) == circle);
  CHECK(said(heic(std::vector<Reference>(65536, {"dimg", 1, 2}))) ==
        "a.heic: broken HEIC: too many references (expected at most 65536, found 65537)");
  // A grid of tiles, its alpha, a thumbnail and EXIF, as telephones write them.
  CHECK(said(heic({{"dimg", 1, 2}, {"dimg", 1, 3}, {"auxl", 4, 1}, {"dimg", 4, 5}, {"thmb", 6, 1}, {"cdsc", 7, 1}})) ==
        "accepted");
  CHECK(said(heic({{"thmb", 1, 1}})) == "accepted");
  // Cut anywhere it is no worse.
  Bytes cut = heic({{"dimg", 1, 2}, {"dimg", 1, 3}});
  for (; !cut.empty(); cut.pop_back()) CHECK(said(cut) == "accepted");
  CHECK_THROWS_WITH(tg::decodePhotograph(heic({{"dimg", 2, 2}}), "a.heic"), Contains("made of each other"));
}

TEST_CASE("pictures of a HEIC are as large as what their decoders go by says, whatever the file tells", "[photos]") {
  // An SPS of x265 for 1920 x 1088 and two temporal layers, and a sequence header of libaom for 1280 x 720.
  const Bytes sps = {0x42, 1,    2, 1, 0x60, 0, 0,    3,    0,    0x90, 0,    0,    3,    0,    0,    3,
                     0,    0x78, 0, 0, 0xa0, 3, 0xc0, 0x80, 0x11, 5,    0x96, 0x56, 0x62, 0xb3, 0x49, 0x26};
  const Bytes sequence = {0x12, 0, 0x0a, 0x0b, 0, 0, 0, 0x2d, 0x4c, 0xff, 0xb3, 0xcc, 0xaf, 0x90, 4};
  constexpr std::uint64_t kSps = 1920 * 1088, kSequence = 1280 * 720;
  // An item of these bytes in `idat`, in two parts, by version 1 of `iloc`; the parts come `times` times.
  const auto itemOf = [](const char* type, const Bytes& data, int times = 1) {
    Bytes entry = {2, 0, 0, 0, 0, 7, 0, 0};
    entry.insert(entry.end(), type, type + 4);
    Bytes iloc = {1, 0, 0, 0, 0x44, 0, 0, 1, 0, 7, 0, 1, 0, 0};
    number(iloc, static_cast<std::size_t>(2 * times), 2);
    for (int k = 0; k < times; ++k) {
      number(iloc, 0, 4), number(iloc, 3, 4);
      number(iloc, 3, 4), number(iloc, data.size() - 3, 4);
    }
    return heicOf(box("meta", {{0, 0, 0, 0},
                               box("iinf", {{0, 0, 0, 0, 0, 1}, box("infe", {entry})}),
                               box("idat", {data}),
                               box("iloc", {iloc})}));
  };
  const auto most = [](const Bytes& file) { return tg::largestHeifPicture(file, "a.heic"); };
  CHECK(most(itemOf("grid", {0, 0, 1, 1, 0x80, 0, 0x7f, 0xff})) == 0x8000ull * 0x7fff);
  CHECK(most(itemOf("grid", {0, 1, 1, 1, 0, 1, 0, 0, 0, 2, 0, 0})) == 0x10000ull * 0x20000);
  CHECK(most(itemOf("iovl", {0, 0, 9, 9, 9, 9, 9, 9, 9, 9, 1, 0, 2, 0, 0, 0, 0, 0})) == 256ull * 512);
  CHECK(most(itemOf("grid", {0, 0, 1, 1, 0x80, 0})) == 0);
  CHECK(most(itemOf("Exif", {0, 0, 1, 1, 0x80, 0, 0x7f, 0xff})) == 0);
  Bytes units = {0, 0, 0, 2, 0x40, 1, 0, 0, 0, static_cast<std::uint8_t>(sps.size())};
  units.insert(units.end(), sps.begin(), sps.end());
  CHECK(most(itemOf("hvc1", units)) == kSps);
  CHECK(most(itemOf("hev1", units)) == kSps);
  units[11] |= 8;  // of another layer, which the decoder passes over
  CHECK(most(itemOf("hvc1", units)) == 0);
  CHECK(most(itemOf("av01", sequence)) == kSequence);
  const Bytes still = {0x0a, 9, 0x18, 0x15, 0x7f, 0xfd, 0x82, 4, 4, 0x0d, 8};  // of 64 x 64
  CHECK(most(itemOf("av01", still)) == 64 * 64);
  // In properties.
  const auto propertyOf = [](const Bytes& property) {
    return heicOf(box("meta", {{0, 0, 0, 0}, box("iprp", {box("ipco", {property})})}));
  };
  const Bytes arrays = {1, 0x21, 0, 1, 0, static_cast<std::uint8_t>(sps.size())};
  CHECK(most(propertyOf(box("hvcC", {Bytes(22), arrays, sps}))) == kSps);
  CHECK(most(propertyOf(box("av1C", {Bytes(4), sequence}))) == kSequence);
  // Parts that are taken time and again, by one item or by those of many boxes `meta`.
  Bytes metas = itemOf("hvc1", Bytes(2000, 1));
  for (int k = 0; k < 40; ++k) {
    const Bytes whole = {1, 0, 0, 0, 0, 0, 0, 1, 0, 7, 0, 0, 0, 0, 0, 1};
    const Bytes meta =
        box("meta", {{0, 0, 0, 0},
                     box("iinf", {{0, 0, 0, 0, 0, 1}, box("infe", {{2, 0, 0, 0, 0, 7, 0, 0, 'h', 'v', 'c', '1'}})}),
                     box("iloc", {whole})});
    metas.insert(metas.end(), meta.begin(), meta.end());
  }
  CHECK_THROWS_WITH(most(metas), Contains("a.heic: broken HEIC: pictures share bytes"));
  CHECK_THROWS_WITH(most(itemOf("hvc1", Bytes(2000, 1), 40)), Contains("a.heic: broken HEIC: pictures share bytes"));
  // Cut anywhere it is no worse.
  for (Bytes cut = itemOf("av01", sequence); !cut.empty(); cut.pop_back()) CHECK(most(cut) <= kSequence);

  // Refused before libheif is asked.
  const auto said = [](const Bytes& file) {
    return tg::test::messageOf([&] { tg::decodePhotograph(file, "a.heic"); });
  };
  CHECK(said(itemOf("grid", {0, 0, 0, 0, 0x7f, 0xbc, 0x7f, 0xbc})) ==
        "a.heic: image size out of range (expected at most 268435456, found 1069290000)");
  CHECK_THAT(said(itemOf("grid", {0, 0, 0, 0, 0x34, 0x32, 0x39, 0x34})),
             Contains("a.heic: file is too short for its image size") && Contains("195673128 pixels"));
}

TEST_CASE("PNG, WebP and HEIC are photographs, too, and a transparent one keeps its alpha", "[photos]") {
  const tg::TemporaryFolder folder;
  tg::writeImage(folder / "a.png", picture());
  CHECK(tg::readPhotograph(folder / "a.png").image.data == picture().data);
  tg::BytePixels pixels(4, 2);
  for (std::size_t i = 0; i < pixels.data.size(); ++i) pixels.data[i] = i % 4 == 3 ? 255 : 51;
  tg::writeFileAtomically(folder / "a.webp", tg::encodeWebp(pixels));
  CHECK(tg::readPhotograph(folder / "a.webp").image.channels == 3);
  CHECK(tg::readPhotograph(folder / "a.webp").image.at(1, 1, 1) == Approx(0.2));
  pixels.data[3] = 0;
  tg::writeFileAtomically(folder / "b.webp", tg::encodeWebp(pixels));
  CHECK(tg::readPhotograph(folder / "b.webp").image.channels == 4);

  const auto encoder = tg::findProgram("heif-enc");
  TG_SKIP_IF(encoder ? "" : "no heif-enc");
  writeJpegWithExif(folder / "h.jpg", kBlock);
  const std::string name = (folder / "h").string();
  REQUIRE(std::system(
              (encoder->string() + " -q 90 '" + name + ".jpg' -o '" + name + ".heic' >/dev/null 2>&1").c_str()) == 0);
  const tg::TakenPhotograph heic = tg::readPhotograph(folder / "h.heic");
  CHECK(tg::pictureFormat(folder / "h.heic") == tg::PictureFormat::heif);
  CHECK(heic.facts.camera == "Phone Company Phone 7");
  CHECK(heic.image.width * heic.image.height == 1200);
}

namespace {

// A HEIC of 10 bits, grey of this signal all over, that says to be of BT.2020 and PQ. False: no encoder here.
bool writeHdrHeic(const fs::path& path, double signal) {
  const std::unique_ptr<heif_context, void (*)(heif_context*)> context(heif_context_alloc(), heif_context_free);
  heif_encoder* found = nullptr;
  if (heif_context_get_encoder_for_format(context.get(), heif_compression_HEVC, &found).code != 0) return false;
  const std::unique_ptr<heif_encoder, void (*)(heif_encoder*)> encoder(found, heif_encoder_release);
  heif_encoder_set_lossless(found, 1);
  heif_image* made = nullptr;
  REQUIRE(heif_image_create(64, 64, heif_colorspace_RGB, heif_chroma_interleaved_RRGGBB_LE, &made).code == 0);
  const std::unique_ptr<heif_image, void (*)(const heif_image*)> image(made, heif_image_release);
  REQUIRE(heif_image_add_plane(made, heif_channel_interleaved, 64, 64, 10).code == 0);
  int stride = 0;
  std::uint8_t* const plane = heif_image_get_plane(made, heif_channel_interleaved, &stride);
  const int value = static_cast<int>(std::lround(signal * 1023));
  for (int y = 0; y < 64; ++y) {
    for (int i = 0; i < 64 * 3; ++i) {
      plane[y * stride + 2 * i] = static_cast<std::uint8_t>(value);
      plane[y * stride + 2 * i + 1] = static_cast<std::uint8_t>(value >> 8);
    }
  }
  const std::unique_ptr<heif_color_profile_nclx, void (*)(heif_color_profile_nclx*)> profile(
      heif_nclx_color_profile_alloc(), heif_nclx_color_profile_free);
  profile->color_primaries = heif_color_primaries_ITU_R_BT_2020_2_and_2100_0;
  profile->transfer_characteristics = heif_transfer_characteristic_ITU_R_BT_2100_0_PQ;
  profile->matrix_coefficients = heif_matrix_coefficients_ITU_R_BT_2020_2_non_constant_luminance;
  REQUIRE(heif_image_set_nclx_color_profile(made, profile.get()).code == 0);
  const std::unique_ptr<heif_encoding_options, void (*)(heif_encoding_options*)> options(heif_encoding_options_alloc(),
                                                                                         heif_encoding_options_free);
  options->output_nclx_profile = profile.get();
  options->macOS_compatibility_workaround_no_nclx_profile = 0;
  REQUIRE(heif_context_encode_image(context.get(), made, found, options.get(), nullptr).code == 0);
  REQUIRE(heif_context_write_to_file(context.get(), path.c_str()).code == 0);
  return true;
}

}  // namespace

TEST_CASE("a HEIC in HDR becomes a picture of a common screen", "[photos]") {
  const tg::TemporaryFolder folder;
  // Paper white, whose signal 0.58 a reader that knows nothing of HDR keeps.
  const bool written = writeHdrHeic(folder / "h.heic", 0.5806889);
  TG_SKIP_IF(written ? "" : "no encoder of HEIC");
  const tg::TakenPhotograph hdr = tg::readPhotograph(folder / "h.heic");
  REQUIRE((hdr.image.width == 64 && hdr.image.channels == 3));
  for (int c = 0; c < 3; ++c) CHECK(hdr.image.at(30, 30, c) == Approx(std::pow(0.765, 1 / 2.4)).margin(0.01));
}

TEST_CASE("files are photographs by their bytes, and the others are named", "[photos]") {
  const tg::TemporaryFolder folder;
  for (const char* below : {"in", "in/sub", "in/.hidden", "in/__MACOSX", "in/old.photos"}) {
    fs::create_directory(folder / below);
  }
  for (const char* name :
       {"in/b.jpg", "in/sub/a.JPG", "in/.hidden/c.jpg", "in/__MACOSX/d.jpg", "in/old.photos/e.jpg"}) {
    tg::writeImage(folder / "t.jpg", picture());
    fs::copy_file(folder / "t.jpg", folder / name);
  }
  std::ofstream(folder / "in/old.photos/photos.json") << "{}";
  std::ofstream(folder / "in/notes.txt") << "hello";
  std::ofstream(folder / "in/fake.jpg") << "no picture";
  std::ofstream(folder / "in/empty.png");
  std::ofstream(folder / "in/a.txt") << "a text";
  std::ofstream(folder / "in/IMG_1.DNG") << "II*";
  std::ofstream(folder / "in/IMG_2.MOV") << "a film";
  const tg::PhotographList list = tg::findPhotographs(folder / "in");
  CHECK(list.photographs == std::vector<fs::path>{"b.jpg", "sub/a.JPG"});
  CHECK(list.ignored == std::vector<std::string>{"empty.png", "fake.jpg", "a.txt", "notes.txt"});
  CHECK(list.unread == std::vector<std::string>{"IMG_1.DNG"});
  CHECK(list.films == std::vector<std::string>{"IMG_2.MOV"});
  CHECK(tg::isForPhotos(folder / "in"));
  CHECK_FALSE(tg::isForPhotos(folder / "in/notes.txt"));
  std::ofstream(folder / "in/transforms.json") << "{}";
  CHECK_FALSE(tg::isForPhotos(folder / "in"));
}

namespace {

// Root may read everything: as somebody else while this is there.
class AsNobody {
 public:
  AsNobody() : works_(!is_root_ || ::setresuid(65534, 65534, 0) == 0) {}
  ~AsNobody() {
    if (is_root_ && works_) CHECK(::setresuid(0, 0, 0) == 0);
  }
  AsNobody& operator=(AsNobody&&) = delete;

  bool works() const { return works_; }

 private:
  const bool is_root_ = ::geteuid() == 0;
  const bool works_;
};

// Why nobody cannot stand for somebody who may not read all that is in a folder, which is opened to all. "": can.
std::string noNobody(const fs::path& folder) {
  fs::permissions(folder, fs::perms::all);
  const AsNobody nobody;
  if (!nobody.works()) return "root cannot become somebody else here";
  std::error_code error;
  const fs::directory_iterator entries(folder, error);
  return error ? "somebody else than root cannot list the temporary folder" : "";
}

// What is made is for all to read, whatever the process' own mask.
struct OpenMask {
  mode_t before = ::umask(022);
  ~OpenMask() { ::umask(before); }
};

}  // namespace

TEST_CASE("what may not be read is named apart from what is no photograph", "[photos]") {
  const OpenMask open;
  const tg::TemporaryFolder folder;
  TG_SKIP_IF(noNobody(folder.path));
  fs::create_directories(folder / "in/shut");
  for (const char* name : {"a.jpg", "b.jpg"}) tg::writeImage(folder / "in" / name, picture());
  std::ofstream(folder / "in/notes.txt") << "hello";
  for (const char* name : {"in/b.jpg", "in/shut"}) fs::permissions(folder / name, fs::perms::none);
  const auto list = [&] {
    const AsNobody nobody;
    return tg::findPhotographs(folder / "in");
  }();
  CHECK(list.photographs == std::vector<fs::path>{"a.jpg"});
  CHECK(list.closed == std::vector<std::string>{"b.jpg (Permission denied)", "shut (Permission denied)"});
  CHECK(list.ignored == std::vector<std::string>{"notes.txt"});
  const std::string few = tg::test::messageOf([&] {
    tg::PhotosOptions options;
    options.input = folder / "in";
    const AsNobody nobody;
    tg::checkInput(options);
  });
  CHECK_THAT(few, Contains("JPEG, PNG, WebP, HEIC or AVIF files") &&
                      Contains("found 1); cannot be read: b.jpg (Permission denied), shut (Permission denied); no "
                               "photographs by their bytes: notes.txt"));
}

namespace {

// The names of what is made of a folder's photographs, in out/ and masks/, and what is said of it.
std::pair<std::vector<std::string>, std::string> prepared(const tg::TemporaryFolder& folder, const char* input = "in",
                                                          int longest_side = 1600) {
  tg::PhotosOptions options;
  options.input = folder / input;
  options.longest_side = longest_side;
  for (const char* made : {"out", "masks"}) tg::makeEmpty(folder / made);
  std::pair<std::vector<std::string>, std::string> result;
  tg::PhotosListener listener;
  listener.say = listener.warn = [&](const std::string& line) { result.second += line + "\n"; };
  listener.progress = [](const std::string&, std::size_t, std::size_t) {};
  const std::atomic<int> stop{0};
  for (const tg::Prepared& photograph :
       tg::prepareImages(options, folder / "out", folder / "masks", folder / "log.txt", listener, stop)) {
    result.first.push_back(photograph.name);
  }
  return result;
}

}  // namespace

TEST_CASE("photographs that need nothing are copied byte by byte and others are written anew", "[photos]") {
  const tg::TemporaryFolder folder;
  fs::create_directory(folder / "in");
  tg::writeImage(folder / "in/a.png", picture());
  tg::writeFileAtomically(folder / "in/b.png", tg::encodePng16(picture()));
  tg::writeImage(folder / "in/c.jpg", picture());
  CHECK(prepared(folder).first == std::vector<std::string>{"a.png", "b.jpg", "c.jpg"});
  for (const char* name : {"a.png", "c.jpg"}) {
    CHECK(tg::readFile(folder / "in" / name, 1 << 20) == tg::readFile(folder / "out" / name, 1 << 20));
  }
  CHECK(prepared(folder, "in", 20).first == std::vector<std::string>{"a.jpg", "b.jpg", "c.jpg"});
}

TEST_CASE("masks go with their photographs and are turned with them", "[photos]") {
  const tg::TemporaryFolder folder;
  for (const char* below : {"in/images/sub", "in/masks/sub"}) fs::create_directories(folder / below);
  const auto mask = [&](const std::string& name, int width, int height) {
    tg::Image image(width, height, 1);
    for (int y = 0; y < height; ++y) image.at(0, y, 0) = 1;  // the left column counts
    tg::writeImage(folder / "in/masks" / name, image);
  };
  writeJpegWithExif(folder / "in/images/a.jpg", kBlock);  // 40 x 30 as it is stored, with orientation 6
  writeJpegWithExif(folder / "in/images/b.jpg", exifBlock({{0x112, 3, 6}}, {}));
  tg::writeImage(folder / "in/images/sub/c.png", picture());
  tg::writeImage(folder / "in/images/d.jpg", picture());
  mask("a.jpg.png", 40, 30);
  mask("b.png", 30, 40);
  mask("sub/c.png", 40, 30);
  mask("d.jpg.png", 39, 30);
  mask("e.jpg.png", 40, 30);
  const auto [names, said] = prepared(folder);
  CHECK(names == std::vector<std::string>{"images_a.jpg", "images_b.jpg", "images_d.jpg", "images_sub_c.png"});
  CHECK_THAT(said, Contains("3 of 4 photographs have a mask"));
  CHECK_THAT(said, Contains("in/masks/d.jpg.png: is of another size than its photograph (expected 40 x 30, found 39 x "
                            "30): left out"));
  CHECK_THAT(said, Contains("ignored, masks of no photograph: masks/e.jpg.png (expected "));
  const auto kept = [&](const std::string& name) { return tg::readImage(folder / "masks" / (name + ".png")); };
  CHECK(kept("images_a.jpg").width == 30);
  CHECK(kept("images_a.jpg").at(29, 0, 0) == 1);  // what was left is on top
  CHECK(kept("images_a.jpg").at(0, 39, 0) == 0);
  CHECK(kept("images_b.jpg").at(0, 39, 0) == 1);
  CHECK(kept("images_sub_c.png").at(0, 29, 0) == 1);
  CHECK_FALSE(fs::exists(folder / "masks/images_d.jpg.png"));
  // What is broken is named once.
  std::ofstream(folder / "in/masks/d.jpg.png") << "no picture";
  const std::string broken = prepared(folder).second;
  CHECK_THAT(broken, Contains("in/masks/d.jpg.png: ") && !Contains("ignored, no photographs"));
  CHECK(broken.find("d.jpg.png") == broken.rfind("d.jpg.png"));
  // Straight below the input, and beside one that is called images.
  tg::writeImage(folder / "in/f.jpg", tg::turned(picture(), 2));
  mask("f.jpg.mask.png", 40, 30);
  CHECK_THAT(prepared(folder).second, Contains("4 of 5 photographs have a mask"));
  CHECK_THAT(
      prepared(folder, "in/images").second,
      Contains("3 of 4 photographs have a mask") &&
          Contains("in/images: ignored, masks of no photograph: ../masks/e.jpg.png, ../masks/f.jpg.mask.png (exp"));
}

TEST_CASE("a mask that may not be read is named once", "[photos]") {
  const OpenMask open;
  const tg::TemporaryFolder folder;
  TG_SKIP_IF(noNobody(folder.path));
  fs::create_directories(folder / "in/masks");
  for (const int width : {40, 41, 42}) {
    tg::writeImage(folder / "in" / (std::to_string(width) + ".png"), tg::Image(width, 30, 3, 0.5f));
  }
  tg::writeImage(folder / "in/masks/40.png", tg::Image(40, 30, 1, 1.0f));
  std::ofstream(folder / "in/d.jpg") << "closed";
  for (const char* name : {"in/masks/40.png", "in/d.jpg"}) fs::permissions(folder / name, fs::perms::none);
  const AsNobody nobody;
  const std::string said = prepared(folder).second;
  CHECK_THAT(said, Contains("in/masks/40.png: cannot open: Permission denied: left out\n") &&
                       Contains("in: cannot be read: d.jpg (Permission denied)\n"));
  CHECK(said.find("40.png") == said.rfind("40.png"));
}

TEST_CASE("masks whose shape does not show how they lie do so as the others", "[photos]") {
  const tg::TemporaryFolder folder;
  for (const char* below : {"in", "in/masks"}) fs::create_directories(folder / below);
  const auto add = [&](const std::string& name, std::uint32_t orientation, int mask_width, int mask_height) {
    writeJpegWithExif(folder / "in" / (name + ".jpg"), exifBlock({{0x112, 3, orientation}}, {}));
    tg::Image mask(mask_width, mask_height, 1);
    mask.at(0, 0, 0) = 1;
    tg::writeImage(folder / "in/masks" / (name + ".png"), mask);
  };
  const auto kept = [&](const std::string& name, int x, int y) {
    return tg::readImage(folder / "masks" / (name + ".jpg.png")).at(x, y, 0) == 1;
  };
  add("a", 3, 40, 30);
  add("b", 2, 40, 30);
  add("c", 1, 40, 30);
  const std::string warning = "nothing shows whether they are upright already, masks: masks/a.png, masks/b.png (";
  CHECK_THAT(prepared(folder).second, Contains(warning) && Contains("3 of 3 photographs have a mask"));
  CHECK((kept("a", 39, 29) && kept("b", 39, 0) && kept("c", 0, 0)));
  fs::create_directory(folder / "set");
  fs::copy(folder / "in/masks", folder / "set/masks");
  fs::copy(folder / "in", folder / "set/images");
  CHECK_THAT(prepared(folder, "set/images").second, Contains("masks: ../masks/a.png, ../masks/b.png ("));
  add("d", 6, 40, 30);
  CHECK_THAT(prepared(folder).second, !Contains("nothing shows"));
  CHECK((kept("a", 39, 29) && kept("b", 39, 0) && kept("d", 29, 0)));
  add("d", 6, 30, 40);
  CHECK_THAT(prepared(folder).second, !Contains("nothing shows"));
  CHECK((kept("a", 0, 0) && kept("b", 0, 0) && kept("d", 0, 0)));
}

TEST_CASE("photographs and masks are the same however their folder is spelled", "[photos]") {
  const tg::TemporaryFolder folder;
  for (const char* below : {"in/images", "in/masks"}) fs::create_directories(folder / below);
  for (const char* name : {"a.png", "b.png", "c.png"}) tg::writeImage(folder / "in/images" / name, picture());
  tg::writeImage(folder / "in/masks/a.png", tg::Image(40, 30, 1, 1.0f));
  const auto madeOf = [](const fs::path& input) {
    tg::PhotosOptions options;
    options.input = input;
    return tg::madeOf(options);
  };
  for (const char* input : {"in", "in/images"}) {
    const std::string made = madeOf(folder / input);
    CHECK_THAT(made, Contains("masks/a.png ") && !Contains(folder.path.string()));
    CHECK(madeOf(folder / "in/.." / input) == made);
    CHECK(madeOf(folder / input / "") == made);
    CHECK(madeOf(fs::relative(folder / input)) == made);
  }
}

TEST_CASE("links to folders are followed once and never in circles", "[photos]") {
  const tg::TemporaryFolder folder;
  writePictures(folder.path, {"in/sub/a.jpg", "in/.hidden/d.jpg", "more/b.jpg", "more/deep/c.jpg"});
  fs::create_directory_symlink(".hidden", folder / "in/shown");
  fs::create_directory_symlink("../more", folder / "in/link");
  fs::create_directory_symlink("../more", folder / "in/link again");
  fs::create_directory_symlink("sub", folder / "in/own");
  fs::create_directory_symlink("../..", folder / "in/sub/up");
  fs::create_directory_symlink("../../in", folder / "more/deep/back");
  const tg::PhotographList list = tg::findPhotographs(folder / "in");
  CHECK(list.photographs == std::vector<fs::path>{"link/b.jpg", "link/deep/c.jpg", "sub/a.jpg"});
  const std::string why = " (a link to or above what is looked into anyway)";
  CHECK(list.ignored == std::vector<std::string>{"link again" + why, "link/deep/back" + why, "own" + why,
                                                 "shown (a link into what is left out)", "sub/up" + why});
}

TEST_CASE("a link to a folder around another that is linked gives what else is in it", "[photos]") {
  const tg::TemporaryFolder folder;
  writePictures(folder.path, {"in/a.jpg", "trip/b.jpg", "trip/best/c.jpg", "trip/other/d.jpg"});
  fs::create_directory_symlink("../trip/best", folder / "in/best");
  fs::create_directory_symlink("../trip", folder / "in/trip");
  fs::create_directory_symlink("../trip/other", folder / "in/within");
  fs::create_directory_symlink("../..", folder / "trip/other/up");
  const tg::PhotographList list = tg::findPhotographs(folder / "in");
  CHECK(list.photographs == std::vector<fs::path>{"a.jpg", "best/c.jpg", "trip/b.jpg", "trip/other/d.jpg"});
  const std::string why = " (a link to or above what is looked into anyway)";
  CHECK(list.ignored == std::vector<std::string>{"trip/other/up" + why, "within" + why});
}

TEST_CASE("a link to too many files is left out and a folder with them is an error", "[photos]") {
  const tg::TemporaryFolder folder;
  writePictures(folder.path, {"in/a.jpg", "in/b.jpg", "many/c.jpg", "many/d.jpg", "many/e.jpg", "more/f.jpg"});
  fs::create_directory_symlink("../many", folder / "in/many");
  fs::create_directory_symlink("../more", folder / "in/more");
  const tg::PhotographList list = tg::findPhotographs(folder / "in", 4);
  CHECK(list.photographs == std::vector<fs::path>{"a.jpg", "b.jpg", "more/f.jpg"});
  CHECK(list.ignored ==
        std::vector<std::string>{"many (a link that leads to too many files (expected at most 4, found 5))"});
  CHECK(tg::findPhotographs(folder / "in", 6).photographs.size() == 6);
  CHECK_THROWS_WITH(tg::findPhotographs(folder / "in", 1),
                    Contains("in: too many files (expected at most 1, found 2)"));
}

TEST_CASE("a photograph of another's bytes is its copy, one of its size alone is not", "[photos]") {
  const tg::TemporaryFolder folder;
  const auto put = [&](const std::string& name, const std::string& text) { std::ofstream(folder / name) << text; };
  put("a.jpg", std::string(200'000, 'x'));
  put("b.jpg", std::string(199'999, 'x') + "y");
  put("c.jpg", std::string(200'000, 'x'));
  put("d.jpg", std::string(199'999, 'x') + "y");
  put("e.jpg", "");
  put("f.jpg", "x");
  put("g.jpg", std::string(200'000, 'x'));
  std::vector<fs::path> photographs = {"a.jpg", "absent.jpg", "b.jpg", "c.jpg", "d.jpg", "e.jpg", "f.jpg", "g.jpg"};
  std::string copies;
  for (const auto& [copy, original] : tg::takeOutCopies(folder.path, photographs)) {
    copies += copy.string() + " of " + original.string() + "\n";
  }
  CHECK(copies == "c.jpg of a.jpg\nd.jpg of b.jpg\ng.jpg of a.jpg\n");
  CHECK(photographs == std::vector<fs::path>{"a.jpg", "absent.jpg", "b.jpg", "e.jpg", "f.jpg"});
}

TEST_CASE("one picture in two formats is one photograph, two pictures of one name are two", "[photos]") {
  const tg::TemporaryFolder folder;
  const auto put = [&](const std::string& name, int orientation, float light) {
    fs::create_directories((folder / "in" / name).parent_path());
    tg::Image image = tg::turned(picture(), orientation);
    for (float& value : image.data) value *= light;
    tg::writeImage(folder / "in" / name, image);
  };
  put("a.jpg", 1, 1);
  put("a.PNG", 1, 1);
  put("a 2.png", 1, 0.99f);  // another name
  put("sub/a.png", 1, 0.98f);
  put("b.jpg", 1, 0.97f);
  put("b.png", 2, 0.97f);  // another picture
  put("d.jpg", 1, 0.96f);
  put("d.png", 1, 0.7f);
  put("e.png", 6, 1);
  writeJpegWithExif(folder / "in/e.jpg", kBlock);  // is turned
  // Neither COLMAP nor the score should see a twin, but its mask counts.
  for (const char* name : {"a.PNG.png", "e.jpg.png", "e.png.png"}) {
    fs::create_directories(folder / "in/masks");
    tg::writeImage(folder / "in/masks" / name,
                   name[0] == 'a' ? tg::Image(40, 30, 1, 1.0f) : tg::Image(30, 40, 1, 1.0f));
  }
  const auto [names, said] = prepared(folder);
  CHECK(names ==
        std::vector<std::string>{"a.jpg", "a_2_2.png", "b.jpg", "b_2.png", "d.jpg", "d_2.png", "e.jpg", "sub_a.png"});
  CHECK_THAT(said, Contains("in: left out, copies in another format: a.PNG (of a.jpg), e.png (of e.jpg)\n"));
  CHECK_THAT(said, Contains("2 of 8 photographs have a mask"));
  CHECK((fs::exists(folder / "masks/a.jpg.png") && fs::exists(folder / "masks/e.jpg.png")));

  const auto encoder = tg::findProgram("heif-enc");
  TG_SKIP_IF(encoder ? "" : "no heif-enc");
  const std::string name = (folder / "in/a").string();
  REQUIRE(std::system(
              (encoder->string() + " -q 60 '" + name + ".jpg' -o '" + name + ".heic' >/dev/null 2>&1").c_str()) == 0);
  CHECK_THAT(prepared(folder).second, Contains("format: a.jpg (of a.heic), a.PNG (of a.heic), e.png (of e.jpg)\n"));
}

TEST_CASE("what was drawn or made among photographs is none of them, unless there are no others", "[photos]") {
  const tg::TemporaryFolder folder;
  writePictures(folder.path, {"a.jpg", "run/b.jpg", "run/previews/c.png", "scene/0/means_l.webp.jpg",
                              "scene/0/1_0/sh0.jpg", "metrics only/d.jpg", "masks/e.png"});
  std::ofstream(folder / "run/metrics.jsonl") << "{}";
  std::ofstream(folder / "metrics only/metrics.jsonl") << "{}";
  std::ofstream(folder / "run/checkpoint") << "bytes";
  fs::rename(folder / "scene/0/means_l.webp.jpg", folder / "scene/0/1_0/means_l.webp");
  for (const char* name : {"model.png", "a_2.jpg", "masks/f.png"}) tg::writeDrawn(folder / name, picture());
  tg::PhotographList list = tg::findPhotographs(folder.path);
  CHECK(list.photographs == std::vector<fs::path>{"a.jpg", "metrics only/d.jpg"});
  CHECK(list.drawn == std::vector<fs::path>{"a_2.jpg", "model.png"});
  CHECK(list.masks == std::vector<fs::path>{"masks/e.png", "masks/f.png"});
  // Pictures of a model on purpose, as photographs of a scene that there is not.
  fs::remove(folder / "a.jpg");
  fs::remove(folder / "metrics only/d.jpg");
  list = tg::findPhotographs(folder.path);
  CHECK(list.photographs == std::vector<fs::path>{"a_2.jpg", "model.png"});
  CHECK(list.drawn.empty());
}

TEST_CASE("pictures that were drawn are left out and named", "[photos]") {
  const tg::TemporaryFolder folder;
  for (int i = 0; i < 3; ++i) {
    writePictures(folder.path, {"in/a.png"});
    fs::rename(folder / "in/a.png", folder / ("in/" + std::to_string(i) + ".png"));
    std::ofstream(folder / ("in/" + std::to_string(i) + ".png"), std::ios::app) << i;  // no copies
  }
  tg::PhotosOptions options;
  options.input = folder / "in";
  const std::string made_of = tg::madeOf(options);
  tg::writeDrawn(folder / "in/model.png", tg::turned(picture(), 6));
  CHECK(tg::madeOf(options) == made_of);
  const auto [names, said] = prepared(folder);
  CHECK(names == std::vector<std::string>{"0.png", "1.png", "2.png"});
  CHECK_THAT(said, Contains("in: left out, 1 picture that a program of this project drew: model.png\n"));
  fs::remove(folder / "in/0.png");
  CHECK_THROWS_WITH(tg::madeOf(options), Contains("found 2); it holds 1 picture that a program of this project drew"));
}

TEST_CASE("photographs that are numbered without zeros stand in the order of their numbers", "[photos]") {
  const tg::TemporaryFolder folder;
  writePictures(folder.path, {"sub/t.jpg"});
  std::vector<fs::path> expected;
  for (int i = 1; i <= 300; ++i) {
    expected.push_back("IMG (" + std::to_string(i) + ").jpg");
    fs::create_hard_link(folder / "sub/t.jpg", folder / expected.back());
  }
  for (const char* name : {"sub 2/t.jpg", "sub 10/t.jpg", "IMG (9).png", "IMG (9)b.jpg"}) {
    fs::create_directories((folder / name).parent_path());
    fs::create_hard_link(folder / "sub/t.jpg", folder / name);
  }
  std::vector<fs::path> photographs = tg::findPhotographs(folder.path).photographs;
  REQUIRE(photographs.size() == 305);
  CHECK(photographs[9] == "IMG (9).png");
  CHECK(photographs[10] == "IMG (9)b.jpg");
  photographs.erase(photographs.begin() + 9, photographs.begin() + 11);
  CHECK(std::vector<fs::path>(photographs.end() - 3, photographs.end()) ==
        std::vector<fs::path>{"sub/t.jpg", "sub 2/t.jpg", "sub 10/t.jpg"});
  photographs.resize(300);
  CHECK(photographs == expected);  // so that sequentialPairs() has every (k, k + 1)
}

TEST_CASE("copies have plain names, each its own", "[photos]") {
  CHECK(tg::plainNames({"IMG 1.jpg", "IMG_1.JPG", "a/b'\n\".heic", "img_1.png"}) ==
        std::vector<std::string>{"IMG_1", "IMG_1_2", "a_b___", "img_1_3"});
  // Letters of UTF-8 stay. File systems that do not tell capitals apart do not do so beyond ASCII either.
  CHECK(tg::plainNames({"\xe7\x85\xa7\xe7\x89\x87 1.jpg", "\xc3\xa4.jpg", "\xc3\x84.jpg", "\xe4.jpg"}) ==
        std::vector<std::string>{"\xe7\x85\xa7\xe7\x89\x87_1", "\xc3\xa4", "\xc3\x84_2", "_"});
  tg::Prepared prepared;
  prepared.name = "\xc3\x84_2.jpg";
  prepared.width = prepared.height = 1;
  CHECK(tg::preparedFromJson(tg::toJson({prepared})).front().name == prepared.name);
  std::string many = "x";
  for (int i = 0; i < 50; ++i) many += "\xc3\xa4";
  CHECK(tg::plainNames({many + ".jpg"}).front() == many.substr(0, 79));
}
