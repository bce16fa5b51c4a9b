// SPDX-License-Identifier: Apache-2.0
// The table of file formats. A new one is a row of file_format.cpp with its reader and writer: converting, checking,
// help texts and messages follow from the row, and a test shows the line that docs/formats.md then needs.
#pragma once
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "converter/formats/read_options.h"
#include "converter/gltf/write_gltf.h"
#include "converter/registry/file_start.h"
#include "core/bundle/bundle.h"

namespace tg {

// What a writer says of its file: output_bytes of 0 stand for the file's size, texels are those of its textures, the
// rest of GltfReport is of glTF and png only.
struct Written : GltfReport {
  std::string texture_mode;  // of what was written
  std::vector<std::string> warnings;
};

// What a file can hold.
enum Keeps : unsigned {
  kKeepsTextures = 1,
  kKeepsCameras = 2,
  kKeepsSh = 4,      // above degree 0
  kKeepsFloats = 8,  // numbers lose no more than last bits, if nobody asks for less
  kKeepsBackground = 16,
  kKeepsViews = 32,  // named ones
  kKeepsAll = 63
};

struct FileAxes {
  std::string_view words;
  glm::vec3 signs;  // times the file's numbers: the model's
};
inline constexpr FileAxes kModelAxes = {"x right, y down, z forward (COLMAP)", {1.0f, 1.0f, 1.0f}};
inline constexpr FileAxes kGltfAxes = {"+y up, +z forward (glTF)", {-1.0f, -1.0f, 1.0f}};
inline constexpr FileAxes kSpzAxes = {"x right, y up, z back (SPZ)", {1.0f, -1.0f, -1.0f}};

// Of the files that one names.
struct Overlooked {
  std::vector<std::string> broken;             // a line a file, with its path
  std::vector<std::string> repairs, warnings;  // as a Bundle's
};

struct Format {
  std::string_view name;         // in reports; of what is written also the extension, without its dot
  std::string_view spoken = {};  // in sentences that list formats: "our html"
  std::string_view title = {};   // in sentences about what it lacks: "SPZ"
  unsigned keeps = 0;
  int sh_degree = 3;  // the highest, if it keeps SH
  // Null: there is no magic number, the extension says it of a file that nothing else claims.
  bool (*sniff)(const FileStart& start) = nullptr;
  // Null: it is not read.
  Bundle (*read)(const std::filesystem::path& path, const ReadOptions& options) = nullptr;
  // Null: it is not written. Atomic; gets a model without textures where the format holds none.
  void (*write)(const std::filesystem::path& path, const Bundle& source, const WriteOptions& options,
                Written& written) = nullptr;
  // What is wrong with a file; adds "JSON pointer: message", and returns the number of Gaussians. Null: what reading it
  // says. Throws Error for a broken structure.
  std::size_t (*check)(const std::filesystem::path& path, std::vector<std::string>& errors,
                       std::vector<std::string>& warnings) = nullptr;
  // What reading gets by without. Null: nothing. Throws Error for a broken structure.
  Overlooked (*overlooked)(const std::filesystem::path& path) = nullptr;
  // Bytes of the files that one names beside it; 0 of what is not there. Null: it is one file.
  std::uint64_t (*beside)(const std::filesystem::path& path) = nullptr;
  // Whether writing `path` may write `other`, in the same folder, too. Null: it does not, or makes a folder of its own.
  bool (*writes_too)(const std::filesystem::path& path, const std::filesystem::path& other) = nullptr;
  FileAxes axes = kModelAxes;
  bool is_gltf = false;     // or around it
  // A file of a folder is none by its name: any page is an .html, and a tileset's content lies there itself.
  bool names_others = false;
  bool has_base = false;    // beside the textures, for readers that know none
  bool has_steps = false;   // WriteOptions::steps make it smaller and coarser
  bool streams = false;     // written from Gaussians that are not in memory as a whole
  bool is_common = false;   // other files begin like it, too: any archive, any JSON
  bool has_cameras_file = false;  // a cameras.json, which holds some 50,000
  bool writes_beside = false;     // files beside the one that is named, which are never read
  bool whole_name = false;  // `name` is how a file's name ends, without a dot before it; its folder holds the rest

  bool holds(Keeps what) const { return (keeps & what) != 0; }
};

// In the order in which they are tried.
std::span<const Format> formats();
const Format* findFormat(std::string_view name);
// What is read, as sentences name it and in the table's order.
std::vector<std::string> inputNames();
// The extensions, without dots and in alphabetical order, of what is written and, if `read`, can be read again; if not
// `read`, of what cannot.
std::vector<std::string> outputNames(bool read);
// How a file's name ends.
std::string extensionOf(const Format& format);
// "a, b or c".
std::string listed(const std::vector<std::string>& names);

// .splat and .ksplat files have no magic number: they are told by their extension. Throws Error(cannotRead) for what is
// no readable file and Error(badData) for an empty one and for anything else.
const Format& detectFormat(const std::filesystem::path& path);
// By the extension, the longest one that fits. Throws Error(usage).
const Format& outputFormat(const std::filesystem::path& path);
// The same of what can be read again.
const Format& modelFormat(const std::filesystem::path& path);

// A model from any file the toolchain reads. The model has passed checkModel. Throws what detectFormat throws, and
// Error(cannotRead / badData). ReadCancelled: options.progress said so.
Bundle readModel(const std::filesystem::path& path, const ReadOptions& options = {});

// Bytes of a model, in all its files.
std::uint64_t storedBytes(const Format& format, const std::filesystem::path& path);

// Throws Error(cannotWrite) where `path` cannot be written, or not by requireOneFolder(). A format that has a folder of
// its own makes it.
void requireWritable(const Format& format, const std::filesystem::path& path);

// Throws Error(cannotWrite) for a symbolic link into another folder; `why` that must not be.
void requireSameFolder(const std::filesystem::path& path, const std::string& why);
// Whether the file of that format at `path` comes with `other`. Throws Error(cannotWrite) as endOfLinks().
bool writesToo(const Format& format, const std::filesystem::path& path, const std::filesystem::path& other);
// Throws Error(cannotWrite) for a symbolic link into another folder, if the format writes files beside `path`: they
// would lie beside the link, and be missed, or be older ones, where it leads.
void requireOneFolder(const Format& format, const std::filesystem::path& path);

// Throws Error(cannotWrite) where a file of that format cannot hold these: what the writers would say in the end.
void requireStorable(const Format& format, const std::filesystem::path& path, const std::vector<Camera>& cameras);

// The warning where a format holds no textures, and what is written loses those that it had.
std::string lostTextures(const Format& format);

// Whether what is written has the intersection model of every file that names none instead of the model's own.
bool losesIntersection(const Format& format, const GaussianModel& model);

// `source` as `format` holds it, with warnings for what it does not. Throws what the writers throw.
void writeModel(const Format& format, const std::filesystem::path& path, const Bundle& source,
                const WriteOptions& options, Written& written);

}  // namespace tg
