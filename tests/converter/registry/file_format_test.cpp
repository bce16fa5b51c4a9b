// SPDX-License-Identifier: Apache-2.0
// Which reader a file goes to, and what the refusals say.
#include "converter/registry/file_format.h"

#include <unistd.h>

#include <initializer_list>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "converter/lod/lod_scene.h"
#include "converter/scratch.h"
#include "converter/sog/folder.h"
#include "converter/splat_files.h"
#include "core/file/file.h"
#include "core/model/verbs.h"
#include "core/system/error.h"
#include "support/catch.h"
#include "support/message_of.h"
#include "support/scenes.h"

using namespace tg;

TEST_CASE("a file's first bytes choose its reader, not its name") {
  const Scratch scratch;
  REQUIRE(detectFormat(scratch.write("a.glb", "ply\nformat ascii 1.0\n")).name == "ply");
  REQUIRE(detectFormat(scratch.write("a.ply", std::string("glTF\2\0\0\0", 8))).name == "glb");
  REQUIRE(detectFormat(scratch.write("a.splat", "\n {\"asset\": {}}")).name == "gltf");
  REQUIRE(detectFormat(scratch.write("a.bin", "NGSP....")).name == "spz");
  REQUIRE(detectFormat(scratch.write("b.tgz", gzipped("NGSP...."))).name == "spz");
  REQUIRE(detectFormat(scratch.write("b.ply", "ply\nelement vertex 1\nproperty uint packed_position\n")).name ==
          "compressed.ply");
  REQUIRE(detectFormat(scratch.write("b.splat", std::string(32, '\1'))).name == "splat");
  REQUIRE(detectFormat(scratch.write("c.splat", "{" + std::string(31, '\1'))).name == "splat");
  REQUIRE(detectFormat(scratch.write("d.splat", "{\"" + std::string(30, '\1'))).name == "splat");
  REQUIRE(detectFormat(scratch.write("c.ksplat", "{" + std::string(31, '\1'))).name == "ksplat");
  REQUIRE(detectFormat(scratch.write("c.glb", "\xef\xbb\xbf{\n\t}")).name == "gltf");
  REQUIRE(detectFormat(scratch.write("b.ksplat", std::string(32, '\1'))).name == "ksplat");
  REQUIRE(detectFormat(scratch.write("b.glb", "PK\3\4")).name == "sog");
  REQUIRE(detectFormat(scratch.write("a.txt", std::string("\x1f\x8b\x08\0", 4))).name == "tgz");
  REQUIRE(detectFormat(scratch.write("e.splat", "\x1f\x8b\x80\x3f" + std::string(28, '\1'))).name == "splat");
  std::string comments;
  for (int i = 0; i < 200; ++i) comments += "comment " + std::string(80, 'c') + "\n";
  REQUIRE(detectFormat(scratch.write("c.ply", "ply\n" + comments + "property uint packed_position\n")).name ==
          "compressed.ply");
}

TEST_CASE("a PLY is compressed by a property of its header alone however long that is") {
  const Scratch scratch;
  const auto format = [&](const std::string& lines) {
    return detectFormat(scratch.write("a.ply", "ply\n" + lines)).name;
  };
  const std::string property = "property uint packed_position\n";
  CHECK(format("comment made from packed_position data\nproperty float x\nend_header\n") == "ply");
  CHECK(format("comment " + property + "property float x\nend_header\n") == "ply");
  CHECK(format("property float packed_position_x\nend_header\n") == "ply");
  CHECK(format("property float x\nend_header\n" + property) == "ply");
  CHECK(format("element vertex 1\r\n  property  uint\tpacked_position\r\nend_header\r\n") == "compressed.ply");
  std::string comments;
  for (int i = 0; i < 1200; ++i) comments += "comment " + std::string(80, 'c') + "\n";
  CHECK(format(comments + property + "end_header\n") == "compressed.ply");
}

TEST_CASE("what a JSON is follows from the keys of its outermost object wherever they stand") {
  const Scratch scratch;
  const auto format = [&](const std::string& text) { return detectFormat(scratch.write("a.json", text)).name; };
  for (const std::string key : {"lodLevels", "filenames", "geometricError", "means\": 1, \"scales"}) {
    CAPTURE(key);
    CHECK(format(R"({"asset": {"version": "2.0"}, "extras": {")" + key + R"(": 1}, "nodes": []})") == "gltf");
    CHECK(format(R"({"extras": [{"\")" + key + R"(": 1}], "extensions": ")" + key + R"("})") == "gltf");
  }
  const std::string extras = R"("extras": {"accessors": [], "a": ")" + std::string(200'000, 'x') + "\"}";
  CHECK(format("{" + extras + R"(, "geometricError": 1, "root": {}})") == "tileset.json");
  CHECK(format("{" + extras + R"(, "lodLevels": 1})") == kLodMetaName);
  CHECK(format(R"({"filenames": [], )" + extras + "}") == kLodMetaName);
  CHECK(format(R"({"filenames": [], )" + extras + R"(, "meshes": []})") == "gltf");
  for (const std::string own : {R"("scene": {"name": "garden"})", R"("scenes": [])", R"("nodes": 1)"}) {
    CAPTURE(own);
    CHECK(format("{" + own + R"(, "means": {}, "scales": {}})") == kSogMetaName);
    CHECK(format(R"({"means": {}, )" + own + R"(, "scales": {}})") == kSogMetaName);
    CHECK(format("{" + own + R"(, "lodLevels": 1})") == kLodMetaName);
    CHECK(format("{" + own + R"(, "geometricError": 1})") == "tileset.json");
    CHECK(format("{" + own + "}") == "gltf");
  }
  // A SOG that lacks some of its keys is one all the same.
  for (const std::string keys :
       {R"("scales": {}, "quats": {})", R"("sh0": {}, "means": {})", R"("quats": 1, "sh0": 1)"}) {
    CAPTURE(keys);
    CHECK(format(R"({"version": 2, "count": 1, )" + keys + "}") == kSogMetaName);
  }
  CHECK(format(R"({"means": {}, "means": {}})") == "gltf");
  // Two of its keys decide nothing where another format's own comes later.
  const std::string of_sog = R"({"means": {}, "scales": {}, "filenames": [], )";
  CHECK(format(of_sog + R"("a": 1})") == kSogMetaName);
  CHECK(format(of_sog + R"("lodLevels": 1})") == kLodMetaName);
  CHECK(format(of_sog + R"("geometricError": 1})") == "tileset.json");
  CHECK(format(of_sog + R"("accessors": []})") == "gltf");
  CHECK(format("{" + extras + R"(} "lodLevels": 1)") == "gltf");
}

TEST_CASE("of a JSON no more is read than says what it is in pieces of any size") {
  const std::string text = R"({"a\"": [{"b": "}"}], "lodLevels": 3, "filenames": []})";
  for (std::size_t size = 1; size < text.size(); ++size) {
    JsonKindReader reader;
    std::size_t read = 0;
    for (bool known = false; !known; read += size) known = reader.add(std::string_view(text).substr(read, size));
    CHECK(reader.kind() == JsonKind::levels);
    CHECK(read < text.find("lodLevels") + std::string_view("lodLevels\"").size() + size);
  }
}

TEST_CASE("what a JSON is does not depend on where its bytes are cut into pieces") {
  const auto kindOf = [](std::initializer_list<std::string_view> pieces) {
    JsonKindReader reader;
    for (const std::string_view piece : pieces) (void)reader.add(piece);
    return reader.kind();
  };
  const std::vector<std::pair<std::string_view, JsonKind>> texts = {
      {R"({"x\\\"": "\\", "scales": {"a": "]"}, "b": ["{"], "means": 1})", JsonKind::sog},
      {R"({"a": {"meshes": 1}, "\"lodLevels": 2, "geometricError": 3})", JsonKind::tileset},
      {R"({"filenames": ["\"}", "meshes", {}], "x": "geometricError"})", JsonKind::levels},
      {R"({"m\u0065ans": 1, "scales": 2, "a": "\\\"means\": "})", JsonKind::gltf},
      {R"({"buffers": [], "lodLevels": 1})", JsonKind::gltf},
      {R"({"means": {}} "scales": "lodLevels)", JsonKind::gltf}};
  for (const auto& [text, kind] : texts) {
    for (std::size_t first = 0; first <= text.size(); ++first) {
      for (std::size_t second = first; second <= text.size(); ++second) {
        CAPTURE(text, first, second);
        CHECK(kindOf({text.substr(0, first), text.substr(first, second - first), text.substr(second)}) == kind);
      }
    }
  }
}

TEST_CASE("a name's case says nothing of its format") {
  const Scratch scratch;
  REQUIRE(detectFormat(scratch.write("a.SPLAT", std::string(32, '\1'))).name == "splat");
  REQUIRE(outputFormat("a.GLB").name == "glb");
  REQUIRE(outputFormat("A.Compressed.PLY").name == "compressed.ply");
  REQUIRE(modelFormat("LOD-meta.json").name == kLodMetaName);
  REQUIRE(isLodMeta("LOD-meta.json"));
}

TEST_CASE("what is no readable file is refused with exit code 2") {
  const Scratch scratch;
  const auto kind = [](const std::filesystem::path& path) {
    try {
      readModel(path);
    } catch (const Error& error) {
      return exitCode(error);
    }
    return 0;
  };
  CHECK(kind(scratch.folder()) == 2);
  CHECK(kind(scratch.folder() / "missing.glb") == 2);
  CHECK(kind("http://127.0.0.1/a.sog") == 2);
  CHECK_THAT(test::messageOf([] { readModel("http://127.0.0.1/a.sog"); }),
             Contains("http://127.0.0.1/a.sog: is an address (expected a file, "));
}

TEST_CASE("a file that may not be read says why") {
  const Scratch scratch;
  std::filesystem::create_directory(scratch.folder() / "folder");
  const std::filesystem::path file = scratch.write("a.ply", "ply\n"), inside = scratch.write("folder/a.ply", "ply\n");
  std::filesystem::permissions(file, std::filesystem::perms::none);
  std::filesystem::permissions(file.parent_path(), std::filesystem::perms(0755));
  std::filesystem::permissions(inside.parent_path(), std::filesystem::perms::none);
  const uid_t user = ::geteuid();
  if (user == 0) REQUIRE(::seteuid(65534) == 0);  // nothing is kept from root
  const std::string shut = test::messageOf([&] { detectFormat(file); }, ErrorKind::cannotRead);
  const std::string hidden = test::messageOf([&] { detectFormat(inside); }, ErrorKind::cannotRead);
  if (user == 0) REQUIRE(::seteuid(0) == 0);
  std::filesystem::permissions(inside.parent_path(), std::filesystem::perms::owner_all);
  CHECK(shut == file.string() + ": cannot open: Permission denied");
  CHECK(hidden == inside.string() + ": cannot open: Permission denied");
}

TEST_CASE("what is no model is refused with exit code 3 and what it could be") {
  const Scratch scratch;
  const auto refusal = [](const std::filesystem::path& path) {
    return test::messageOf([&] { detectFormat(path); }).substr(path.string().size());
  };
  CHECK(refusal(scratch.write("empty.glb", "")) == ": the file is empty");
  CHECK(refusal(scratch.write("a.bin", "hello")) ==
        ": is no splat model (expected a " + listed(inputNames()) + " file)");
}

TEST_CASE("the rows of the table of formats agree with themselves") {
  std::set<std::string_view> names;
  for (const Format& format : formats()) {
    CAPTURE(format.name);
    CHECK(names.insert(format.name).second);
    CHECK(format.spoken.empty() == !format.read);
    CHECK((format.keeps == kKeepsAll || !format.title.empty() || !format.read || !format.write));
    CHECK(findFormat(format.name) == &format);
    CHECK((!format.sniff || format.read));
    CHECK((!format.is_gltf || format.has_base));
    CHECK((!format.has_base || format.holds(kKeepsTextures) || format.name == "tileset.json"));
    CHECK((!format.streams || format.write));
    if (format.write) CHECK(&outputFormat("a." + std::string(format.name)) == &format);
  }
  CHECK(findFormat("obj") == nullptr);
  CHECK(listed({"a"}) == "a");
  CHECK(listed({"a", "b", "c"}) == "a, b or c");
}

TEST_CASE("every format that is written is read again with what its row says that it keeps") {
  const Scratch scratch;
  const test::TestScene scene = test::makeScene(test::SceneKind::ordinary, 11, 40);
  Bundle source;
  source.model = scene.model;
  source.cameras = source.views = {scene.camera};
  REQUIRE(source.model.sh_degree > 0);
  for (const Format& format : formats()) {
    if (!format.write) continue;
    CAPTURE(format.name);
    const std::filesystem::path path = scratch.folder() / ("a." + std::string(format.name));
    Written written;
    writeModel(format, path, source, {}, written);
    CHECK(written.texture_mode == name(format.holds(kKeepsTextures) ? source.model.texture_mode : TextureMode::none));
    if (!format.read) continue;
    CHECK(&detectFormat(path) == &format);
    const Bundle back = readModel(path);
    CHECK(back.format == format.name);
    CHECK(back.model.size() == source.model.size());
    CHECK((back.model.texture_mode == source.model.texture_mode) == format.holds(kKeepsTextures));
    CHECK(back.cameras.size() == (format.holds(kKeepsCameras) ? 1 : 0));
    CHECK(back.views.size() == (format.holds(kKeepsViews) ? 1 : 0));
    CHECK(back.model.sh_degree == (format.holds(kKeepsSh) ? source.model.sh_degree : 0));
    CHECK(written.warnings.empty() == ((format.keeps | kKeepsFloats) == kKeepsAll || !format.read));
    const bool baked = std::ranges::any_of(
        written.warnings, [](const std::string& w) { return w.find(" holds no textures: ") != std::string::npos; });
    CHECK(baked != format.holds(kKeepsTextures));
  }
}

TEST_CASE("cameras that a file of the format cannot hold are told before anything is made of them") {
  std::vector<Camera> cameras(40);
  for (Camera& camera : cameras) {
    camera = lookAt({0, 0, -4}, {0, 0, 0}, {0, -1, 0}, 0.8, 64, 48);
    camera.name.assign(1 << 20, 'n');
  }
  for (const std::string path : {"a.tgz", "lod-meta.json"}) {
    CHECK_THROWS_WITH(requireStorable(modelFormat(path), path, cameras),
                      Contains(path + ": 40 cameras make a cameras.json that is too large (expected at most 33554432"));
  }
  CHECK_NOTHROW(requireStorable(modelFormat("a.glb"), "a.glb", cameras));
  cameras.resize(2);
  CHECK_NOTHROW(requireStorable(modelFormat("a.tgz"), "a.tgz", cameras));
}

TEST_CASE("textures of which nothing is left in the steps of a file are missed with a warning") {
  const Scratch scratch;
  Bundle source;
  source.model = test::makeScene(test::SceneKind::ordinary, 11, 40).model;
  const auto warns = [&] {
    Written written;
    writeModel(outputFormat("a.sog"), scratch.folder() / "a.sog", source, {.steps = 16.0f, .replace = true}, written);
    return std::ranges::any_of(written.warnings,
                               [](const std::string& w) { return w.starts_with("nothing is left of the textures"); });
  };
  CHECK_FALSE(warns());
  for (glm::vec4& texel : source.model.atlas.texels) texel = glm::mix(glm::vec4(0, 0, 0, 1), texel, 0.01f);
  CHECK(warns());
  source.model = withoutTextures(source.model);
  CHECK_FALSE(warns());
}

TEST_CASE("an intersection model that a file does not name is a warning, and no other is") {
  const Scratch scratch;
  Bundle source;
  source.model = test::makeScene(test::SceneKind::ordinary, 12, 20).model;
  source.model.intersection = IntersectionModel::plane;
  for (const bool textured : {true, false}) {
    if (!textured) source.model = withoutTextures(source.model);
    for (const Format& format : formats()) {
      if (!format.write || !format.read) continue;
      CAPTURE(format.name, textured);
      const std::filesystem::path path = scratch.folder() / ((textured ? "a." : "b.") + std::string(format.name));
      Written written;
      writeModel(format, path, source, {}, written);
      const bool warned = std::ranges::any_of(written.warnings, [](const std::string& warning) {
        return warning.ends_with(" has no word for the intersection model plane: it becomes maxResponse");
      });
      CHECK(warned == (readModel(path).model.intersection != IntersectionModel::plane));
    }
  }
}

TEST_CASE("the documents say of every format what its row says") {
  const auto textOf = [](const char* file) {
    const std::vector<std::uint8_t> bytes = readFile(file, 1 << 20);
    return std::string(bytes.begin(), bytes.end());
  };
  const auto needs = [](const std::string& file, const std::string& text, const std::string& what) {
    INFO(file << " needs: " << what);
    CHECK((text.find(what) != std::string::npos));
  };
  const std::string text = textOf("docs/formats.md"), hostile = textOf("SECURITY.md");
  const std::string named = text.substr(0, text.find("What a file can hold"));
  const auto yes = [](bool value) { return value ? " yes |" : " no |"; };
  for (const Format& format : formats()) {
    if (!format.read) continue;
    const std::string_view extension = format.name.substr(format.whole_name ? 0 : format.name.rfind('.') + 1);
    const std::string word = (format.whole_name ? "`" : ".") + std::string(extension) + "`";
    needs("SECURITY.md, under \"What is hostile\",", hostile, word);
    needs("docs/formats.md, in its first table,", named, word);
    const std::string line = "| " + std::string(format.name) + " |" + yes(format.write) +
                             yes(format.holds(kKeepsTextures)) + yes(format.holds(kKeepsCameras)) +
                             (format.holds(kKeepsSh) ? " 0 to " + std::to_string(format.sh_degree) + " |" : " 0 |") +
                             (format.holds(kKeepsFloats) ? " floats |" : " few bits |");
    needs("docs/formats.md", text, "\n" + line + "\n");
  }
  const std::string manual = textOf("docs/converter.md");
  for (const bool read : {true, false}) {
    for (const std::string& output : outputNames(read)) {
      needs("docs/converter.md", manual, "." + output);
    }
  }
}
