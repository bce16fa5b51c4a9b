// SPDX-License-Identifier: Apache-2.0
// A page: the viewer's template, and in it a GLB, gzip, base64.
#include "converter/html/html.h"

#include <openssl/evp.h>
#include <zlib.h>

#include <algorithm>
#include <cctype>
#include <fstream>
#include <new>
#include <string>
#include <string_view>

#include "converter/formats/inflate.h"
#include "converter/formats/little_endian.h"
#include "converter/gltf/container.h"
#include "core/file/file.h"
#include "core/file/scratch_folder.h"
#include "core/system/error.h"

namespace tg {
namespace {

// Base64 turns 3 bytes into 4 characters; browsers limit strings, so that large models stand in many elements.
constexpr std::size_t kElementBytes = 3u << 20;
constexpr std::size_t kReadBytes = 1u << 20;
constexpr int kCompressionLevel = 6;
constexpr std::size_t kSizeDigits = 11;  // of base64 of a GLB

std::string escaped(const std::string& text) {
  std::string out;
  for (const char c : text) out += c == '&' ? "&amp;" : c == '<' ? "&lt;" : std::string(1, c);
  return out;
}

// Returns how many characters of base64 there are.
std::uint64_t writeElement(std::ofstream& out, const std::vector<std::uint8_t>& bytes) {
  if (bytes.empty()) return 0;
  std::vector<unsigned char> text((bytes.size() + 2) / 3 * 4 + 1);
  const int length = EVP_EncodeBlock(text.data(), bytes.data(), static_cast<int>(bytes.size()));
  out << kHtmlModelTag;
  out.write(reinterpret_cast<const char*>(text.data()), length);
  out << kHtmlModelEnd << '\n';
  return static_cast<std::uint64_t>(length);
}

// The whole of `in` as elements: their characters, or 0 when it cannot be read.
std::uint64_t writePayload(std::ofstream& out, std::ifstream& in) {
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
  std::uint64_t characters = 0;
  int status = Z_OK;
  while (status != Z_STREAM_END && out && !in.bad()) {
    if (stream.avail_in == 0 && !in.eof()) {
      in.read(plain.data(), static_cast<std::streamsize>(plain.size()));
      stream.next_in = reinterpret_cast<Bytef*>(plain.data());
      stream.avail_in = static_cast<uInt>(in.gcount());
    }
    status = deflate(&stream, in.eof() ? Z_FINISH : Z_NO_FLUSH);
    if (stream.avail_out == 0) {
      characters += writeElement(out, packed);
      restart();
    }
  }
  packed.resize(packed.size() - stream.avail_out);
  deflateEnd(&stream);
  characters += writeElement(out, packed);
  return in.bad() ? 0 : characters;
}

constexpr std::uint64_t kMaxPageBytes = std::uint64_t{8} << 30;  // base64 of the largest GLB, and room

std::vector<std::uint8_t> decodeBase64(std::string_view text, const std::string& path) {
  const auto broken = [&] { return Error(ErrorKind::badData, path, "the page's model is no base64"); };
  if (text.empty() || text.size() % 4 != 0 || text.size() > (1u << 30)) throw broken();
  std::vector<std::uint8_t> bytes(text.size() / 4 * 3);
  const int size =
      EVP_DecodeBlock(bytes.data(), reinterpret_cast<const unsigned char*>(text.data()), static_cast<int>(text.size()));
  if (size < 0) throw broken();
  const std::size_t padding = text.ends_with("==") ? 2 : text.ends_with("=") ? 1 : 0;  // decoded as zeros
  bytes.resize(static_cast<std::size_t>(size) - padding);
  return bytes;
}

// The gzip stream in the page.
std::vector<std::uint8_t> packedOf(std::span<const std::uint8_t> file, const std::string& path) {
  std::vector<std::uint8_t> packed;
  const std::string_view page(reinterpret_cast<const char*>(file.data()), file.size());
  for (std::size_t at = page.find(kHtmlModelTag); at != std::string_view::npos; at = page.find(kHtmlModelTag, at)) {
    at += kHtmlModelTag.size();
    const std::size_t end = page.find(kHtmlModelEnd, at);
    if (end == std::string_view::npos) throw Error(ErrorKind::badData, path, "the page ends early");
    const std::vector<std::uint8_t> bytes = decodeBase64(page.substr(at, end - at), path);
    packed.insert(packed.end(), bytes.begin(), bytes.end());
    at = end;
  }
  if (packed.empty()) {
    const bool streams = page.find(kHtmlStreamTag) != std::string_view::npos;
    throw Error(ErrorKind::badData, path,
                streams ? "the page holds no model, but streams one: read its lod-meta.json"
                        : "the page holds no model (expected one that tgconvert wrote)");
  }
  return packed;
}

std::vector<std::uint8_t> unpacked(const std::vector<std::uint8_t>& packed, const std::string& path) {
  GzipBytes stream(packed, path);
  std::vector<std::uint8_t> glb = stream.take(kGlbHeaderBytes, "the GLB's header");
  const std::uint64_t length = std::max<std::uint64_t>(readU32(glb, 8), kGlbHeaderBytes);
  const std::vector<std::uint8_t> rest = stream.take(length - kGlbHeaderBytes, "the GLB");
  glb.insert(glb.end(), rest.begin(), rest.end());
  if (!stream.takeRest(1).empty()) throw Error(ErrorKind::badData, path, "the page's GLB is longer than it says");
  return glb;
}

// The page around what stands at its @WORDS@.
struct PageParts {
  std::string_view before_title, before_bytes, before_payload, rest;
};

PageParts pageParts() {
  const std::string_view page = htmlPage();
  constexpr std::string_view kTitle = "@TITLE@", kBytes = "@BYTES@", kPayload = "@PAYLOAD@";
  const std::size_t title = page.find(kTitle), bytes = page.find(kBytes, title), payload = page.find(kPayload, bytes);
  return {page.substr(0, title), page.substr(title + kTitle.size(), bytes - title - kTitle.size()),
          page.substr(bytes + kBytes.size(), payload - bytes - kBytes.size()), page.substr(payload + kPayload.size())};
}

}  // namespace

// "/" between names, all but unreserved characters of RFC 3986 as %XX: nothing is left that a JSON string or an element
// would read otherwise.
std::string addressFrom(const std::filesystem::path& page, const std::filesystem::path& file) {
  const auto whole = [](const std::filesystem::path& path) {
    return std::filesystem::absolute(path).lexically_normal();
  };
  std::string address;
  for (const unsigned char c : whole(file).lexically_relative(whole(page).parent_path()).generic_string()) {
    if (std::isalnum(c) || std::string_view("-._~/").find(static_cast<char>(c)) != std::string_view::npos) {
      address += static_cast<char>(c);
    } else {
      constexpr std::string_view kDigits = "0123456789ABCDEF";
      address += {'%', kDigits[c >> 4], kDigits[c & 15]};
    }
  }
  return address;
}

void writeStreamingHtml(const std::filesystem::path& path, const std::string& address) {
  const PageParts page = pageParts();
  writeFileAtomically(path, [&](const std::filesystem::path& temporary) {
    std::ofstream out(temporary, std::ios::binary | std::ios::trunc);
    out << page.before_title << escaped(path.stem().string()) << page.before_bytes << 0 << page.before_payload
        << kHtmlStreamTag << '"' << address << '"' << kHtmlModelEnd << '\n'
        << page.rest;
    out.close();
    if (!out) throw Error(ErrorKind::cannotWrite, path.string(), "cannot be written: the disk is full");
  });
}

GltfReport writeHtml(const std::filesystem::path& path, const GltfContent& content) {
  const PageParts page = pageParts();
  GltfReport report;
  writeFileAtomically(path, [&](const std::filesystem::path& temporary) {
    const ScratchFile glb_file(temporary.string() + ".glb");
    GltfContent lean = content;
    lean.options.lean = true;
    // What the page's script does not read.
    const bool in_steps = lean.options.steps || lean.options.texture_step;  // which EXR is refused with
    if (lean.options.atlas == AtlasFormat::exr && !in_steps) lean.options.atlas = AtlasFormat::png16;
    try {
      report = writeGlb(glb_file.path(), lean);
    } catch (const Error& error) {
      if (error.kind == ErrorKind::cannotWrite) {
        throw Error(error.kind, path.string(), "cannot write the GLB that it holds: the disk may be full");
      }
      std::string said = error.what();
      const std::string hidden = printable(glb_file.path().string());
      if (said.starts_with(hidden)) said.replace(0, hidden.size(), path.string());
      throw Error(error.kind, said);
    }
    std::ifstream glb(glb_file.path(), std::ios::binary);
    // Once it is open: who is killed from here on leaves nothing behind, either.
    std::filesystem::remove(glb_file.path());

    std::ofstream out(temporary, std::ios::binary | std::ios::trunc);
    out << page.before_title << escaped(path.stem().string()) << page.before_bytes;
    const std::ofstream::pos_type size_place = out.tellp();  // what is known at the end
    out << std::string(kSizeDigits, ' ') << page.before_payload;
    const std::uint64_t characters = glb.good() ? writePayload(out, glb) : 0;
    out << page.rest;
    out.seekp(size_place);
    out << characters;
    out.close();
    if (!out) throw Error(ErrorKind::cannotWrite, path.string(), "cannot be written: the disk is full");
    if (characters == 0) throw Error(ErrorKind::cannotWrite, path.string(), "cannot read back the GLB that it holds");
    report.output_bytes = std::filesystem::file_size(temporary);
  });
  return report;
}

std::vector<std::uint8_t> parseHtmlGlb(std::span<const std::uint8_t> bytes, const std::string& path) {
  return unpacked(packedOf(bytes, path), path);
}

std::vector<std::uint8_t> readHtmlGlb(const std::filesystem::path& path) {
  return parseHtmlGlb(readFile(path, kMaxPageBytes), path.string());
}

}  // namespace tg
