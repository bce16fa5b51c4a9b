// SPDX-License-Identifier: Apache-2.0
// The table of file formats.
#include "converter/registry/file_format.h"

#include <algorithm>
#include <map>
#include <set>
#include <system_error>

#include "converter/formats/read_compressed_ply.h"
#include "converter/formats/read_ksplat.h"
#include "converter/formats/repair.h"
#include "converter/formats/splat.h"
#include "converter/formats/spz.h"
#include "converter/formats/write_compressed_ply.h"
#include "converter/gltf/document.h"
#include "converter/gltf/read_gltf.h"
#include "converter/gltf/read_tiles.h"
#include "converter/gltf/write_gltf.h"
#include "converter/gltf/write_tiles.h"
#include "converter/html/html.h"
#include "converter/lod/lod_scene.h"
#include "converter/lod/places.h"
#include "converter/lod/write_lod.h"
#include "converter/sog/folder.h"
#include "converter/sog/sog.h"
#include "core/bundle/camera_file.h"
#include "core/bundle/ply.h"
#include "core/bundle/read_progress.h"
#include "core/bundle/splat_rows.h"
#include "core/file/file.h"
#include "core/model/fallback.h"
#include "core/model/verbs.h"
#include "core/system/assert.h"
#include "core/system/error.h"
#include "core/system/lower_case.h"

namespace tg {
namespace {

using Path = std::filesystem::path;

bool isSpz(const FileStart& start) { return start.begins("NGSP") || start.inside_gzip == "NGSP"; }

Bundle bundleOf(GaussianModel model) {
  Bundle loaded;
  loaded.model = std::move(model);
  return loaded;
}

Bundle checked(Bundle loaded, const Path& path) {
  checkModel(loaded.model, path.string());
  return loaded;
}

Bundle readAnyGltf(const Path& path, const ReadOptions& options) { return checked(readGltf(path, options), path); }

Bundle readPage(const Path& path, const ReadOptions& options) {
  return checked(parseGltf(readHtmlGlb(path), path.string(), options), path);
}

Bundle readPly(const Path& path, const ReadOptions& options) {
  bool broken = false;
  Bundle loaded = bundleOf(readSplatPly(path, options.progress, &broken));
  if (broken) mendSplats(loaded.model, path.string(), loaded.repairs);
  SplatPlyFile(path).rows().warn(loaded.warnings);
  return loaded;
}

Bundle readPackedPly(const Path& path, const ReadOptions&) {
  std::vector<std::string> warnings;
  Bundle loaded = bundleOf(readCompressedPly(path, &warnings));
  loaded.warnings = std::move(warnings);
  return loaded;
}

void writePly(const Path& path, const Bundle& source, const WriteOptions&, Written&) {
  writeSplatPly(path, source.model);
}

constexpr const char* kClippedScale = "with a scale above e^88.7, which no float holds: clipped";

// Of writeGlb and its kin.
template <GltfReport (*write)(const Path&, const GltfContent&)>
void writeScene(const Path& path, const Bundle& source, const WriteOptions& options, Written& written) {
  static_cast<GltfReport&>(written) =
      write(path, {source.model, source.cameras, source.background, options, source.views, source.knows_background});
  addSplatCount(written.warnings, written.clipped_scales, kClippedScale);
  if (written.dropped_source) {
    written.warnings.push_back("a GLB ends at 4 GiB: the numbers that bring a .ply back bit by bit are left out");
  }
  written.texture_mode = name(written.atlases > 0 ? source.model.texture_mode : TextureMode::none);
}

// For readers that know the texture extension alone, which has one way for textures to end.
template <GltfReport (*write)(const Path&, const GltfContent&)>
void writeGltfScene(const Path& path, const Bundle& source, const WriteOptions& options, Written& written) {
  writeScene<write>(path, source, options, written);
  const TextureOutside outside = source.model.outside;
  if (outside != TextureOutside::base && written.atlases > 0) {
    written.warnings.push_back("glTF has no word for \"outside\": \"" + std::string(name(outside)) +
                               "\": other programs draw the base there");
  }
}

void writeBaseSplat(const Path& path, const Bundle& source, const WriteOptions&, Written& written) {
  const SplatReport splat = writeSplat(path, source.model);
  addSplatCount(written.warnings, splat.clipped_scales, kClippedScale);
  addSplatCount(written.warnings, splat.clipped_colors, "with a colour outside 0 to 255: clipped");
}

void warnSpz(const SpzReport& spz, Written& written) {
  addSplatCount(written.warnings, spz.clipped_scales, "with a scale outside SPZ's e^-10 to e^5.94: clipped");
  addSplatCount(written.warnings, spz.clipped_colors, "with a colour outside SPZ's range: clipped");
  addSplatCount(written.warnings, spz.clipped_sh, "with SH coefficients outside [-1, 1]: clipped");
}

void writeBaseSpz(const Path& path, const Bundle& source, const WriteOptions& options, Written& written) {
  warnSpz(writeSpz(path, source.model, options.spz_version), written);
}

void writeBaseTiles(const Path& path, const Bundle& source, const WriteOptions& options, Written& written) {
  const TilesReport tiles = writeTiles(path, source.model, options.replace);
  warnSpz(tiles.spz, written);
  written.output_bytes = tiles.bytes;
}

void writePackedPly(const Path& path, const Bundle& source, const WriteOptions&, Written& written) {
  CompressedPlyReport packed = writeCompressedPly(path, source.model);
  addSplatCount(written.warnings, packed.clipped_sh, "with SH coefficients outside [-4, 4]: clipped");
  written.order = std::move(packed.order);
}

void warnClipped(std::vector<std::string>& warnings, std::uint64_t count, const std::string& what) {
  if (count == 0) return;
  warnings.push_back(std::to_string(count) + " " + what + " with a channel outside what SOG's steps reach: clipped");
}

void writeOrdered(const Path& path, const Bundle& source, const WriteOptions& options, Written& written) {
  SogReport report;
  written.order = writeSog(
      path, source.model,
      {.steps = options.steps.value_or(1.0f), .texture_step = options.texture_step.value_or(kTextureStep)}, &report);
  written.texels = report.texels;
  if (report.texels == 0) written.texture_mode = name(TextureMode::none);
  if (report.texels == 0 && !source.model.atlas.texels.empty()) {
    written.warnings.emplace_back("nothing is left of the textures in such steps: they are left out");
  }
  warnClipped(written.warnings, report.clipped_texels, "texels");
}

// What many files of one scene say is said once, and not all where each says something else.
void addEachOnce(const Bundle& file, std::vector<std::string>& repairs, std::vector<std::string>& warnings) {
  constexpr std::size_t kMostTold = 5;
  bool all_told = true;
  const auto add = [&](const std::vector<std::string>& some, std::vector<std::string>& told) {
    for (const std::string& line : some) {
      if (std::ranges::find(told, line) != told.end()) continue;
      if (told.size() < kMostTold) {
        told.push_back(line);
      } else {
        all_told = false;
      }
    }
  };
  add(file.repairs, repairs);
  add(file.warnings, warnings);
  const std::string further = "further warnings of its files are left out";
  if (!all_told && std::ranges::find(warnings, further) == warnings.end()) warnings.push_back(further);
}

// The finest level.
Bundle readLevels(const Path& path, const ReadOptions& options) {
  const LodScene scene = readLodScene(path);
  const LodReader reader = lodFolderReader(path);
  const std::vector<std::uint8_t> levels = sameLevel(scene, 0);
  std::map<std::uint32_t, GaussianModel> files;
  std::vector<std::string> repairs, warnings = scene.warnings;
  for (const std::uint32_t file : filesOf(scene, levels)) {
    if (options.progress && options.progress->cancel) throw ReadCancelled();
    Bundle read = readLodFile(scene, file, reader, options.base_only);
    addEachOnce(read, repairs, warnings);
    files.emplace(file, std::move(read.model));
  }
  Bundle loaded =
      bundleOf(assembleLod(scene, levels, [&](std::uint32_t file) -> const GaussianModel& { return files.at(file); }));
  loaded.cameras = readLodCameras(scene, reader, warnings);
  loaded.repairs = std::move(repairs);
  loaded.warnings = std::move(warnings);
  loaded.background = scene.background.value_or(loaded.background);
  loaded.knows_background = scene.background.has_value();
  if (scene.has_environment) loaded.warnings.push_back("\"environment\" is left out");
  return checked(std::move(loaded), path);
}

void writeLevels(const Path& path, const Bundle& source, const WriteOptions&, Written& written) {
  LodReport report = writeLod(path, source);
  warnClipped(written.warnings, report.clipped_texels, "texels of all levels");
  written.output_bytes = report.bytes;
  written.order = std::move(report.order);
}

// The files of all levels.
Overlooked findBrokenLevels(const Path& path) {
  Overlooked found;
  const LodScene scene = readLodScene(path);
  const LodReader reader = lodFolderReader(path);
  found.warnings = scene.warnings;
  const auto attempt = [&](const auto& read) {
    try {
      read();
    } catch (const Error& error) {
      found.broken.emplace_back(error.what());
    }
  };
  const LodPlaces places(scene);
  for (std::uint32_t file = 0; file < scene.files.size(); ++file) {
    attempt([&] {
      const Bundle read = readLodFile(scene, file, reader);
      addEachOnce(read, found.repairs, found.warnings);
      places.require(file, read.model);
    });
  }
  attempt([&] { readLodCameras(scene, reader); });
  return found;
}

std::uint64_t sizeOf(const Path& path) {
  std::error_code missing;
  const std::uintmax_t bytes = std::filesystem::file_size(path, missing);
  return missing ? 0 : bytes;
}

// What lies in the folders of its files.
std::uint64_t bytesOfLevels(const Path& path) {
  const LodScene scene = readLodScene(path);
  const Path folder = path.parent_path();
  std::set<Path> folders;
  for (const std::string& file : scene.files) folders.insert((folder / file).parent_path());
  std::uint64_t bytes = scene.cameras.empty() ? 0 : sizeOf(folder / scene.cameras);
  for (const Path& own : folders) {
    if (own == folder) continue;  // beside files of others
    std::error_code error;
    for (std::filesystem::directory_iterator at(own, error), end; !error && at != end; at.increment(error)) {
      bytes += sizeOf(at->path());
    }
  }
  return bytes;
}

std::uint64_t bytesBesideGltf(const Path& path) {
  std::uint64_t bytes = 0;
  for (const std::string& name : gltfFilesBeside(path)) bytes += sizeOf(path.parent_path() / name);
  return bytes;
}

std::uint64_t bytesOfContent(const Path& path) { return sizeOf(contentOfTileset(path)); }

constexpr Format kFormats[] = {
    {.name = "tgz",
     .spoken = "tgz",
     .title = "a bundle",
     .keeps = kKeepsAll - kKeepsViews,
     .sniff = [](const FileStart& start) { return isGzip(start) && !isSpz(start); },
     .read = [](const Path& path, const ReadOptions& options) { return readBundle(path, {}, options.progress); },
     .write = [](const Path& path, const Bundle& source, const WriteOptions&, Written&) { writeBundle(path, source); },
     .is_common = true,
     .has_cameras_file = true},
    {.name = "ply",
     .spoken = "ply",
     .title = "PLY",
     .keeps = kKeepsSh | kKeepsFloats,
     .sniff = [](const FileStart& start) { return isPly(start) && !isCompressedPly(start); },
     .read = readPly,
     .write = writePly},
    {.name = "compressed.ply",
     .spoken = "compressed ply",
     .title = "compressed PLY",
     .keeps = kKeepsSh,
     .sniff = isCompressedPly,
     .read = readPackedPly,
     .write = writePackedPly},
    {.name = "splat",
     .spoken = "splat",
     .title = ".splat",
     .read = [](const Path& path, const ReadOptions&) { return checked(readSplat(path), path); },
     .write = writeBaseSplat},
    {.name = "ksplat",
     .spoken = "ksplat",
     .keeps = kKeepsSh,
     .sh_degree = 2,
     .read = [](const Path& path, const ReadOptions&) { return checked(readKsplat(path), path); }},
    {.name = "spz",
     .spoken = "spz",
     .title = "SPZ",
     .keeps = kKeepsSh,
     .sniff = isSpz,
     .read = [](const Path& path, const ReadOptions& options) { return readSpz(path, options.spz_axes); },
     .write = writeBaseSpz,
     .axes = kSpzAxes},
    {.name = "sog",
     .spoken = "sog",
     .title = "SOG",
     .keeps = kKeepsTextures | kKeepsSh,
     .sniff = [](const FileStart& start) { return start.begins("PK\3\4"); },
     .read = [](const Path& path, const ReadOptions& options) { return readSog(path, options.base_only); },
     .write = writeOrdered,
     .has_base = true,
     .has_steps = true,
     .is_common = true},
    {.name = kSogMetaName,
     .spoken = "meta.json",
     .keeps = kKeepsTextures | kKeepsSh,
     .sniff = [](const FileStart& start) { return start.json == JsonKind::sog; },
     .read = [](const Path& path, const ReadOptions& options) { return readSogFolder(path, options.base_only); },
     .beside = bytesOfSogImages,
     .names_others = true,  // a.meta.json of anything
     .has_base = true,
     .whole_name = true},
    {.name = kLodMetaName,
     .spoken = "lod-meta.json",
     .title = "lod-meta.json",
     .keeps = kKeepsTextures | kKeepsCameras | kKeepsSh | kKeepsBackground,
     .sniff = [](const FileStart& start) { return start.json == JsonKind::levels; },
     .read = readLevels,
     .write = writeLevels,
     .overlooked = findBrokenLevels,
     .beside = bytesOfLevels,
     .has_base = true,
     .has_cameras_file = true,
     .whole_name = true},
    {.name = kTilesetName,
     .spoken = "tileset.json",
     .title = "3D Tiles",
     .keeps = kKeepsSh,
     .sniff = [](const FileStart& start) { return start.json == JsonKind::tileset; },
     .read = [](const Path& path, const ReadOptions& options) { return checked(readTiles(path, options), path); },
     .write = writeBaseTiles,
     .beside = bytesOfContent,
     .axes = kGltfAxes,
     .names_others = true,
     .has_base = true,   // where its content is textured, which is not written
     .is_common = true,  // in a folder its content is read as well
     .whole_name = true},
    {.name = "glb",
     .spoken = "glb",
     .keeps = kKeepsAll,
     .sniff = [](const FileStart& start) { return start.begins("glTF"); },
     .read = readAnyGltf,
     .write = writeGltfScene<writeGlb>,
     .check = checkGltf,
     .axes = kGltfAxes,
     .is_gltf = true,
     .has_base = true,
     .has_steps = true,
     .streams = true},
    {.name = "gltf",
     .spoken = "gltf",
     .keeps = kKeepsAll,
     .sniff = [](const FileStart& start) { return start.json == JsonKind::gltf; },
     .read = readAnyGltf,
     .write = writeGltfScene<writeGltf>,
     .check = checkGltf,
     .beside = bytesBesideGltf,
     .writes_too = isBesideGltf,
     .axes = kGltfAxes,
     .is_gltf = true,
     .has_base = true,
     .has_steps = true,
     .streams = true,
     .is_common = true},
    {.name = "html",
     .spoken = "our html",
     .keeps = kKeepsAll,
     .sniff = [](const FileStart& start) { return start.begins(kHtmlStart); },
     .read = readPage,
     .write = writeScene<writeHtml>,
     .axes = kGltfAxes,
     .is_gltf = true,
     .names_others = true,
     .has_base = true,
     .has_steps = true},
    {.name = "png", .keeps = kKeepsTextures | kKeepsFloats, .write = writeScene<writeAtlas>, .writes_beside = true},
};

// Of what is written; of models alone where `read_again`.
const Format& formatByName(const Path& path, bool read_again) {
  const std::string name = lowerCase(path.filename().string());
  const Format* found = nullptr;
  std::vector<std::string> known;
  for (const Format& format : kFormats) {
    if (!format.write || (read_again && !format.read)) continue;
    known.push_back(extensionOf(format));
    if (!name.ends_with(known.back())) continue;
    if (!found || format.name.size() > found->name.size()) found = &format;  // .compressed.ply before .ply
  }
  if (found && (found->whole_name || name != extensionOf(*found))) return *found;
  const bool is_read = std::ranges::any_of(
      kFormats, [&](const Format& format) { return !format.write && name.ends_with(extensionOf(format)); });
  std::ranges::sort(known);
  throw Error(ErrorKind::usage, path.string(),
              std::string(is_read      ? "is not written"
                          : read_again ? "is no model format"
                                       : "unknown output format") +
                  " (expected " + listed(known) + ", found \"" + path.extension().string() + "\")");
}

}  // namespace

std::span<const Format> formats() { return kFormats; }

const Format* findFormat(std::string_view name) {
  const Format* found = std::ranges::find(kFormats, name, &Format::name);
  return found == std::end(kFormats) ? nullptr : found;
}

std::vector<std::string> inputNames() {
  std::vector<std::string> names;
  for (const Format& format : kFormats) {
    if (format.read) names.emplace_back(format.spoken);
  }
  return names;
}

std::vector<std::string> outputNames(bool read) {
  std::vector<std::string> names;
  for (const Format& format : kFormats) {
    if (format.write && (format.read != nullptr) == read) names.emplace_back(format.name);
  }
  std::ranges::sort(names);
  return names;
}

std::string extensionOf(const Format& format) { return std::string(format.whole_name ? "" : ".").append(format.name); }

std::string listed(const std::vector<std::string>& names) {
  TG_ASSERT(!names.empty(), "something to list");
  std::string text = names.front();
  for (std::size_t i = 1; i < names.size(); ++i) {
    text += (i + 1 < names.size() ? ", " : " or ") + names[i];
  }
  return text;
}

const Format& detectFormat(const Path& path) {
  const FileStart start = readFileStart(path);
  if (start.bytes.empty()) throw Error(ErrorKind::badData, path.string(), "the file is empty");
  for (const Format& format : kFormats) {
    if (format.sniff && format.sniff(start)) return format;
  }
  for (const Format& format : kFormats) {
    if (!format.sniff && format.read && lowerExtension(path) == extensionOf(format)) return format;
  }
  throw Error(ErrorKind::badData, path.string(), "is no splat model (expected a " + listed(inputNames()) + " file)");
}

const Format& outputFormat(const Path& path) { return formatByName(path, false); }
const Format& modelFormat(const Path& path) { return formatByName(path, true); }

Bundle readModel(const Path& path, const ReadOptions& options) {
  const Format& format = detectFormat(path);
  Bundle loaded = format.read(path, options);
  loaded.format = format.name;
  loaded.warnings.insert(loaded.warnings.begin(), loaded.repairs.begin(), loaded.repairs.end());
  loaded.repairs.clear();
  if (!format.holds(kKeepsBackground)) loaded.knows_background = false;
  return loaded;
}

std::uint64_t storedBytes(const Format& format, const Path& path) {
  return sizeOf(path) + (format.beside ? format.beside(path) : 0);
}

void requireWritable(const Format& format, const Path& path) {
  std::error_code ignored;
  const bool makes_folder =
      format.whole_name && path.has_parent_path() && !std::filesystem::exists(path.parent_path(), ignored);
  tg::requireWritable(makes_folder ? path.parent_path() : path);
  requireOneFolder(format, path);
}

bool writesToo(const Format& format, const Path& path, const Path& other) {
  if (!format.writes_too) return false;
  const Path place = placeOfOutput(path), other_place = placeOfOutput(other);
  return place.parent_path() == other_place.parent_path() && format.writes_too(path, other_place);
}

void requireSameFolder(const Path& path, const std::string& why) {
  const Path place = endOfLinks(path);
  const auto folderOf = [](const Path& file) { return file.has_parent_path() ? file.parent_path() : Path("."); };
  std::error_code ignored;
  if (place == path || std::filesystem::equivalent(folderOf(path), folderOf(place), ignored)) return;
  throw Error(ErrorKind::cannotWrite, path.string(),
              "is a symbolic link into another folder, and " + why + " (expected " + place.string() + ")");
}

void requireOneFolder(const Format& format, const Path& path) {
  if (!format.beside && !format.writes_beside) return;
  requireSameFolder(path, "its other files lie beside it");
  const Path place = endOfLinks(path);
  if (format.beside || place.filename() == path.filename()) return;
  throw Error(
      ErrorKind::cannotWrite, path.string(),
      "is a symbolic link to another name, by which its other files are called (expected " + place.string() + ")");
}

void requireStorable(const Format& format, const Path& path, const std::vector<Camera>& cameras) {
  if (format.has_cameras_file) (void)storedCameras(cameras, path.string());
}

std::string lostTextures(const Format& format) {
  return std::string(format.title) + " holds no textures: their means go into colours and opacities, the rest is lost";
}

bool losesIntersection(const Format& format, const GaussianModel& model) {
  // It stands beside the cameras, or else with the textures.
  const bool names_it = format.holds(kKeepsCameras) || (format.holds(kKeepsTextures) && isTextured(model));
  return !names_it && model.intersection != GaussianModel().intersection;
}

void writeModel(const Format& format, const Path& path, const Bundle& source, const WriteOptions& options,
                Written& written) {
  requireOneFolder(format, path);
  const std::string title(format.title);  // of what lacks something that is told; "" of a .png
  if (!title.empty() && !format.holds(kKeepsCameras) && !source.cameras.empty()) {
    written.warnings.push_back(title + " holds no cameras: they are left out");
  }
  if (!title.empty() && !format.holds(kKeepsViews) && !source.views.empty()) {
    written.warnings.push_back(title + " holds no named views: they are left out");
  }
  if (!title.empty() && !format.holds(kKeepsBackground) && source.background != Bundle().background) {
    written.warnings.push_back(title + " holds no background: it is black for whoever reads the file");
  }
  if (!title.empty() && !format.holds(kKeepsSh) && source.model.sh_degree > 0) {
    written.warnings.push_back(title + " holds no SH: colours are those of degree 0");
  }
  if (!title.empty() && losesIntersection(format, source.model)) {
    written.warnings.push_back(title + " has no word for the intersection model " +
                               std::string(name(source.model.intersection)) + ": it becomes " +
                               std::string(name(GaussianModel().intersection)));
  }
  written.texture_mode = name(format.holds(kKeepsTextures) ? source.model.texture_mode : TextureMode::none);
  if (format.holds(kKeepsTextures) || !isTextured(source.model)) {
    format.write(path, source, options, written);
    if (written.texels == 0 && written.texture_mode != name(TextureMode::none)) {
      for (const TextureRect& rect : source.model.atlas.rects) written.texels += rect.texelCount();
    }
    return;
  }
  written.warnings.push_back(lostTextures(format));
  Bundle base = bundleOf(bakeFallback(source.model, FallbackScale::fitted));
  base.cameras = source.cameras;
  base.views = source.views;
  base.background = source.background;
  base.knows_background = source.knows_background;
  format.write(path, base, options, written);
}

}  // namespace tg
