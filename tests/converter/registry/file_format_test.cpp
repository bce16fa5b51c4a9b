// SPDX-License-Identifier: Apache-2.0
// Which reader a file goes to, and what the refusals say.
#include "converter/registry/file_format.h"

#include <string>

#include "converter/registry/read_model.h"
#include "converter/scratch.h"
#include "converter/splat_files.h"
#include "core/system/error.h"
#include "support/catch.h"

using namespace tg;

TEST_CASE("a file's first bytes choose its reader, not its name") {
  const Scratch scratch;
  REQUIRE(detectFormat(scratch.write("a.glb", "ply\nformat ascii 1.0\n")) == FileFormat::ply);
  REQUIRE(detectFormat(scratch.write("a.ply", std::string("glTF\2\0\0\0", 8))) == FileFormat::glb);
  REQUIRE(detectFormat(scratch.write("a.splat", "\n {\"asset\": {}}")) == FileFormat::gltf);
  REQUIRE(detectFormat(scratch.write("a.bin", "NGSP....")) == FileFormat::spz);
  REQUIRE(detectFormat(scratch.write("b.tgz", gzipped("NGSP...."))) == FileFormat::spz);
  REQUIRE(detectFormat(scratch.write("b.ply", "ply\nelement vertex 1\nproperty uint packed_position\n")) ==
          FileFormat::compressedPly);
  REQUIRE(detectFormat(scratch.write("b.splat", std::string(32, '\1'))) == FileFormat::splat);
  REQUIRE(detectFormat(scratch.write("a.txt", std::string("\x1f\x8b\x08\0", 4))) == FileFormat::bundle);
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
}

TEST_CASE("unsupported formats are named and refused with exit code 3") {
  const Scratch scratch;
  const auto refusal = [](const std::filesystem::path& path) -> std::string {
    try {
      detectFormat(path);
    } catch (const Error& error) {
      REQUIRE(error.kind == ErrorKind::badData);
      return std::string(error.what()).substr(path.string().size());
    }
    return "accepted";
  };
  const std::string unsupported = " is not supported yet (tgz, ply, compressed ply, splat, spz, glb, gltf and our html are)";
  CHECK(refusal(scratch.write("empty.glb", "")) == ": the file is empty");
  CHECK(refusal(scratch.write("a.ksplat", std::string(4096, '\0'))) == ": the .ksplat format" + unsupported);
  CHECK(refusal(scratch.write("a.sog", "PK\3\4")) == ": the SOG format" + unsupported);
  CHECK(refusal(scratch.write("a.bin", "hello")) ==
        ": is no splat model (expected a tgz, ply, splat, spz, glb, gltf or our html file)");
}
