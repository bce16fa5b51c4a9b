// SPDX-License-Identifier: Apache-2.0
// Takes the model out of a page that writeHtml made.
#include "converter/html/read_html.h"

#include <openssl/evp.h>

#include <algorithm>
#include <cstring>
#include <string>
#include <string_view>

#include "converter/formats/inflate.h"
#include "converter/html/html_page.h"
#include "core/file/file.h"
#include "core/system/error.h"

namespace tg {
namespace {

constexpr std::uint64_t kMaxPageBytes = std::uint64_t{8} << 30;  // base64 of the largest GLB, and room
constexpr std::size_t kGlbHeader = 12;

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
    throw Error(ErrorKind::badData, path, "the page holds no model (expected one that tgconvert wrote)");
  }
  return packed;
}

std::vector<std::uint8_t> unpacked(const std::vector<std::uint8_t>& packed, const std::string& path) {
  GzipBytes stream(packed, path);
  std::vector<std::uint8_t> glb = stream.take(kGlbHeader, "the GLB's header");
  std::uint32_t length = 0;
  std::memcpy(&length, glb.data() + 8, sizeof(length));
  const std::vector<std::uint8_t> rest =
      stream.take(std::max<std::uint64_t>(length, kGlbHeader) - kGlbHeader, "the GLB");
  glb.insert(glb.end(), rest.begin(), rest.end());
  if (stream.skipRest(1) != 0) throw Error(ErrorKind::badData, path, "the page's GLB is longer than it says");
  return glb;
}

}  // namespace

std::vector<std::uint8_t> parseHtmlGlb(std::span<const std::uint8_t> bytes, const std::string& path) {
  return unpacked(packedOf(bytes, path), path);
}

std::vector<std::uint8_t> readHtmlGlb(const std::filesystem::path& path) {
  return unpacked(packedOf(readFile(path, kMaxPageBytes), path.string()), path.string());
}

}  // namespace tg
