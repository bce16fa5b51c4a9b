// SPDX-License-Identifier: Apache-2.0
// PLY: what other programs write is read, what is broken is refused by name.
#include <cmath>
#include <cstring>
#include <filesystem>

#include "core/bundle/ply.h"
#include "core/bundle/ply_vertices.h"
#include "core/bundle/splat_rows.h"
#include "core/file/file.h"
#include "core/model/verbs.h"
#include "core/system/error.h"
#include "core/tiny_model.h"
#include "support/catch.h"
#include "support/shared_files.h"
#include "support/temporary_folder.h"

using Bytes = std::vector<std::uint8_t>;

namespace {

Bytes toBytes(const std::string& text) { return {text.begin(), text.end()}; }

tg::GaussianModel parse(const std::string& text) { return tg::parseSplatPly(toBytes(text), "a.ply"); }

// Replaces the first `from` of an ASCII file.
std::string with(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  REQUIRE(at != text.npos);
  return text.replace(at, from.size(), to);
}

const std::string kAscii =
    "ply\nformat ascii 1.0\ncomment by hand\nelement vertex 2\n"
    "property float opacity\nproperty float x\nproperty float y\nproperty float z\nproperty double f_dc_0\n"
    "property float f_dc_1\nproperty float f_dc_2\nproperty uchar label\nproperty float scale_0\n"
    "property float scale_1\nproperty float scale_2\nproperty float rot_0\nproperty float rot_1\n"
    "property float rot_2\nproperty float rot_3\nend_header\n"
    "0.5 1 2 3 0.25 -0.5 +1e-2 7 -1 -2 -3 1 0 0 0\n"
    "-4 -1 -2 -3 1e-60 0 0 255 -1.5 -2.5 -3.5 0 1 0 0\n";

template <typename T>
void append(Bytes& bytes, T value, bool big) {
  std::uint8_t raw[sizeof(T)];
  std::memcpy(raw, &value, sizeof(T));
  for (std::size_t i = 0; i < sizeof(T); ++i) bytes.push_back(raw[big ? sizeof(T) - 1 - i : i]);
}

}  // namespace

TEST_CASE("a model survives PLY exactly at every SH degree") {
  for (int degree = 0; degree <= 3; ++degree) {
    const tg::GaussianModel model = tg::tinyModel(5, degree);
    const tg::GaussianModel back = tg::parseSplatPly(tg::formatSplatPly(model), "a.ply");
    REQUIRE(back.sh_degree == degree);
    REQUIRE(back == model);
  }
}

TEST_CASE("the written layout is INRIA's: 62 float properties at degree 3, channel-major rest coefficients") {
  tg::GaussianModel model = tg::tinyModel(1, 3);
  for (std::size_t k = 0; k < 16; ++k) model.sh[k] = glm::vec3(static_cast<float>(k)) + glm::vec3(100, 200, 300);
  const Bytes bytes = tg::formatSplatPly(model);
  const std::string text(bytes.begin(), bytes.end());
  std::size_t properties = 0;
  for (std::size_t at = text.find("property float"); at != text.npos; at = text.find("property float", at + 1)) {
    ++properties;
  }
  REQUIRE(properties == 62);
  const std::size_t body = text.find("end_header\n") + 11;
  REQUIRE(bytes.size() == body + 62 * 4);
  float row[62];
  std::memcpy(row, bytes.data() + body, sizeof(row));
  for (int k = 3; k < 6; ++k) REQUIRE(row[k] == 0.0f);  // nx ny nz
  REQUIRE(row[6] == 100.0f);                            // f_dc_0
  REQUIRE(row[9] == 101.0f);                            // f_rest_0: red of coefficient 1
  REQUIRE(row[9 + 15] == 201.0f);                       // f_rest_15: green of coefficient 1
  REQUIRE(row[9 + 44] == 315.0f);                       // f_rest_44: blue of coefficient 15
  REQUIRE(row[58] == model.rotation[0].x);              // rot_0 = w
}

TEST_CASE("an empty model is a valid PLY") { REQUIRE(tg::parseSplatPly(tg::formatSplatPly({}), "a.ply").size() == 0); }

TEST_CASE("ASCII in any property order, with extra properties, is read by name") {
  const tg::GaussianModel model = parse(kAscii);
  REQUIRE(model.size() == 2);
  REQUIRE(model.sh_degree == 0);
  REQUIRE(model.mean[0] == glm::vec3(1, 2, 3));
  REQUIRE(model.opacity_logit[0] == 0.5f);
  REQUIRE(model.sh[0] == glm::vec3(0.25f, -0.5f, 0.01f));
  REQUIRE(model.sh[1] == glm::vec3(0));
  REQUIRE(model.log_scale[1] == glm::vec3(-1.5f, -2.5f, -3.5f));
  REQUIRE(model.rotation[1] == glm::vec4(0, 1, 0, 0));
}

TEST_CASE("what Mip-Splatting stores without its filter is read as it is drawn") {
  const std::string text =
      with(with(with(kAscii, "uchar label", "float filter_3D"), "1e-2 7 ", "1e-2 0.5 "), " 255 ", " 0 ");
  const tg::GaussianModel stored = parse(kAscii), drawn = parse(text);
  double kept = 1;
  for (int axis = 0; axis < 3; ++axis) {
    const double variance = std::exp(2.0 * static_cast<double>(stored.log_scale[0][axis]));
    CHECK(static_cast<double>(drawn.log_scale[0][axis]) == Approx(0.5 * std::log(variance + 0.25)).epsilon(1e-6));
    kept *= variance / (variance + 0.25);
  }
  CHECK(tg::opacityOf(drawn, 0) == Approx(tg::opacityOf(stored, 0) * std::sqrt(kept)).epsilon(1e-6));
  CHECK(drawn.log_scale[1] == stored.log_scale[1]);
  CHECK(drawn.opacity_logit[1] == stored.opacity_logit[1]);
  for (const char* wrong : {"nan", "-0.5"}) {
    bool broken = false;
    tg::parseSplatPly(toBytes(with(text, "1e-2 0.5 ", std::string("1e-2 ") + wrong + " ")), "a.ply", &broken);
    CHECK(broken);
  }
}

TEST_CASE("Windows line ends are read") {
  std::string text;
  for (char c : kAscii) text += c == '\n' ? "\r\n" : std::string(1, c);
  REQUIRE(parse(text).mean[0] == glm::vec3(1, 2, 3));
}

TEST_CASE("big and little endian with doubles and an element before the vertices are read alike") {
  for (bool big : {false, true}) {
    std::string header = std::string("ply\nformat ") + (big ? "binary_big_endian" : "binary_little_endian") +
                         " 1.0\nelement camera 3\nproperty short id\nproperty uchar on\nelement vertex 1\n";
    for (const char* name : {"x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0", "scale_1", "scale_2",
                             "rot_0", "rot_1", "rot_2", "rot_3"}) {
      header += std::string("property ") + (name[0] == 's' ? "double " : "float ") + name + "\n";
    }
    header += "element face 1\nproperty list uchar int vertex_indices\nend_header\n";
    Bytes bytes = toBytes(header);
    bytes.insert(bytes.end(), 9, 0);
    for (int i = 0; i < 14; ++i) {
      if (i >= 7 && i < 10) {
        append(bytes, static_cast<double>(i + 1), big);
      } else {
        append(bytes, static_cast<float>(i + 1), big);
      }
    }
    bytes.push_back(0);  // the face: an empty list
    const tg::GaussianModel model = tg::parseSplatPly(bytes, "a.ply");
    REQUIRE(model.mean[0] == glm::vec3(1, 2, 3));
    REQUIRE(model.log_scale[0] == glm::vec3(8, 9, 10));
    REQUIRE(model.rotation[0] == glm::vec4(11, 12, 13, 14));
  }
}

TEST_CASE("a 2DGS file without scale_2 becomes flat: 1e-4 of the smaller scale") {
  std::string text = with(kAscii, "property float scale_2\n", "");
  text = with(with(text, "-1 -2 -3 1", "-2.25 -1 1"), "-1.5 -2.5 -3.5", "-1.5 -2.5");
  const tg::GaussianModel model = parse(text);
  REQUIRE(model.log_scale[0].z == Approx(-2.25 + std::log(1e-4)));
  REQUIRE(model.log_scale[1].z == Approx(-2.5 + std::log(1e-4)));
}

TEST_CASE("values that are not finite are refused with Gaussian and property") {
  REQUIRE_THROWS_WITH(parse(with(kAscii, "-4 -1", "nan -1")), Contains("a.ply: Gaussian 1: opacity is not finite"));
  REQUIRE_THROWS_WITH(parse(with(kAscii, "1 2 3", "1 inf 3")), Contains("Gaussian 0: y is not finite"));
  REQUIRE_THROWS_WITH(parse(with(kAscii, "1 2 3", "1 2 1e39")), Contains("Gaussian 0: z is not finite"));
  REQUIRE_THROWS_WITH(parse(with(kAscii, "1 2 3", "1 2 1e999")), Contains("Gaussian 0: z is not finite"));
  tg::GaussianModel model = tg::tinyModel(9000, 1);
  model.sh[8500 * 4 + 2].y = NAN;
  model.mean[4300].x = INFINITY;
  REQUIRE_THROWS_WITH(tg::parseSplatPly(tg::formatSplatPly(model), "b.ply"),
                      Contains("b.ply: Gaussian 4300: x is not finite"));
}

TEST_CASE("a quaternion of length zero is refused") {
  REQUIRE_THROWS_WITH(parse(with(kAscii, "0 1 0 0\n", "0 0 0 0\n")), Contains("Gaussian 1: rotation"));
}

TEST_CASE("every truncation of a binary and of an ASCII file is refused") {
  for (const Bytes& good : {tg::formatSplatPly(tg::tinyModel(2, 1)), toBytes(kAscii)}) {
    // The last byte of the ASCII file is a line end: not needed; and a shorter last number is still a number.
    const std::size_t end = good.size() - (good == toBytes(kAscii) ? 2 : 0);
    for (std::size_t length = 0; length < end; ++length) {
      REQUIRE_THROWS_AS(tg::parseSplatPly(std::span(good).first(length), "cut.ply"), tg::Error);
    }
  }
}

TEST_CASE("every flipped bit gives a model or tg::Error") {
  for (const Bytes& good : {tg::formatSplatPly(tg::tinyModel(1, 0)), toBytes(kAscii)}) {
    for (std::size_t i = 0; i < good.size() * 8; ++i) {
      Bytes bad = good;
      bad[i / 8] ^= static_cast<std::uint8_t>(1u << (i % 8));
      try {
        tg::checkModel(tg::parseSplatPly(bad, "flipped.ply"), "flipped.ply");
      } catch (const tg::Error&) {
      }
    }
  }
}

TEST_CASE("bytes beyond the last vertex are passed over in a binary file, refused in a text and in a bundle") {
  Bytes bytes = tg::formatSplatPly(tg::tinyModel(2, 0));
  bytes.insert(bytes.end(), {1, 2, 3});
  CHECK(tg::parseSplatPly(bytes, "a.ply").mean == tg::tinyModel(2, 0).mean);
  CHECK(tg::SplatRows(bytes, bytes.size(), "a.ply").trailing() == 3);
  tg::SplatStream stream(bytes.size(), "a.tgz");
  REQUIRE_THROWS_WITH((stream.add(bytes), stream.finish()), Contains("longer than its counts"));
  REQUIRE_THROWS_WITH(parse(kAscii + "5\n"), Contains("longer than its counts"));
  REQUIRE_NOTHROW(parse(kAscii + " \n\n"));
}

TEST_CASE("hostile headers are refused before anything is allocated") {
  const auto vertexCount = [](const std::string& count) { return with(kAscii, "vertex 2", "vertex " + count); };
  for (const char* count : {"3", "63999999", "64000001", "4294967296", "18446744073709551615", "99999999999999999999",
                            "-1", "2x", "", "0x2"}) {
    REQUIRE_THROWS_AS(parse(vertexCount(count)), tg::Error);
  }
  const Bytes binary = tg::formatSplatPly(tg::tinyModel(1, 0));
  const std::string text(binary.begin(), binary.end());
  // 2^63 / 17 and so on: products with the stride would wrap.
  for (const char* count : {"2", "64000000", "542551296285575048", "271275648142787524", "18446744073709551615"}) {
    REQUIRE_THROWS_AS(parse(with(text, "vertex 1", std::string("vertex ") + count)), tg::Error);
  }
  REQUIRE_THROWS_AS(
      parse(with(kAscii, "element vertex 2\n", "element a 99999999999\nproperty int b\nelement vertex 2\n")),
      tg::Error);
  REQUIRE_THROWS_WITH(parse(with(kAscii, "property float x", "property list uchar float x")),
                      Contains("list property"));
  REQUIRE_THROWS_WITH(parse(with(kAscii, "property float x", "property quad x")), Contains("unknown property type"));
  REQUIRE_THROWS_WITH(parse(with(kAscii, "property float x", "property float y")), Contains("given twice"));
  REQUIRE_THROWS_AS(parse(with(kAscii, "property float x", "property float")), tg::Error);
  REQUIRE_THROWS_AS(parse(with(kAscii, "ascii", "utf8")), tg::Error);
  REQUIRE_THROWS_AS(parse(with(kAscii, "1.0", "2.0")), tg::Error);
  REQUIRE_THROWS_AS(parse(with(kAscii, "format ascii 1.0\n", "")), tg::Error);
  REQUIRE_THROWS_AS(parse(with(kAscii, "comment", "banana")), tg::Error);
  REQUIRE_THROWS_AS(parse(with(kAscii, "vertex", "vortex")), tg::Error);
  REQUIRE_THROWS_AS(parse("ply\n" + std::string(2 << 20, ' ') + "\nend_header\n"), tg::Error);
  REQUIRE_THROWS_AS(parse(""), tg::Error);
  REQUIRE_THROWS_AS(parse("PNG"), tg::Error);
}

TEST_CASE("words that are no numbers are refused with vertex and property") {
  REQUIRE_THROWS_WITH(parse(with(kAscii, "1 2 3", "1 two 3")), Contains("Gaussian 0: y is no number (found \"two\")"));
  for (const char* word : {"2x", "--2", "+-2", "0x10", "1,5", "."}) {
    REQUIRE_THROWS_AS(parse(with(kAscii, "1 2 3", std::string("1 ") + word + " 3")), tg::Error);
  }
}

TEST_CASE("a missing property and a wrong number of coefficients are named") {
  REQUIRE_THROWS_WITH(parse(with(kAscii, " opacity", " o")), Contains("missing property opacity"));
  REQUIRE_THROWS_WITH(parse(with(kAscii, " rot_3", " r")), Contains("missing property rot_3"));
  REQUIRE_THROWS_WITH(parse(with(kAscii, " label", " f_rest_0")), Contains("expected 0, 9, 24 or 45, found 1"));
}

TEST_CASE("elements are known by name, and words of 32 bits are read as they are") {
  for (bool big : {false, true}) {
    Bytes bytes = toBytes(std::string("ply\nformat ") + (big ? "binary_big_endian" : "binary_little_endian") +
                          " 1.0\nelement vertex 2\nproperty float x\nproperty uint bits\nelement sh 0\n"
                          "property uchar c\nend_header\n");
    for (std::uint32_t i : {1u, 2u}) {
      append(bytes, static_cast<float>(i), big);
      append(bytes, 0xfffffff0u + i, big);
    }
    const tg::PlyVertices ply(bytes, "a.ply", "point");
    CHECK((ply.hasElement("vertex") && ply.hasElement("sh")));
    CHECK_FALSE(ply.hasElement("chunk"));
    const int bits = ply.requireWord("bits");
    CHECK(ply.word(0, bits) == 0xfffffff1u);
    CHECK(ply.word(1, bits) == 0xfffffff2u);
    CHECK_THROWS_WITH(ply.requireWord("x"), Contains("expected uint in a binary file"));
  }
}

TEST_CASE("a point cloud and a compressed PLY are refused as splats with a clear message") {
  const std::string cloud =
      "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\n"
      "property uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n1 2 3 255 0 51\n";
  REQUIRE_THROWS_WITH(parse(cloud), Contains("is a point cloud, not splats"));
  REQUIRE_THROWS_WITH(parse(with(cloud, "red", "diffuse_red")), Contains("is a point cloud, not splats"));
  REQUIRE_THROWS_WITH(parse(with(cloud, "red", "r")), Contains("holds no splats (missing property f_dc_0)"));
  REQUIRE_THROWS_WITH(parse(with(cloud, "float x", "uint packed_position")), Contains("compressed splat PLY"));

  const tg::TemporaryFolder folder;
  tg::writeFileAtomically(folder / "cloud.ply", toBytes(cloud));
  const tg::PointCloud points = tg::readPointCloudPly(folder / "cloud.ply");
  REQUIRE(points.position == std::vector<glm::vec3>{{1, 2, 3}});
  REQUIRE(points.color[0].x == 1.0f);
  REQUIRE(points.color[0].z == 0.2f);  // as COLMAP's colours and those of arrays: the float that is nearest
}

TEST_CASE("a point cloud without colours is grey, one with float colours keeps them") {
  const tg::TemporaryFolder folder;
  const std::string head =
      "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\n";
  tg::writeFileAtomically(folder / "a.ply", toBytes(head + "end_header\n1 2 3\n"));
  REQUIRE(tg::readPointCloudPly(folder / "a.ply").color[0] == glm::vec3(0.5f));
  tg::writeFileAtomically(folder / "b.ply",
                          toBytes(head + "property float red\nproperty float green\nproperty float blue\n"
                                         "end_header\n1 2 3 0.25 0.5 2\n"));
  REQUIRE(tg::readPointCloudPly(folder / "b.ply").color[0] == glm::vec3(0.25f, 0.5f, 1.0f));
}

TEST_CASE("a point cloud whose colours come first has them, and one with two of the three is grey") {
  const tg::TemporaryFolder folder;
  const std::string head =
      "ply\nformat ascii 1.0\nelement vertex 1\nproperty ushort red\nproperty ushort green\nproperty ushort blue\n"
      "property float x\nproperty float y\nproperty float z\nend_header\n65535 0 13107 1 2 3\n";
  tg::writeFileAtomically(folder / "a.ply", toBytes(head));
  const tg::PointCloud points = tg::readPointCloudPly(folder / "a.ply");
  REQUIRE(points.position == std::vector<glm::vec3>{{1, 2, 3}});
  REQUIRE(points.color[0].x == 1.0f);
  REQUIRE(points.color[0].z == Approx(0.2f));
  for (const char* name : {"red", "green", "blue"}) {
    tg::writeFileAtomically(folder / "a.ply", toBytes(with(head, name, "other")));
    REQUIRE(tg::readPointCloudPly(folder / "a.ply").color[0] == glm::vec3(0.5f));
  }
  for (const char* first : {"green", "blue"}) {  // columns 0 to 2 in another order: the first is no less a column
    tg::writeFileAtomically(folder / "a.ply",
                            toBytes(with(with(with(head, "red", "other"), first, "red"), "other", first)));
    REQUIRE(tg::readPointCloudPly(folder / "a.ply").color[0][first[0] == 'g' ? 1 : 2] == 1.0f);
  }
}

TEST_CASE("splat PLYs of other programs are read") {
  TG_SKIP_IF(tg::test::missingShared({"samples/playbot", "samples/jsplat", "samples/gsplat-rs"}));
  const std::filesystem::path samples = tg::test::sharedFile("samples");
  struct Expected {
    const char* file;
    std::size_t count;
    int degree;
  };
  for (const Expected& e : {Expected{"playbot/playbot_lod3.ply", 31000, 2},
                            {"playbot/playbot_lod4.ply", 8406, 2},
                            {"jsplat/unitCube-ascii.ply", 20, 0},
                            {"gsplat-rs/minimal_ascii.ply", 3, 0},
                            {"gsplat-rs/minimal_binary.ply", 3, 0}}) {
    INFO(e.file);
    const tg::GaussianModel model = tg::readSplatPly(samples / e.file);
    REQUIRE(model.size() == e.count);
    REQUIRE(model.sh_degree == e.degree);
    const Bytes written = tg::formatSplatPly(model);
    REQUIRE(tg::formatSplatPly(tg::parseSplatPly(written, "again")) == written);
  }
  const tg::GaussianModel ascii = tg::readSplatPly(samples / "gsplat-rs/minimal_ascii.ply");
  const tg::GaussianModel binary = tg::readSplatPly(samples / "gsplat-rs/minimal_binary.ply");
  REQUIRE(ascii.sh == binary.sh);
  REQUIRE(ascii.mean == binary.mean);
}

TEST_CASE("point clouds of the data sets are read") {
  TG_SKIP_IF(tg::test::missingShared({"data/printshop", "data/fox_270", "data/lego_400"}));
  const std::filesystem::path data = tg::test::sharedFile("data");
  REQUIRE(tg::readPointCloudPly(data / "printshop/points3d.ply").position.size() == 40000);
  REQUIRE(tg::readPointCloudPly(data / "printshop/mesh.ply").position.size() == 86206);
  REQUIRE(tg::readPointCloudPly(data / "fox_270/points3d.ply").position.size() == 16412);
  REQUIRE(tg::readPointCloudPly(data / "lego_400/points3d_hull.ply").position.size() > 0);
}
