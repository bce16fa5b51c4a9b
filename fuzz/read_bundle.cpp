// SPDX-License-Identifier: Apache-2.0
// Any tar is a bundle or an Error. The input is the tar itself: a fuzzer cannot guess gzip's checksum, nor SHA-256, so
// half of the inputs are wrapped with a manifest that fits their entries.
#include <zlib.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "core/bundle/bundle.h"
#include "core/file/scratch_folder.h"
#include "core/file/sha256.h"
#include "core/system/error.h"

namespace {

using Bytes = std::vector<std::uint8_t>;

Bytes gzip(const Bytes& bytes) {
  z_stream stream{};
  // Stored: what is packed is not looked at.
  if (deflateInit2(&stream, Z_NO_COMPRESSION, Z_DEFLATED, 31, 8, Z_DEFAULT_STRATEGY) != Z_OK) std::abort();
  Bytes packed(deflateBound(&stream, bytes.size()) + 64);
  stream.next_in = const_cast<std::uint8_t*>(bytes.data());
  stream.avail_in = static_cast<uInt>(bytes.size());
  stream.next_out = packed.data();
  stream.avail_out = static_cast<uInt>(packed.size());
  if (deflate(&stream, Z_FINISH) != Z_STREAM_END) std::abort();
  packed.resize(packed.size() - stream.avail_out);
  deflateEnd(&stream);
  return packed;
}

void appendEntry(Bytes& tar, const std::string& name, const Bytes& content) {
  char header[512] = {};
  std::snprintf(header, 100, "%s", name.c_str());
  std::snprintf(header + 100, 8, "0000644");
  std::snprintf(header + 124, 12, "%011zo", content.size());
  std::snprintf(header + 257, 8, "ustar");
  header[263] = header[264] = '0';
  header[156] = '0';
  unsigned sum = 8 * ' ';
  for (char c : header) sum += static_cast<unsigned char>(c);
  std::snprintf(header + 148, 8, "%06o", sum);
  tar.insert(tar.end(), header, header + 512);
  tar.insert(tar.end(), content.begin(), content.end());
  tar.resize((tar.size() + 511) / 512 * 512);
}

// Six blocks, each preceded by its length in two bytes, become the entries of a bundle of 2 Gaussians and a 4 x 4 page.
Bytes tarOfBlocks(const std::uint8_t* data, std::size_t size) {
  const char* names[] = {"gaussians.ply", "rects.npy", "atlas_id.npy", "atlas_000.exr", "cameras.json", "preview.png"};
  std::string files;
  Bytes entries;
  for (const char* name : names) {
    std::size_t length = size >= 2 ? static_cast<std::size_t>(data[0] | data[1] << 8) : 0;
    if (size >= 2) data += 2, size -= 2;
    length = std::min(length, size);
    const Bytes content(data, data + length);
    data += length, size -= length;
    if (!files.empty()) files += ",";
    files += std::string("{\"name\":\"") + name + "\",\"bytes\":" + std::to_string(length) + ",\"sha256\":\"" +
             tg::sha256Hex(content) + "\"}";
    appendEntry(entries, name, content);
  }
  const std::string manifest =
      "{\"format\":\"textured-gaussians\",\"formatVersion\":\"1.0\",\"counts\":{\"gaussians\":2,\"atlasPages\":1,"
      "\"cameras\":1},\"shDegree\":0,\"mode\":\"rgba\",\"intersection\":\"plane\",\"extent\":3,\"filter\":\"bilinear\","
      "\"sampling\":\"corner\",\"outside\":\"base\",\"uvOrder\":\"axisIndex\",\"axes\":\"rdf\",\"antialias\":\"none\","
      "\"colorSpace\":\"srgb_rec709_display\",\"background\":[0,0,0],\"atlas\":{\"width\":4,\"height\":4},\"files\":[" +
      files + "]}";
  Bytes tar;
  appendEntry(tar, "manifest.json", Bytes(manifest.begin(), manifest.end()));
  tar.insert(tar.end(), entries.begin(), entries.end());
  tar.resize(tar.size() + 1024);
  return tar;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const tg::ScratchFolder folder;
  const std::filesystem::path file = folder.path() / "fuzz.tgz";
  const bool blocks = size > 0 && data[0] == 'B';
  const Bytes packed = gzip(blocks ? tarOfBlocks(data + 1, size - 1) : Bytes(data, data + size));
  std::ofstream(file, std::ios::binary)
      .write(reinterpret_cast<const char*>(packed.data()), static_cast<std::streamsize>(packed.size()));
  tg::BundleLimits limits;
  limits.entry_bytes = limits.total_bytes = std::uint64_t{64} << 20;
  limits.max_texels = 1 << 20;
  try {
    const tg::Bundle bundle = tg::readBundle(file, limits);
    tg::checkModel(bundle.model, "fuzz.tgz");
  } catch (const tg::Error&) {
  }
  return 0;
}
