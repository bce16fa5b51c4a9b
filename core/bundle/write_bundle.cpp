// SPDX-License-Identifier: Apache-2.0
// Writing model.tgz. The manifest that precedes the entries holds their hashes: entries are encoded in memory, but for
// the Gaussians, which are encoded twice.
#include <archive.h>
#include <archive_entry.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <functional>
#include <memory>
#include <new>
#include <nlohmann/json.hpp>
#include <span>
#include <system_error>

#include "core/bundle/bundle.h"
#include "core/bundle/camera_file.h"
#include "core/bundle/manifest.h"
#include "core/bundle/ply.h"
#include "core/bundle/quick_bundle.h"
#include "core/bundle/splat_rows.h"
#include "core/file/file.h"
#include "core/file/json.h"
#include "core/file/npy.h"
#include "core/file/quick_file.h"
#include "core/file/sha256.h"
#include "core/system/assert.h"
#include "core/system/error.h"
#include "core/system/parallel.h"

namespace tg {
namespace {

struct Entry {
  std::string name;
  std::vector<std::uint8_t> bytes;
  const GaussianModel* gaussians = nullptr;  // the entry is these as a PLY; `bytes` is its header
};

std::uint64_t sizeOf(const Entry& entry) {
  const GaussianModel* model = entry.gaussians;
  return entry.bytes.size() + (model ? std::uint64_t{model->size()} * splatRowBytes(model->sh_degree) : 0);
}

// Calls visit(span of bytes) for the entry's content, piece by piece.
template <typename Visit>
void forEachPiece(const Entry& entry, const Visit& visit) {
  visit(std::span(entry.bytes));
  if (!entry.gaussians) return;
  const GaussianModel& model = *entry.gaussians;
  std::vector<std::uint8_t> rows;
  for (std::size_t first = 0; first < model.size(); first += kSplatBlockRows) {
    const std::size_t count = std::min(kSplatBlockRows, model.size() - first);
    rows.resize(count * splatRowBytes(model.sh_degree));
    formatSplatRows(model, first, count, rows.data());
    visit(std::span(rows));
  }
}

std::vector<std::uint8_t> toBytes(const std::string& text) { return {text.begin(), text.end()}; }

// Pages are encoded in parallel: prefers many of 2048 over few of 4096.
int pageSize(const TextureAtlas& atlas) {
  bool large = atlas.texels.size() > std::size_t{200} * 2048 * 2048;
  for (const TextureRect& rect : atlas.rects) large = large || rect.width > 2048 || rect.height > 2048;
  return large ? kMaxAtlasPageSide : 2048;
}

void addAtlas(const GaussianModel& model, const std::string& path, Manifest& manifest, std::vector<Entry>& entries) {
  if (model.atlas.rects.empty()) return;
  const PackedAtlas packed = packAtlas(model.atlas, model.size(), pageSize(model.atlas));
  std::vector<std::uint16_t> rects;
  std::vector<std::uint8_t> pages;
  rects.reserve(4 * model.size());
  pages.reserve(model.size());
  for (const AtlasPlacement& at : packed.placements) {
    rects.insert(rects.end(), {at.x, at.y, at.w, at.h});
    pages.push_back(at.page);
  }
  entries.push_back({kRectsName, formatNpy<std::uint16_t>(rects, model.size(), 4), nullptr});
  entries.push_back({kAtlasIdName, formatNpy<std::uint8_t>(pages, model.size(), 0), nullptr});

  manifest.atlas_pages = static_cast<int>(packed.pages.size());
  if (packed.pages.empty()) return;
  manifest.atlas_width = packed.pages[0].width;
  manifest.atlas_height = packed.pages[0].height;
  const std::uint64_t texels = std::uint64_t{packed.pages.size()} * static_cast<std::uint64_t>(manifest.atlas_width) *
                               static_cast<std::uint64_t>(manifest.atlas_height);
  if (const std::uint64_t most = BundleLimits().max_texels; texels > most) {
    throw Error(ErrorKind::cannotWrite, path, "the atlas pages are too large for a bundle" + atMost(most, texels));
  }
  const std::size_t first = entries.size();
  for (int page = 0; page < manifest.atlas_pages; ++page) entries.push_back({atlasPageName(page), {}, nullptr});
  parallelFor(manifest.atlas_pages, 1, [&](std::int64_t page) {
    const std::string channels[] = {"R", "G", "B", "alpha"};
    const std::size_t p = static_cast<std::size_t>(page);
    entries[first + p].bytes = encodeExr(packed.pages[p], channels);
  });
}

std::vector<Entry> encodeEntries(const Bundle& bundle, const std::string& path) {
  Manifest manifest;
  manifest.gaussians = bundle.model.size();
  manifest.cameras = bundle.cameras.size();
  manifest.sh_degree = bundle.model.sh_degree;
  manifest.mode = bundle.model.texture_mode;
  manifest.intersection = bundle.model.intersection;
  manifest.outside = bundle.model.outside;
  manifest.background = bundle.background;

  std::vector<Entry> entries = {{kManifestName, {}, nullptr}};
  const std::string header = splatHeader(bundle.model.size(), bundle.model.sh_degree);
  entries.push_back({kGaussiansName, toBytes(header), &bundle.model});
  addAtlas(bundle.model, path, manifest, entries);
  if (!bundle.cameras.empty()) entries.push_back({kCamerasName, toBytes(storedCameras(bundle.cameras, path)), nullptr});
  if (!bundle.training_json.empty()) entries.push_back({kTrainingName, toBytes(bundle.training_json), nullptr});
  if (bundle.preview.width > 0) entries.push_back({kPreviewName, encodePng(bundle.preview), nullptr});

  const BundleLimits limits;
  std::uint64_t total = 0;
  for (const Entry& entry : entries) {
    const std::uint64_t bytes = sizeOf(entry);
    const std::uint64_t most = limits.entry_bytes;
    total += bytes;
    if (bytes <= most && total <= limits.total_bytes) continue;
    throw Error(ErrorKind::cannotWrite, path,
                entry.name + " is too large for a bundle" +
                    (bytes > most ? atMost(most, bytes) : atMost(limits.total_bytes, total)));
  }
  manifest.files.resize(entries.size() - 1);
  parallelFor(static_cast<std::int64_t>(manifest.files.size()), 1, [&](std::int64_t i) {
    const Entry& entry = entries[static_cast<std::size_t>(i) + 1];
    Sha256 digest;
    forEachPiece(entry, [&](std::span<const std::uint8_t> piece) { digest.add(piece); });
    manifest.files[static_cast<std::size_t>(i)] = {entry.name, sizeOf(entry), digest.hex()};
  });
  const std::string json = formatManifest(manifest);
  parseManifest(json, path);
  entries[0].bytes = toBytes(json);
  return entries;
}

void checkWritable(const Bundle& bundle, const std::string& path) {
  const auto fail = [&](const std::string& what) { return Error(ErrorKind::cannotWrite, path, what); };
  if (bundle.model.size() > kMaxGaussians) {
    throw fail("too many Gaussians" + atMost(kMaxGaussians, bundle.model.size()));
  }
  checkModel(bundle.model, path);
  if (!bundle.training_json.empty()) {
    if (!parseJson(bundle.training_json, path + "/" + kTrainingName).is_object()) {
      throw fail(std::string(kTrainingName) + ": expected a JSON object");
    }
    if (bundle.training_json.size() > kMaxTrainingBytes) throw fail(std::string(kTrainingName) + ": too long");
  }
  for (const Camera& camera : bundle.cameras) {
    const glm::dvec3 position = camera.position();
    if (std::isfinite(position.x) && std::isfinite(position.y) && std::isfinite(position.z)) continue;
    throw fail("camera \"" + printable(camera.name) + "\" lies beyond what numbers hold");
  }
  const Image& preview = bundle.preview;
  if (preview.width > 0 &&
      (preview.channels != 3 || preview.width > kMaxPreviewSide || preview.height > kMaxPreviewSide)) {
    throw fail("preview does not fit (expected 3 channels and at most " + std::to_string(kMaxPreviewSide) +
               " px a side, found " + std::to_string(preview.width) + " x " + std::to_string(preview.height) + " x " +
               std::to_string(preview.channels) + ")");
  }
}

class TarWriter {
 public:
  TarWriter(const std::filesystem::path& file, bool compressed) : archive_(archive_write_new(), archive_write_free) {
    archive* a = archive_.get();
    if (!a) throw std::bad_alloc();
    check(archive_write_set_format_ustar(a));
    check(archive_write_add_filter_gzip(a));
    check(archive_write_set_filter_option(a, "gzip", "compression-level", compressed ? "6" : "0"));
    check(archive_write_set_filter_option(a, "gzip", "timestamp", nullptr));  // mtime 0: same bytes every time
    check(archive_write_open_filename(a, file.c_str()));
  }
  void add(const Entry& entry) {
    const std::unique_ptr<archive_entry, void (*)(archive_entry*)> header(archive_entry_new(), archive_entry_free);
    if (!header) throw std::bad_alloc();
    archive_entry_set_pathname(header.get(), entry.name.c_str());
    archive_entry_set_size(header.get(), static_cast<la_int64_t>(sizeOf(entry)));
    archive_entry_set_filetype(header.get(), AE_IFREG);
    archive_entry_set_perm(header.get(), 0644);
    archive_entry_set_mtime(header.get(), 0, 0);
    check(archive_write_header(archive_.get(), header.get()));
    forEachPiece(entry, [&](std::span<const std::uint8_t> piece) {
      while (!piece.empty()) {
        const la_ssize_t got = archive_write_data(archive_.get(), piece.data(), piece.size());
        if (got <= 0) throw std::runtime_error(message());
        piece = piece.subspan(static_cast<std::size_t>(got));
      }
    });
  }
  void close() { check(archive_write_close(archive_.get())); }

 private:
  std::string message() const {
    const int number = archive_errno(archive_.get());  // errno's, or below 0
    if (number == ENOMEM) throw std::bad_alloc();
    const char* text = archive_error_string(archive_.get());
    return "cannot write: " + (number > 0 ? std::generic_category().message(number) : std::string(text ? text : "tar"));
  }
  void check(int result) const {
    if (result != ARCHIVE_OK) throw std::runtime_error(message());
  }
  std::unique_ptr<archive, int (*)(archive*)> archive_;
};

using Writer = std::function<void(const std::filesystem::path&)>;

// `file` calls a writer with the file to fill.
void writeTo(const std::filesystem::path& path, const Bundle& bundle, bool compressed,
             const std::function<void(const Writer&)>& file) {
  TG_ASSERT(bundle.preview.data.empty() || hasImageShape(bundle.preview), "the preview's data has its size");
  checkWritable(bundle, path.string());
  try {
    std::vector<Entry> entries = encodeEntries(bundle, path.string());
    file([&](const std::filesystem::path& temporary) {
      TarWriter tar(temporary, compressed);
      for (Entry& entry : entries) {
        tar.add(entry);
        std::vector<std::uint8_t>().swap(entry.bytes);
      }
      tar.close();
    });
  } catch (const Error& e) {
    const std::string what = e.what();
    if (what.starts_with(printable(path.string()))) throw;
    throw Error(ErrorKind::cannotWrite, path.string(), what);
  } catch (const std::runtime_error& e) {
    throw Error(ErrorKind::cannotWrite, path.string(), e.what());
  }
}

}  // namespace

void writeBundle(const std::filesystem::path& path, const Bundle& bundle) {
  writeTo(path, bundle, true, [&](const Writer& fill) { writeFileAtomically(path, fill); });
}

void writeBundleQuickly(const std::filesystem::path& path, const Bundle& bundle) {
  writeTo(path, bundle, false, [&](const Writer& fill) { writeFileQuickly(path, fill); });
}

}  // namespace tg
