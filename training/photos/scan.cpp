// SPDX-License-Identifier: Apache-2.0
// A folder's files, sniffed.
#include "training/photos/scan.h"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <fstream>
#include <functional>
#include <initializer_list>
#include <iterator>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <string_view>
#include <utility>

#include "core/file/file.h"
#include "core/image/drawn.h"
#include "core/run/live.h"
#include "core/system/error.h"
#include "core/system/lower_case.h"
#include "training/data/dataset.h"
#include "training/photos/ledger.h"

namespace tg {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kLongestName = 80;

bool isHidden(const fs::path& path) {
  const std::string name = path.filename().string();
  return name.starts_with(".") || name == "__MACOSX" || name == "Thumbs.db" || name == "desktop.ini";
}

// Of a container of ISO's kind that holds a still picture.
bool isHeifBrand(std::string_view brand) {
  constexpr std::array<std::string_view, 8> brands = {"heic", "heix", "heim", "heis", "mif1", "msf1", "hevc", "avif"};
  return std::ranges::find(brands, brand) != brands.end();
}

bool hasExtension(const fs::path& path, std::initializer_list<std::string_view> extensions) {
  return std::ranges::find(extensions, lowerExtension(path)) != extensions.end();
}
bool isFilmName(const fs::path& path) {
  return hasExtension(path, {".mp4", ".mov", ".m4v", ".mkv", ".webm", ".avi", ".3gp", ".mpg"});
}
bool isPhotographName(const fs::path& path) {
  return hasExtension(path, {".jpg", ".jpeg", ".png", ".webp", ".heic", ".heif", ".hif", ".avif"});
}
bool isUnreadName(const fs::path& path) {
  return hasExtension(path, {".dng", ".cr2", ".cr3", ".crw", ".nef", ".nrw", ".arw", ".srw", ".raf", ".orf", ".rw2",
                             ".pef", ".x3f", ".iiq", ".3fr", ".tif", ".tiff", ".jxl"});
}

// Of all its bytes; none for a file that cannot be read.
std::optional<std::size_t> hashOf(const fs::path& file) {
  std::ifstream stream(file, std::ios::binary);
  if (!stream) return std::nullopt;
  std::vector<char> bytes(1 << 16);
  std::size_t hash = 0;
  while (stream.read(bytes.data(), static_cast<std::streamsize>(bytes.size())) || stream.gcount() > 0) {
    const std::string_view piece(bytes.data(), static_cast<std::size_t>(stream.gcount()));
    hash = hash * 31 + std::hash<std::string_view>()(piece);
  }
  return hash;
}

// Its first bytes, of the mark of pictures that were drawn, too; none for a file that cannot be read.
std::vector<std::uint8_t> startOf(const fs::path& file) {
  if (!isFile(file)) return {};
  std::vector<std::uint8_t> start(kDrawnBytes);
  std::ifstream stream(file, std::ios::binary);
  stream.read(reinterpret_cast<char*>(start.data()), static_cast<std::streamsize>(start.size()));
  start.resize(static_cast<std::size_t>(stream.gcount()));
  return start;
}

bool holdTheSame(const fs::path& a, const fs::path& b) {
  std::ifstream first(a, std::ios::binary), second(b, std::ios::binary);
  using Characters = std::istreambuf_iterator<char>;
  return std::equal(Characters(first), Characters(), Characters(second), Characters());
}

}  // namespace

PictureFormat pictureFormat(const fs::path& file) { return pictureFormat(startOf(file)); }

PictureFormat pictureFormat(std::span<const std::uint8_t> start) {
  const std::string_view bytes(reinterpret_cast<const char*>(start.data()), std::min<std::size_t>(start.size(), 12));
  if (bytes.size() < 12) return PictureFormat::none;
  using namespace std::string_view_literals;
  if (bytes.starts_with("\xff\xd8\xff"sv)) return PictureFormat::jpeg;
  if (bytes.starts_with("\x89PNG"sv)) return PictureFormat::png;
  if (bytes.starts_with("RIFF"sv) && bytes.substr(8) == "WEBP"sv) return PictureFormat::webp;
  if (bytes.substr(4, 4) == "ftyp"sv && isHeifBrand(bytes.substr(8))) return PictureFormat::heif;
  return PictureFormat::none;
}

namespace {

// Whether a folder holds what is made of photographs: by a command like this one, by a run, or a model's SOG unpacked.
bool isMade(const fs::path& folder) {
  return isFile(folder / Ledger::kFile) || (isFile(folder / kMetricsName) && isFile(folder / "checkpoint")) ||
         isFile(folder / "means_l.webp");
}

// Whether a folder is another one or lies in it; both as fs::canonical() has them.
bool isWithin(const fs::path& inner, const fs::path& outer) {
  return std::ranges::mismatch(outer, inner).in1 == outer.end();
}

// What lies in a folder.
struct Walk {
  PhotographList list;  // not sorted
  std::size_t files = 0;
  std::set<fs::path> folders;   // walked through, as fs::canonical() has them
  std::vector<fs::path> links;  // to folders, sorted; none is followed
};

// Through `walked`, which lies at `place`, but for folders that were `entered` before. Names are those below `folder`.
// Ends after `most_files` and one more.
Walk walkThrough(const fs::path& walked, const fs::path& place, const fs::path& folder,
                 const std::set<fs::path>& entered, std::size_t most_files) {
  Walk walk;
  walk.folders.insert(place);
  PhotographList& list = walk.list;
  std::error_code error;
  fs::recursive_directory_iterator entries(walked, error), end;
  for (; !error && entries != end; entries.increment(error)) {
    const fs::path path = entries->path();
    std::error_code ignored;
    if (isHidden(path) || (entries->is_directory(ignored) && isMade(path))) {
      entries.disable_recursion_pending();
      continue;
    }
    if (entries->is_directory(ignored) && ::access(path.c_str(), R_OK | X_OK) != 0) {
      list.closed.push_back(path.lexically_relative(folder).string() + " (" + systemReason() + ")");
      entries.disable_recursion_pending();
      continue;
    }
    if (entries->is_directory(ignored)) {
      if (entries->is_symlink(ignored)) {
        walk.links.push_back(path);
      } else if (const fs::path at = place / path.lexically_relative(walked); entered.contains(at)) {
        entries.disable_recursion_pending();
      } else {
        walk.folders.insert(at);
      }
    }
    if (!entries->is_regular_file(ignored)) continue;
    if (++walk.files > most_files) return walk;
    const fs::path below = path.lexically_relative(folder);
    if (const std::vector<std::uint8_t> start = startOf(path); pictureFormat(start) != PictureFormat::none) {
      const fs::path parent = below.parent_path();
      const bool is_mask = std::find(parent.begin(), parent.end(), "masks") != parent.end();
      (is_mask ? list.masks : isDrawn(start) ? list.drawn : list.photographs).push_back(below);
    } else if (isUnreadName(path)) {
      list.unread.push_back(below.string());
    } else if (isFilmName(path)) {
      list.films.push_back(below.string());
    } else if (::access(path.c_str(), R_OK) != 0) {
      list.closed.push_back(below.string() + " (" + systemReason() + ")");
    } else {
      list.ignored.push_back(below.string());
    }
  }
  if (error) throw Error(ErrorKind::cannotRead, walked.string(), "cannot list: " + error.message());
  std::ranges::sort(walk.links);
  return walk;
}

// In the order in which people number them: "IMG (9)" before "IMG (10)". Those that differ in their extension alone
// stand beside each other.
bool isBefore(const fs::path& a, const fs::path& b) {
  const fs::path x = fs::path(a).replace_extension(), y = fs::path(b).replace_extension();
  const auto [in_x, in_y] = std::ranges::mismatch(x, y);
  if (in_x == x.end() && in_y == y.end()) {
    return std::pair(lowerExtension(a), a.native()) < std::pair(lowerExtension(b), b.native());
  }
  if (in_x == x.end() || in_y == y.end()) return in_x == x.end();
  return ::strverscmp(in_x->c_str(), in_y->c_str()) < 0;
}

template <typename T>
void append(std::vector<T>& all, const std::vector<T>& more) {
  all.insert(all.end(), more.begin(), more.end());
}

}  // namespace

PhotographList findPhotographs(const fs::path& folder, std::size_t most_files) {
  PhotographList list;
  std::size_t files = 0;
  // The folder itself, then where links lead. No folder is walked through twice, and none in circles.
  std::vector<fs::path> walks = {folder};
  std::set<fs::path> entered;
  std::error_code unknown;
  const fs::path input = fs::canonical(folder, unknown);
  for (std::size_t i = 0; i < walks.size(); ++i) {
    const bool is_link = i > 0;
    const fs::path place = fs::canonical(walks[i], unknown);
    const auto leaveOut = [&](const std::string& why) {
      list.ignored.push_back(walks[i].lexically_relative(folder).string() + " (" + why + ")");
    };
    if (is_link && (entered.contains(place) || isWithin(input, place))) {
      leaveOut("a link to or above what is looked into anyway");
      continue;
    }
    if (is_link && isWithin(place, input)) {  // hidden, or the work folder of another command
      leaveOut("a link into what is left out");
      continue;
    }
    Walk walk = walkThrough(walks[i], place, folder, entered, most_files - files);
    if (files + walk.files > most_files) {
      const std::string many = "too many files" + atMost(most_files, files + walk.files);
      if (!is_link) throw Error(ErrorKind::badData, folder.string(), many);
      leaveOut("a link that leads to " + many);
      continue;
    }
    files += walk.files;
    entered.merge(walk.folders);
    append(walks, walk.links);
    append(list.photographs, walk.list.photographs);
    append(list.drawn, walk.list.drawn);
    append(list.masks, walk.list.masks);
    append(list.unread, walk.list.unread);
    append(list.films, walk.list.films);
    append(list.closed, walk.list.closed);
    append(list.ignored, walk.list.ignored);
  }
  if (list.photographs.empty()) std::swap(list.photographs, list.drawn);  // who has no others means these
  for (std::vector<fs::path>* paths : {&list.photographs, &list.drawn, &list.masks})
    std::ranges::sort(*paths, isBefore);
  for (std::vector<std::string>* names : {&list.unread, &list.films, &list.closed, &list.ignored})
    std::ranges::sort(*names);
  // Empty and broken photographs before what was never meant to be one.
  std::ranges::stable_partition(list.ignored, isPhotographName);
  return list;
}

std::vector<PhotographCopy> takeOutCopies(const fs::path& folder, std::vector<fs::path>& photographs) {
  std::map<std::uintmax_t, std::vector<std::size_t>> same_size;
  for (std::size_t i = 0; i < photographs.size(); ++i) {
    std::error_code error;
    const std::uintmax_t size = fs::file_size(folder / photographs[i], error);
    if (!error) same_size[size].push_back(i);  // else whoever reads it says why
  }
  constexpr std::size_t kNone = std::numeric_limits<std::size_t>::max();
  std::vector<std::size_t> original(photographs.size(), kNone);
  for (const auto& [size, places] : same_size) {
    if (places.size() < 2) continue;
    std::map<std::size_t, std::size_t> first;  // by hash, so that each file is read twice at most
    for (const std::size_t place : places) {
      const fs::path file = folder / photographs[place];
      const std::optional<std::size_t> hash = hashOf(file);
      if (!hash) continue;
      const auto [known, is_new] = first.emplace(*hash, place);
      if (!is_new && holdTheSame(file, folder / photographs[known->second])) original[place] = known->second;
    }
  }
  std::vector<PhotographCopy> copies;
  std::vector<fs::path> kept;
  for (std::size_t i = 0; i < photographs.size(); ++i) {
    if (original[i] == kNone) {
      kept.push_back(photographs[i]);
    } else {
      copies.push_back({photographs[i], photographs[original[i]]});
    }
  }
  photographs = std::move(kept);
  return copies;
}

bool isForPhotos(const fs::path& path) {
  if (isFile(path)) return isFilmName(path);
  std::error_code ignored;
  if (!fs::is_directory(path, ignored) || hasCameras(path)) return false;
  try {
    return !findPhotographs(path).photographs.empty();
  } catch (const Error&) {
    return false;
  }
}

namespace {

bool isBeyondAscii(char c) { return static_cast<unsigned char>(c) >= 0x80; }

// What is equal for names that some file system takes for one: which letters beyond ASCII are another's capital is
// more than this program knows.
std::string withoutCase(const std::string& name) {
  std::string plain;
  for (const char c : lowerCase(name)) {
    if (!isBeyondAscii(c)) plain += c;
    if (isBeyondAscii(c) && !plain.ends_with('\x80')) plain += '\x80';
  }
  return plain;
}

}  // namespace

std::vector<std::string> plainNames(const std::vector<fs::path>& photographs) {
  std::vector<std::string> names;
  std::set<std::string> taken;
  const auto isNew = [&](const std::string& name) { return taken.insert(withoutCase(name)).second; };
  for (const fs::path& photograph : photographs) {
    std::string plain = fs::path(photograph).replace_extension().string();
    for (char& c : plain) {
      const bool kept = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-';
      if (!kept && !isBeyondAscii(c)) c = '_';
    }
    if (!nlohmann::json::accept('"' + plain + '"')) std::ranges::replace_if(plain, isBeyondAscii, '_');  // no UTF-8
    std::size_t end = std::min(plain.size(), kLongestName);
    while (end < plain.size() && (static_cast<unsigned char>(plain[end]) & 0xc0) == 0x80) --end;  // within a letter
    plain.resize(end);
    std::string name = plain;
    for (int copy = 2; !isNew(name); ++copy) name = plain + "_" + std::to_string(copy);
    names.push_back(name);
  }
  return names;
}

}  // namespace tg
