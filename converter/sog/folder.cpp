// SPDX-License-Identifier: Apache-2.0
// SOG of a folder.
#include "converter/sog/folder.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <system_error>
#include <utility>
#include <vector>

#include "converter/sog/parts.h"
#include "core/bundle/ply.h"
#include "core/file/file.h"
#include "core/file/json.h"
#include "core/system/error.h"

namespace tg {

std::optional<std::string> nameInside(std::string_view name) {
  constexpr std::size_t kMostBytes = 1024;
  constexpr std::string_view kSigns = "_-./ ()+";
  if (name.starts_with("./")) name.remove_prefix(2);
  if (name.empty() || name.size() > kMostBytes) return {};
  char before = '/';
  for (const char c : name) {
    if (before == '/' && (c == '/' || c == '.')) return {};
    const bool plain = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9');
    const auto byte = static_cast<unsigned char>(c);
    const bool control = before == '\xc2' && byte < 0xa0;  // U+0080 to U+009F
    if (control || (!plain && byte < 0x80 && kSigns.find(c) == std::string_view::npos)) return {};
    before = c;
  }
  if (before == '/') return {};
  return std::string(name);
}

std::string leavesFolder(const std::string& name) {
  return "a file's name leaves the folder, or has other signs" +
         expectedFound("letters, digits, spaces, _ - . ( ) + and /", "\"" + name + "\"");
}

SogFiles filesInside(SogFiles read, std::string path) {
  return [read = std::move(read), path = std::move(path)](const std::string& name, std::uint64_t most) {
    const std::optional<std::string> inside = nameInside(name);
    if (!inside) throw Error(ErrorKind::badData, path, leavesFolder(name));
    return read(*inside, most);
  };
}

Bundle readSogFolder(const std::filesystem::path& meta, bool base_only) {
  const SogFiles files = [&](const std::string& name, std::uint64_t most) {
    return readRegularFile(name == kSogMetaName ? meta : meta.parent_path() / name, most);
  };
  const std::uint64_t most =
      std::max<std::uint64_t>(sog::kCountAlwaysAllowed, sog::kMostPerByte * bytesOfSogImages(meta));
  return parseSogFiles(filesInside(files, meta.string()), meta.string(), std::min(most, kMaxGaussians), base_only);
}

std::uint64_t bytesOfSogImages(const std::filesystem::path& meta) {
  const std::string path = meta.string();
  const nlohmann::json json = parseJson(readRegularFile(meta, sog::kMaxMetaBytes), path);
  std::set<std::string> names;
  for (const nlohmann::json& part : json) {
    const auto files = part.is_object() ? part.find("files") : part.end();
    if (files == part.end() || !files->is_array()) continue;
    for (const nlohmann::json& file : *files) {
      if (!file.is_string()) continue;
      if (const auto name = nameInside(file.get_ref<const std::string&>())) names.insert(*name);
    }
  }
  std::uint64_t bytes = 0;
  for (const std::string& name : names) {
    std::error_code missing;
    const std::uintmax_t size = std::filesystem::file_size(meta.parent_path() / name, missing);
    if (!missing) bytes += size;
  }
  return bytes;
}

}  // namespace tg
