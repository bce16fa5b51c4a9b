// SPDX-License-Identifier: Apache-2.0
// Reading model.tgz from anybody: nothing is unpacked to disk, nothing is allocated that a bound has not passed.
#include <archive.h>
#include <archive_entry.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <exception>
#include <fstream>
#include <memory>
#include <new>
#include <nlohmann/json.hpp>
#include <span>
#include <unordered_set>

#include "core/bundle/bundle.h"
#include "core/bundle/camera_file.h"
#include "core/bundle/manifest.h"
#include "core/bundle/read_progress.h"
#include "core/bundle/splat_rows.h"
#include "core/file/gzip_reader.h"
#include "core/file/json.h"
#include "core/file/npy.h"
#include "core/file/sha256.h"
#include "core/image/codecs.h"
#include "core/model/unpack_atlas.h"
#include "core/model/verbs.h"
#include "core/system/error.h"
#include "core/system/parallel.h"

namespace tg {
namespace {

constexpr std::size_t kMaxNameBytes = 255;
constexpr std::size_t kFirstPreview = 130'000;                      // Gaussians; then at four times as many
constexpr std::uint64_t kMaxTarOverhead = std::uint64_t{64} << 20;  // headers and padding beside total_bytes

bool isUtf8(const std::string& text) {
  for (std::size_t i = 0; i < text.size();) {
    const auto byte = [&](std::size_t k) { return static_cast<unsigned char>(i + k < text.size() ? text[i + k] : 0); };
    const auto follows = [&](std::size_t k) { return (byte(k) & 0xc0) == 0x80; };
    if (byte(0) < 0x80) {
      i += 1;
    } else if (byte(0) >= 0xc2 && byte(0) < 0xe0 && follows(1)) {
      i += 2;
    } else if (byte(0) >= 0xe0 && byte(0) < 0xf0 && follows(1) && follows(2) && !(byte(0) == 0xe0 && byte(1) < 0xa0) &&
               !(byte(0) == 0xed && byte(1) >= 0xa0)) {  // neither longer than need be nor half a pair of UTF-16
      i += 3;
    } else if (byte(0) >= 0xf0 && byte(0) < 0xf5 && follows(1) && follows(2) && follows(3) &&
               !(byte(0) == 0xf0 && byte(1) < 0x90) && !(byte(0) == 0xf4 && byte(1) >= 0x90)) {  // up to U+10FFFF
      i += 4;
    } else {
      return false;
    }
  }
  return true;
}

// Names go into messages: printable and short whatever the archive says.
std::string shown(const std::string& name) {
  std::string text = "\"";
  for (char c : name.substr(0, 60)) text += c >= ' ' && c <= '~' ? c : '?';
  return text + (name.size() > 60 ? "...\"" : "\"");
}

// Why a name is refused; "" when it is a plain relative path.
std::string nameProblem(const std::string& name) {
  if (name.empty()) return "is empty";
  if (name.size() > kMaxNameBytes) return "is longer than " + std::to_string(kMaxNameBytes) + " bytes";
  if (!isUtf8(name)) return "is not UTF-8";
  if (name[0] == '/') return "is absolute";
  if (name.find('\\') != name.npos) return "holds a backslash";
  if (name.size() > 1 && name[1] == ':') return "starts with a drive letter";
  for (std::size_t begin = 0; begin <= name.size();) {
    const std::size_t end = std::min(name.find('/', begin), name.size());
    const std::string part = name.substr(begin, end - begin);
    if (part.empty() || part == "." || part == "..") return "holds an empty, . or .. component";
    begin = end + 1;
  }
  return "";
}

const char* typeName(archive_entry* entry) {
  if (archive_entry_hardlink(entry)) return "hard link";
  switch (archive_entry_filetype(entry)) {
    case AE_IFREG:
      return archive_entry_sparse_count(entry) > 0 ? "sparse file" : nullptr;
    case AE_IFLNK:
      return "symbolic link";
    case AE_IFDIR:
      return "folder";
    case AE_IFCHR:
    case AE_IFBLK:
      return "device";
    case AE_IFIFO:
      return "pipe";
    default:
      return "special file";
  }
}

class BundleReader {
 public:
  BundleReader(const std::filesystem::path& path, const BundleLimits& limits, ReadProgress* progress)
      : path_(path.string()),
        limits_(limits),
        progress_(progress),
        gzip_(path, saturatingSum(limits.total_bytes, kMaxTarOverhead), progress),
        archive_(archive_read_new(), archive_read_free) {
    if (!archive_) throw std::bad_alloc();
    archive_read_support_format_tar(archive_.get());
    archive_read_set_callback_data(archive_.get(), this);
    archive_read_set_read_callback(archive_.get(), onRead);
    checkArchive(archive_read_open1(archive_.get()));
  }

  Bundle read() {
    while (archive_entry* entry = nextEntry()) readEntry(entry);
    if (!has_manifest_) fail("is an empty archive");
    while (!gzip_.next().empty()) {
    }  // to the checksum at the end
    if (gzip_.hasTrailingBytes()) warn("ignored bytes after the end of the gzip stream");
    for (const ManifestFile& file : manifest_.files) {
      if (!names_.contains(file.name)) fail("lacks " + shown(file.name) + ", which its manifest lists");
    }
    finishAtlas();
    bundle_.model.texture_mode = manifest_.mode;
    bundle_.model.intersection = manifest_.intersection;
    bundle_.model.outside = manifest_.outside;
    bundle_.background = manifest_.background;
    checkModel(bundle_.model, path_);
    return std::move(bundle_);
  }

 private:
  static std::uint64_t saturatingSum(std::uint64_t a, std::uint64_t b) { return a + b < a ? ~std::uint64_t{0} : a + b; }
  static std::string folded(std::string name) {
    for (char& c : name) {
      if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
    }
    return name;
  }

  [[noreturn]] void fail(const std::string& what) const { throw Error(ErrorKind::badData, path_, what); }
  void warn(const std::string& what) { bundle_.warnings.push_back(what); }
  std::string inside(const std::string& name) const { return path_ + "/" + name; }

  // Exceptions must not cross libarchive's C frames: kept here, rethrown by checkArchive.
  static la_ssize_t onRead(archive* a, void* self, const void** buffer) {
    auto* reader = static_cast<BundleReader*>(self);
    try {
      const std::span<const std::uint8_t> piece = reader->gzip_.next();
      *buffer = piece.data();
      return static_cast<la_ssize_t>(piece.size());
    } catch (...) {
      reader->failure_ = std::current_exception();
      archive_set_error(a, EIO, "input failed");
      return ARCHIVE_FATAL;
    }
  }
  void checkArchive(int result) {
    if (failure_) std::rethrow_exception(failure_);
    if (result == ARCHIVE_OK || result == ARCHIVE_EOF || result == ARCHIVE_WARN) return;
    if (archive_errno(archive_.get()) == ENOMEM) throw std::bad_alloc();
    const char* text = archive_error_string(archive_.get());
    fail(std::string("broken tar archive: ") + (text ? text : "unknown error"));
  }

  // nullptr at the end.
  archive_entry* nextEntry() {
    archive_entry* entry = nullptr;
    const int result = archive_read_next_header(archive_.get(), &entry);
    checkArchive(result);
    return result == ARCHIVE_EOF ? nullptr : entry;
  }

  void readEntry(archive_entry* entry) {
    if (++entries_ > limits_.entries) {
      fail("too many entries (expected at most " + std::to_string(limits_.entries) + ")");
    }
    const char* raw_name = archive_entry_pathname(entry);
    if (!raw_name) raw_name = archive_entry_pathname_utf8(entry);
    const std::string name = raw_name ? raw_name : "";
    if (const char* type = typeName(entry)) fail("entry " + shown(name) + " is a " + type + " (expected a file)");
    const std::string problem = nameProblem(name);
    if (!problem.empty()) fail("entry " + std::to_string(entries_) + ", " + shown(name) + ": name " + problem);
    names_.insert(name);
    if (!folded_names_.insert(folded(name)).second) fail("entry " + shown(name) + " is there twice");
    if (!archive_entry_size_is_set(entry) || archive_entry_size(entry) < 0) {
      fail("entry " + shown(name) + " has no valid size");
    }
    const auto size = static_cast<std::uint64_t>(archive_entry_size(entry));
    total_ = saturatingSum(total_, size);
    if (size > limits_.entry_bytes || total_ > limits_.total_bytes) {
      fail("entry " + shown(name) + " exceeds the limits (expected at most " + std::to_string(limits_.entry_bytes) +
           " bytes, " + std::to_string(limits_.total_bytes) + " in total, found " + std::to_string(size) + " and " +
           std::to_string(total_) + ")");
    }

    if (!has_manifest_) {
      if (name != kManifestName) {
        fail("wrong first entry (expected \"" + std::string(kManifestName) + "\", found " + shown(name) + ")");
      }
      const std::vector<std::uint8_t> bytes = readBytes(name, size, kMaxManifestBytes);
      manifest_ = parseManifest({bytes.begin(), bytes.end()}, inside(name));
      checkTexels();
      has_manifest_ = true;
      return;
    }
    if (!readKnown(name, size)) {
      warn("skipped unknown entry " + shown(name));
      checkArchive(archive_read_data_skip(archive_.get()));
    }
  }

  void checkTexels() const {
    const std::uint64_t texels = static_cast<std::uint64_t>(manifest_.atlas_pages) *
                                 static_cast<std::uint64_t>(manifest_.atlas_width) *
                                 static_cast<std::uint64_t>(manifest_.atlas_height);
    if (texels > limits_.max_texels) {
      fail("too many texels" + atMost(limits_.max_texels, texels));
    }
  }

  // False: a name this version does not know.
  bool readKnown(const std::string& name, std::uint64_t size) {
    const std::size_t n = static_cast<std::size_t>(manifest_.gaussians);
    constexpr std::uint64_t npy_header = 65546;
    if (name == kGaussiansName) {
      readGaussians(name, size);
      checkCount(name, "Gaussians", n, bundle_.model.size());
      checkCount(name, "SH degree", static_cast<std::size_t>(manifest_.sh_degree),
                 static_cast<std::size_t>(bundle_.model.sh_degree));
    } else if (name == kRectsName) {
      rects_ = parseNpy<std::uint16_t>(readListed(name, size, npy_header + 8 * n), n, 4, inside(name));
    } else if (name == kAtlasIdName) {
      page_ids_ = parseNpy<std::uint8_t>(readListed(name, size, npy_header + n), n, 0, inside(name));
    } else if (const auto page = atlasPageNumber(name)) {
      pages_.resize(kMaxAtlasPages);
      pages_[static_cast<std::size_t>(*page)] = readListed(name, size, limits_.entry_bytes);
    } else if (name == kCamerasName) {
      const auto bytes = readListed(name, size, kMaxCamerasBytes);
      bundle_.cameras = parseCameras({bytes.begin(), bytes.end()}, inside(name));
      checkCount(name, "cameras", static_cast<std::size_t>(manifest_.cameras), bundle_.cameras.size());
    } else if (name == kTrainingName) {
      const auto bytes = readListed(name, size, kMaxTrainingBytes);
      bundle_.training_json.assign(bytes.begin(), bytes.end());
      if (!parseJson(bundle_.training_json, inside(name)).is_object()) {
        throw Error(ErrorKind::badData, inside(name), "expected a JSON object");
      }
    } else if (name == kPreviewName) {
      readPreview(readListed(name, size, kMaxPreviewBytes), inside(name));
    } else {
      return false;
    }
    return true;
  }

  void checkCount(const std::string& name, const char* what, std::size_t expected, std::size_t found) const {
    if (expected != found) {
      throw Error(ErrorKind::badData, inside(name),
                  std::string("disagrees with the manifest on ") + what + expectedFound(expected, found));
    }
  }

  void readPreview(const std::vector<std::uint8_t>& bytes, const std::string& path) {
    // Width and height of the IHDR chunk, which must come first.
    constexpr std::uint8_t magic[] = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'};
    if (bytes.size() < 24 || std::memcmp(bytes.data(), magic, sizeof(magic)) != 0) {
      throw Error(ErrorKind::badData, path, "not a PNG file");
    }
    for (std::size_t at : {std::size_t{16}, std::size_t{20}}) {
      const std::uint32_t side = static_cast<std::uint32_t>(bytes[at]) << 24 |
                                 static_cast<std::uint32_t>(bytes[at + 1]) << 16 |
                                 static_cast<std::uint32_t>(bytes[at + 2]) << 8 | bytes[at + 3];
      if (side < 1 || side > kMaxPreviewSide) {
        throw Error(ErrorKind::badData, path,
                    "image size out of range (expected 1 to " + std::to_string(kMaxPreviewSide) + ", found " +
                        std::to_string(side) + ")");
      }
    }
    bundle_.preview = decodeImage(bytes, path);
    if (bundle_.preview.channels != 3) {
      throw Error(ErrorKind::badData, path,
                  "wrong number of channels (expected 3, found " + std::to_string(bundle_.preview.channels) + ")");
    }
  }

  // The Gaussians, without their file being in memory as a whole.
  void readGaussians(const std::string& name, std::uint64_t size) {
    SplatStream stream(size, inside(name));
    std::size_t next_preview = kFirstPreview;
    readListed(name, size, limits_.entry_bytes, [&](std::span<const std::uint8_t> piece) {
      stream.add(piece);
      if (!progress_ || !progress_->preview || stream.ready() < next_preview) return;
      next_preview *= 4;
      progress_->preview(thinned(stream.model(), stream.ready(), kPreviewGaussians));
    });
    bundle_.model = stream.finish();
  }

  // The content of the current entry, held against the manifest.
  std::vector<std::uint8_t> readListed(const std::string& name, std::uint64_t size, std::uint64_t max_bytes) {
    std::vector<std::uint8_t> bytes;
    readListed(name, size, max_bytes, [&](std::span<const std::uint8_t> piece) {
      bytes.reserve(static_cast<std::size_t>(size));
      bytes.insert(bytes.end(), piece.begin(), piece.end());
    });
    return bytes;
  }
  template <typename Visit>
  void readListed(const std::string& name, std::uint64_t size, std::uint64_t max_bytes, const Visit& visit) {
    const ManifestFile* listed = manifest_.find(name);
    if (!listed) fail("entry " + shown(name) + " is not listed in the manifest");
    checkCount(name, "its bytes", static_cast<std::size_t>(listed->bytes), static_cast<std::size_t>(size));
    Sha256 digest;
    readPieces(name, size, max_bytes, [&](std::span<const std::uint8_t> piece) {
      digest.add(piece);
      visit(piece);
    });
    const std::string hash = digest.hex();
    if (hash != listed->sha256) {
      throw Error(ErrorKind::badData, inside(name),
                  "is damaged (expected SHA-256 " + listed->sha256 + ", found " + hash + ")");
    }
  }

  std::vector<std::uint8_t> readBytes(const std::string& name, std::uint64_t size, std::uint64_t max_bytes) {
    std::vector<std::uint8_t> bytes;
    readPieces(name, size, max_bytes,
               [&](std::span<const std::uint8_t> piece) { bytes.insert(bytes.end(), piece.begin(), piece.end()); });
    return bytes;
  }

  // Calls visit(span of bytes) for the content of the current entry, which is not empty at once and `size` in the end.
  template <typename Visit>
  void readPieces(const std::string& name, std::uint64_t size, std::uint64_t max_bytes, const Visit& visit) {
    if (size > max_bytes) {
      throw Error(
          ErrorKind::badData, inside(name),
          "is too long (expected at most " + std::to_string(max_bytes) + " bytes, found " + std::to_string(size) + ")");
    }
    if (size > gzip_.inflatedBound()) throw Error(ErrorKind::badData, inside(name), "is longer than the file can hold");
    std::uint64_t read = 0;
    for (;;) {
      const void* data = nullptr;
      std::size_t length = 0;
      la_int64_t offset = 0;
      const int result = archive_read_data_block(archive_.get(), &data, &length, &offset);
      checkArchive(result);
      if (result == ARCHIVE_EOF) break;
      if (offset != static_cast<la_int64_t>(read) || length > size - read) {
        throw Error(ErrorKind::badData, inside(name), "has a wrong size");
      }
      read += length;
      visit(std::span(static_cast<const std::uint8_t*>(data), length));
    }
    if (read != size) throw Error(ErrorKind::badData, inside(name), "ends early");
  }

  void finishAtlas() {
    if (!manifest_.find(kRectsName)) return;
    const std::size_t n = bundle_.model.size();
    std::vector<AtlasPlacement> placements(n);
    for (std::size_t i = 0; i < n; ++i) {
      placements[i] = {rects_[4 * i], rects_[4 * i + 1], rects_[4 * i + 2], rects_[4 * i + 3], page_ids_[i]};
    }
    for (int page = 0; page < manifest_.atlas_pages; ++page) checkPage(page);
    bundle_.model.atlas = unpackAtlas(
        placements, manifest_.atlas_pages, {manifest_.atlas_width, manifest_.atlas_height},
        [this](int page) { return decodePage(page); }, path_);
  }

  void checkPage(int number) const {
    const std::string path = inside(atlasPageName(number));
    const ExrInfo info = readExrInfo(pages_[static_cast<std::size_t>(number)], path);
    if (info.width != manifest_.atlas_width || info.height != manifest_.atlas_height) {
      throw Error(ErrorKind::badData, path,
                  "disagrees with the manifest on its size (expected " + std::to_string(manifest_.atlas_width) + " x " +
                      std::to_string(manifest_.atlas_height) + ", found " + std::to_string(info.width) + " x " +
                      std::to_string(info.height) + ")");
    }
  }

  Image decodePage(int number) const {
    const std::string channels[] = {"R", "G", "B", "alpha"};
    return decodeExr(pages_[static_cast<std::size_t>(number)], channels, inside(atlasPageName(number)));
  }

  const std::string path_;
  const BundleLimits limits_;
  ReadProgress* const progress_;
  GzipReader gzip_;
  std::exception_ptr failure_;
  std::unique_ptr<archive, int (*)(archive*)> archive_;

  Bundle bundle_;
  Manifest manifest_;
  bool has_manifest_ = false;
  int entries_ = 0;
  std::uint64_t total_ = 0;
  std::unordered_set<std::string> names_;
  std::unordered_set<std::string> folded_names_;  // names that differ in case only are one file on some systems
  std::vector<std::uint16_t> rects_;
  std::vector<std::uint8_t> page_ids_;
  std::vector<std::vector<std::uint8_t>> pages_;  // encoded
};

}  // namespace

Bundle readBundle(const std::filesystem::path& path, const BundleLimits& limits, ReadProgress* progress) {
  return BundleReader(path, limits, progress).read();
}

}  // namespace tg
