// SPDX-License-Identifier: Apache-2.0
// Writes a model as a page: the viewer's template, and in it a GLB, gzip, base64.
#include "converter/html/write_html.h"

#include <openssl/evp.h>
#include <zlib.h>

#include <fstream>
#include <new>
#include <string>
#include <string_view>
#include <vector>

#include "converter/html/html_page.h"
#include "core/file/file.h"
#include "core/system/error.h"

namespace tg {
namespace {

// Base64 turns 3 bytes into 4 characters; browsers limit strings, so that large models stand in many elements.
constexpr std::size_t kElementBytes = 3u << 20;
constexpr std::size_t kReadBytes = 1u << 20;
constexpr int kCompressionLevel = 6;

std::string escaped(const std::string& text) {
  std::string out;
  for (const char c : text) {
    switch (c) {
      case '&':
        out += "&amp;";
        break;
      case '<':
        out += "&lt;";
        break;
      default:
        out += c;
    }
  }
  return out;
}

void writeElement(std::ofstream& out, const std::vector<std::uint8_t>& bytes) {
  if (bytes.empty()) return;
  std::vector<unsigned char> text((bytes.size() + 2) / 3 * 4 + 1);
  const int length = EVP_EncodeBlock(text.data(), bytes.data(), static_cast<int>(bytes.size()));
  out << kHtmlModelTag;
  out.write(reinterpret_cast<const char*>(text.data()), length);
  out << kHtmlModelEnd << '\n';
}

// The whole of `in` as elements. False when it cannot be read.
bool writePayload(std::ofstream& out, std::ifstream& in) {
  z_stream stream{};
  if (deflateInit2(&stream, kCompressionLevel, Z_DEFLATED, 15 + 16, 8, Z_DEFAULT_STRATEGY) != Z_OK) {
    throw std::bad_alloc();
  }
  std::vector<char> plain(kReadBytes);
  std::vector<std::uint8_t> packed(kElementBytes);
  const auto restart = [&] {
    stream.next_out = packed.data();
    stream.avail_out = static_cast<uInt>(packed.size());
  };
  restart();
  int status = Z_OK;
  while (status != Z_STREAM_END && out) {
    if (stream.avail_in == 0 && !in.eof()) {
      in.read(plain.data(), static_cast<std::streamsize>(plain.size()));
      stream.next_in = reinterpret_cast<Bytef*>(plain.data());
      stream.avail_in = static_cast<uInt>(in.gcount());
    }
    status = deflate(&stream, in.eof() ? Z_FINISH : Z_NO_FLUSH);
    if (stream.avail_out == 0) {
      writeElement(out, packed);
      restart();
    }
  }
  packed.resize(packed.size() - stream.avail_out);
  deflateEnd(&stream);
  writeElement(out, packed);
  return !in.bad();
}

}  // namespace

GltfReport writeHtml(const std::filesystem::path& path, const GltfContent& content) {
  const std::string page(htmlPage());
  const auto split = [&](std::string_view mark, std::size_t from) { return page.find(mark, from); };
  constexpr std::string_view kTitle = "@TITLE@", kPayload = "@PAYLOAD@";
  const std::size_t title = split(kTitle, 0), payload = split(kPayload, title);

  GltfReport report;
  writeFileAtomically(path, [&](const std::filesystem::path& temporary) {
    // The GLB has no name any more once it is open: whatever happens, nothing is left behind.
    const std::filesystem::path glb_path = temporary.string() + ".glb";
    GltfContent lean = content;
    lean.lean = true;
    // What the page's script does not read.
    if (lean.atlas == AtlasFormat::exr) lean.atlas = AtlasFormat::png16;
    lean.meshopt = false;
    try {
      report = writeGlb(glb_path, lean);
    } catch (const Error& error) {
      if (error.kind != ErrorKind::cannotWrite) throw;
      throw Error(error.kind, path.string(), "cannot write the GLB that it holds: the disk may be full");
    }
    std::ifstream glb(glb_path, std::ios::binary);
    std::filesystem::remove(glb_path);

    std::ofstream out(temporary, std::ios::binary | std::ios::trunc);
    out << std::string_view(page).substr(0, title) << escaped(path.stem().string())
        << std::string_view(page).substr(title + kTitle.size(), payload - title - kTitle.size());
    const bool read = glb.good() && writePayload(out, glb);
    out << std::string_view(page).substr(payload + kPayload.size());
    out.close();
    if (!read || !out) throw Error(ErrorKind::cannotWrite, path.string(), "cannot be written: the disk is full");
    report.bytes = std::filesystem::file_size(temporary);
  });
  return report;
}

}  // namespace tg
