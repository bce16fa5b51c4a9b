// SPDX-License-Identifier: Apache-2.0
// Photographs to copies that COLMAP and training read alike.
#include "training/photos/prepare.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <set>
#include <string_view>
#include <utility>

#include "core/file/file.h"
#include "core/file/json.h"
#include "core/system/error.h"
#include "core/system/numbers.h"
#include "core/system/shell_word.h"
#include "training/data/dataset.h"
#include "training/photos/child.h"
#include "training/photos/film.h"
#include "training/photos/photograph.h"

namespace tg {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kFewestPhotographs = 3;
constexpr std::size_t kNamed = 5;  // files in one message

std::string identity(const fs::path& file) {
  std::error_code ignored;
  return std::to_string(fs::file_size(file, ignored)) + " " +
         std::to_string(fs::last_write_time(file, ignored).time_since_epoch().count());
}

std::string someOf(const std::vector<std::string>& names) {
  std::string text;
  for (std::size_t i = 0; i < std::min(names.size(), kNamed); ++i) text += (i > 0 ? ", " : "") + names[i];
  return names.size() > kNamed ? text + " and " + std::to_string(names.size() - kNamed) + " more" : text;
}

std::string unreadWords(const PhotographList& list) {
  return "pictures in formats that are not read: " + someOf(list.unread) + " (export them as JPEG)";
}
std::string drawnWords(const PhotographList& list) {
  std::vector<std::string> names;
  for (const fs::path& picture : list.drawn) names.push_back(picture.string());
  return std::to_string(names.size()) + (names.size() == 1 ? " picture" : " pictures") +
         " that a program of this project drew: " + someOf(names);
}
std::string filmWords(const fs::path& folder, const PhotographList& list) {
  return someOf(list.films) + " (a film has a command of its own: `tgtrain photos " +
         (folder / list.films.front()).string() + " -o model.tgz`)";
}

// `list`: what else lies in a folder.
[[noreturn]] void tooFew(const fs::path& input, std::size_t found, const PhotographList& list = {}) {
  throw Error(ErrorKind::badData, input.string(),
              "too few photographs" +
                  expectedFound("at least " + std::to_string(kFewestPhotographs) +
                                    " JPEG, PNG, WebP, HEIC or AVIF files, better 30 to 200",
                                std::to_string(found)) +
                  (list.closed.empty() ? "" : "; cannot be read: " + someOf(list.closed)) +
                  (list.ignored.empty() ? "" : "; no photographs by their bytes: " + someOf(list.ignored)) +
                  (list.drawn.empty() ? "" : "; it holds " + drawnWords(list)) +
                  (list.masks.empty() ? "" : "; what lies in a folder `masks` counts as masks") +
                  (list.unread.empty() ? "" : "; it holds " + unreadWords(list)) +
                  (list.films.empty() ? "" : "; it holds " + filmWords(input, list)));
}

// What is seen of a picture from afar: its light over a grid of at most kGlance x kGlance.
constexpr int kGlance = 32;
std::vector<float> glanceAt(const Image& image) {
  const Image small = reducedTo(image, std::min(kGlance, image.width), std::min(kGlance, image.height));
  const std::size_t channels = small.channels;
  std::vector<float> light(small.data.size() / channels);
  for (std::size_t i = 0; i < light.size(); ++i) {
    const float* const pixel = &small.data[i * channels];
    light[i] = channels == 1 ? pixel[0] : 0.299f * pixel[0] + 0.587f * pixel[1] + 0.114f * pixel[2];
    if (channels == 4) light[i] *= pixel[3];
  }
  return light;
}
// One picture in two formats differs by up to 0.025 anywhere (JPEG and WebP of quality 30), the nearest views of one
// scene by 0.18 somewhere (fern, fox, lego, printshop).
bool lookAlike(const std::vector<float>& a, const std::vector<float>& b) {
  constexpr float kSame = 0.06f;
  return std::ranges::equal(a, b, [](float x, float y) { return std::abs(x - y) <= kSame; });
}

bool differInExtension(const fs::path& a, const fs::path& b) {
  return fs::path(a).replace_extension() == fs::path(b).replace_extension();
}

// A photograph whose name others have with another extension.
struct Namesake {
  fs::path source;   // below the folder
  std::string name;  // below images/
  int width = 0;
  int height = 0;
  std::vector<float> glance;
  bool masked = false;
};

// A photograph as it is kept: bytes as they are where nothing has to be done.
Prepared keep(const fs::path& source, TakenPhotograph photograph, int longest_side, const fs::path& folder,
              const std::string& plain_name) {
  const int longer = std::max(photograph.image.width, photograph.image.height);
  if (longest_side > 0 && longer > longest_side) {
    const auto reduced = [&](int side) {
      return std::max(1, static_cast<int>(std::lround(double(side) * longest_side / longer)));
    };
    const int width = reduced(photograph.image.width), height = reduced(photograph.image.height);
    photograph.image = reducedTo(std::move(photograph.image), width, height);
    photograph.as_stored = PictureFormat::none;
  }
  Prepared prepared;
  const bool png = photograph.as_stored == PictureFormat::png || photograph.image.channels == 4;
  prepared.name = plain_name + (png ? ".png" : ".jpg");
  prepared.width = photograph.image.width;
  prepared.height = photograph.image.height;
  prepared.camera = photograph.facts.camera;
  prepared.focal = photograph.facts.focal_per_diagonal * std::hypot(double(prepared.width), double(prepared.height));
  prepared.place = photograph.facts.place;
  if (photograph.as_stored != PictureFormat::none) {
    copyFileAtomically(source, folder / prepared.name);
  } else {
    writeImage(folder / prepared.name, photograph.image);
  }
  return prepared;
}

// By its first bytes: zip, gzip, xz, Zstandard, bzip2, 7z, rar, tar.
bool isArchive(const fs::path& file) {
  constexpr std::size_t kTarMagic = 257;
  std::string head(kTarMagic + 5, '\0');
  std::ifstream stream(file, std::ios::binary);
  stream.read(head.data(), static_cast<std::streamsize>(head.size()));
  constexpr std::string_view kMagics[] = {"PK\3\4", "\37\213", "\3757zXZ", "(\265/\375", "BZh", "7z\274\257", "Rar!"};
  return std::ranges::any_of(kMagics, [&](std::string_view magic) { return head.starts_with(magic); }) ||
         head.compare(kTarMagic, 5, "ustar") == 0;
}

// However a folder is spelled.
fs::path placeOf(const fs::path& folder) { return fs::absolute(folder / "").lexically_normal().parent_path(); }

// Of a file in the folder, or beside it.
std::string nameFrom(const fs::path& folder, const fs::path& file) {
  return fs::absolute(file).lexically_normal().lexically_relative(placeOf(folder)).string();
}

// The folder of masks beside an input that is called images; empty for another.
fs::path masksBeside(const fs::path& input) {
  const fs::path place = placeOf(input);
  return place.filename() == "images" ? place.parent_path() / "masks" : fs::path();
}

// The mask of a photograph by their names: in a folder masks anywhere along the photograph's path, where it may stand
// in the place of one called images, also if the input itself is called so. Empty: none.
fs::path maskOf(const fs::path& input, const fs::path& photograph) {
  std::vector<fs::path> names;
  if (const fs::path beside = masksBeside(input); !beside.empty()) names.push_back(beside / photograph);
  fs::path above = input;
  for (auto part = photograph.begin(); part != photograph.end(); above /= *part++) {
    const auto from = [&](fs::path::iterator begin) {
      fs::path rest;
      for (; begin != photograph.end(); ++begin) rest /= *begin;
      return rest;
    };
    names.push_back(above / "masks" / from(part));
    if (*part == "images") names.push_back(above / "masks" / from(std::next(part)));
  }
  for (const fs::path& name : names) {
    if (fs::path mask = maskNamedFor(name); !mask.empty()) return mask;
  }
  return {};
}

// A mask, and its photograph as EXIF turns it.
struct FoundMask {
  fs::path file;
  int orientation = 1;  // of the photograph as it is stored
  int width = 0;        // of the upright photograph
  int height = 0;
  fs::path kept;

  bool mayBeTurned() const { return orientation > 1; }
  // Whether a mask that lies as the photograph is stored has another shape than an upright one.
  bool showsHowItLies() const { return orientation >= 5 && width != height; }
};

// The mask of the upright photograph: as it is where it has that shape, else turned with the photograph; where both
// have one shape `turns` decides. Training takes masks that are larger than what a photograph was reduced to. Returns
// whether it was upright.
bool keepMask(const FoundMask& mask, bool turns) {
  Image image = readImage(mask.file);
  const auto hasSize = [&](int width, int height) { return image.width == width && image.height == height; };
  const bool upright = hasSize(mask.width, mask.height);
  const bool swaps = mask.orientation >= 5;
  if (!upright && !(swaps && hasSize(mask.height, mask.width))) {
    throw Error(ErrorKind::badData, mask.file.string(),
                "is of another size than its photograph" +
                    expectedFound(std::to_string(mask.width) + " x " + std::to_string(mask.height),
                                  std::to_string(image.width) + " x " + std::to_string(image.height)));
  }
  if (mask.mayBeTurned() && (mask.showsHowItLies() ? !upright : turns)) {
    writeImage(mask.kept, turned(std::move(image), mask.orientation));
    return false;
  }
  copyFileAtomically(mask.file, mask.kept);
  return true;
}

// Keeps those that it can, and tells of the others. Masks of one folder were made in one way: those whose shape shows
// nothing lie as the others do. Returns how many were kept.
std::size_t keepMasks(std::vector<FoundMask> masks, const fs::path& input, const PhotosListener& listener,
                      const std::atomic<int>& stop) {
  const auto unclear = std::stable_partition(
      masks.begin(), masks.end(), [](const FoundMask& mask) { return !mask.mayBeTurned() || mask.showsHowItLies(); });
  std::size_t kept = 0;
  bool some_upright = false, some_turned = false;
  std::vector<std::string> guessed;
  for (auto mask = masks.begin(); mask != masks.end(); ++mask) {
    if (stop != 0) throw Stopped();
    try {
      const bool upright = keepMask(*mask, !some_upright);
      ++kept;
      if (mask >= unclear) {
        guessed.push_back(nameFrom(input, mask->file));
      } else if (mask->mayBeTurned()) {
        (upright ? some_upright : some_turned) = true;
      }
    } catch (const Error& error) {
      if (error.kind == ErrorKind::cannotWrite) throw;
      listener.warn(std::string(error.what()) + ": left out");
    }
  }
  if (!guessed.empty() && !some_upright && !some_turned) {
    listener.warn(input.string() + ": turned as EXIF turns their photographs, though nothing shows whether they are " +
                  "upright already, masks: " + someOf(guessed) + " (if they are, save these photographs upright, too)");
  }
  return kept;
}

void tellOfOthers(const fs::path& input, const PhotographList& list, const PhotosListener& listener) {
  if (!list.closed.empty()) listener.warn(input.string() + ": cannot be read: " + someOf(list.closed));
  if (!list.ignored.empty()) {
    listener.warn(input.string() + ": ignored, no photographs: " + someOf(list.ignored));
  }
  if (!list.drawn.empty()) listener.warn(input.string() + ": left out, " + drawnWords(list));
  if (!list.unread.empty()) listener.warn(input.string() + ": ignored, " + unreadWords(list));
  if (!list.films.empty()) listener.warn(input.string() + ": ignored, " + filmWords(input, list));
}

// All that there are.
std::set<fs::path> masksFor(const fs::path& input, const PhotographList& list) {
  std::set<fs::path> masks;
  for (const fs::path& mask : list.masks) masks.insert(input / mask);
  std::error_code ignored;
  if (const fs::path beside = masksBeside(input); fs::is_directory(beside, ignored)) {
    const PhotographList there = findPhotographs(beside);
    for (const auto* pictures : {&there.photographs, &there.drawn, &there.masks}) {
      for (const fs::path& mask : *pictures) masks.insert(beside / mask);
    }
  }
  return masks;
}

std::vector<Prepared> prepareFolder(const PhotosOptions& options, const fs::path& folder, const fs::path& masks,
                                    const PhotosListener& listener, const std::atomic<int>& stop) {
  PhotographList list = findPhotographs(options.input);
  std::vector<std::string> copies;  // one that is held out while its twin trains would be scored too well
  for (const auto& [copy, original] : takeOutCopies(options.input, list.photographs)) {
    copies.push_back(copy.string() + " (of " + original.string() + ")");
  }
  if (!copies.empty()) listener.warn(options.input.string() + ": left out, copies: " + someOf(copies));
  std::vector<fs::path> mask_of;
  for (const fs::path& photograph : list.photographs) {
    const fs::path mask = mask_of.emplace_back(maskOf(options.input, photograph));
    // Whoever reads it says what is wrong with it.
    if (mask.empty()) continue;
    const std::string name = nameFrom(options.input, mask);
    std::erase(list.ignored, name);
    std::erase_if(list.closed, [&](const std::string& why) { return why.substr(0, why.rfind(" (")) == name; });
  }
  tellOfOthers(options.input, list, listener);
  const std::vector<std::string> names = plainNames(list.photographs);
  std::vector<Prepared> prepared;
  std::set<fs::path> without_photograph = masksFor(options.input, list);
  std::vector<FoundMask> found;
  std::vector<Namesake> namesakes;  // of a photograph, those before it
  std::vector<std::string> in_another_format;
  int largest = 0;  // [px] of the longer sides
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (stop != 0) throw Stopped();
    listener.progress("preparing photographs", i, names.size());
    const fs::path source = options.input / list.photographs[i];
    const fs::path& mask = mask_of[i];
    without_photograph.erase(mask);
    const auto isNamesake = [&](std::size_t other) {  // they stand beside each other
      return other < names.size() && differInExtension(list.photographs[other], list.photographs[i]);
    };
    if (!isNamesake(i - 1)) namesakes.clear();
    try {
      TakenPhotograph photograph = readPhotograph(source);
      const int orientation = photograph.facts.orientation;
      const int width = photograph.image.width, height = photograph.image.height;
      std::vector<float> glance;
      if (isNamesake(i - 1) || isNamesake(i + 1)) {
        glance = glanceAt(photograph.image);
        const auto original = std::ranges::find_if(namesakes, [&](const Namesake& other) {
          return other.width == width && other.height == height && lookAlike(other.glance, glance);
        });
        if (original != namesakes.end()) {
          in_another_format.push_back(list.photographs[i].string() + " (of " + original->source.string() + ")");
          if (!mask.empty() && !std::exchange(original->masked, true)) {
            found.push_back({mask, orientation, width, height, masks / (original->name + ".png")});
          }
          continue;
        }
      }
      largest = std::max({largest, width, height});
      prepared.push_back(keep(source, std::move(photograph), options.longest_side, folder, names[i]));
      prepared.back().source = list.photographs[i].string();
      if (!glance.empty()) {
        namesakes.push_back({list.photographs[i], prepared.back().name, width, height, glance, !mask.empty()});
      }
      if (mask.empty()) continue;
      found.push_back({mask, orientation, width, height, masks / (prepared.back().name + ".png")});
    } catch (const Error& error) {
      if (error.kind == ErrorKind::cannotWrite) throw;
      listener.warn(std::string(error.what()) + ": left out");
    }
  }
  if (!in_another_format.empty()) {
    listener.warn(options.input.string() + ": left out, copies in another format: " + someOf(in_another_format));
  }
  if (const std::size_t masked = keepMasks(std::move(found), options.input, listener, stop); masked > 0) {
    listener.say(std::to_string(masked) + " of " + std::to_string(prepared.size()) + " photographs have a mask");
  }
  if (!without_photograph.empty()) {
    std::vector<std::string> ignored;
    for (const fs::path& mask : without_photograph) ignored.push_back(nameFrom(options.input, mask));
    listener.warn(options.input.string() + ": ignored, masks of no photograph: " + someOf(ignored) +
                  " (expected NAME.EXTENSION.png, NAME.EXTENSION.mask.png, NAME.png or NAME_mask.png)");
  }
  listener.progress("preparing photographs", names.size(), names.size());
  if (prepared.size() < kFewestPhotographs) tooFew(options.input, prepared.size(), list);
  if (options.longest_side > 0 && largest > options.longest_side) {
    listener.say("photographs of up to " + std::to_string(largest) + " px are reduced to " +
                 std::to_string(options.longest_side) +
                 " px on the longer side (--longest-side N for another, 0 for none)");
  }
  return prepared;
}

std::vector<Prepared> prepareFilm(const PhotosOptions& options, const fs::path& folder, const fs::path& log,
                                  const PhotosListener& listener, const std::atomic<int>& stop) {
  const std::optional<fs::path> ffmpeg = findProgram("ffmpeg");
  if (!ffmpeg) {
    throw Error(
        ErrorKind::device,
        "no ffmpeg found to take frames from a film (expected it on the PATH, as `apt install ffmpeg` puts it there)");
  }
  SharpnessMeter meter;
  FilmFacts facts;
  const auto judged = [&](std::span<const std::uint8_t> bytes) {
    meter.add(bytes);
    if (facts.frames() == 0) return;
    const std::size_t done = meter.frames().size();
    listener.progress("looking for sharp frames", std::min(done, facts.frames() - 1), facts.frames());
  };
  const ChildEnd looked = runChild(
      {judgeFrames(ffmpeg->string(), options.input), log, [&](std::string_view line) { facts.read(line); }, judged},
      stop);
  const std::string input = options.input.string();
  if (meter.frames().empty() && facts.onlySound()) {
    throw Error(ErrorKind::badData, input, "holds no moving pictures (expected a film, found sound or a cover alone)");
  }
  if (meter.frames().empty()) {
    throw Error(ErrorKind::badData, input,
                "is no film that ffmpeg can read, nor a folder of photographs: " + looked.last);
  }
  if (looked.code != 0) listener.warn(input + ": broken after frame " + std::to_string(meter.frames().size()));
  const std::vector<std::size_t> chosen = sharpestFrames(meter.frames(), static_cast<std::size_t>(options.frames));
  if (chosen.size() < kFewestPhotographs) {
    throw Error(ErrorKind::badData, input,
                "too short a film" +
                    expectedFound("at least " + std::to_string(kFewestPhotographs) + " frames, better 30 seconds",
                                  std::to_string(chosen.size())));
  }
  if (!facts.pixelShape().empty()) {
    listener.say("the film's pixels are no squares (" + facts.pixelShape() + "): frames are stretched until they are");
  }
  FilterList filters;
  if (facts.transfer() != Transfer::sdr) {
    runChild({listFilters(ffmpeg->string()), log, [&](std::string_view line) { filters.read(line); }, {}}, stop);
    const std::string kind = facts.transfer() == Transfer::pq ? "HDR (PQ)" : "HDR (HLG)";
    if (filters.mapsTones()) {
      listener.say("the film is in " + kind + ": its frames are mapped to a common screen's brightness and colours");
    } else {
      listener.warn(input + ": is in " + kind + ", and frames come out pale" +
                    expectedFound("an ffmpeg with the filters zscale and tonemap, as Debian's", ffmpeg->string()));
    }
  }
  const ChildEnd taken = runChild(
      {extractFrames(ffmpeg->string(), options.input, chosen, options.longest_side, folder, facts, filters.mapsTones()),
       log,
       {},
       {}},
      stop);
  std::vector<Prepared> prepared;
  int width = 0, height = 0;
  for (std::size_t i = 0; i < chosen.size(); ++i) {
    const fs::path file = folder / formatted("%06zu.jpg", i + 1);
    if (!isFile(file)) continue;
    if (width == 0) {
      const Image image = readImage(file);
      width = image.width;
      height = image.height;
    }
    Prepared& frame = prepared.emplace_back();
    frame.name = formatted("frame_%06zu.jpg", chosen[i] + 1);
    frame.source = "frame " + std::to_string(chosen[i] + 1);
    frame.width = width;
    frame.height = height;
    fs::rename(file, folder / frame.name);
  }
  // A film that broke before has an end of its own.
  const bool ended_early = looked.code == 0 && (taken.code != 0 || prepared.size() < chosen.size());
  if (ended_early || prepared.size() < kFewestPhotographs) {
    throw Error(ErrorKind::badData, input,
                "ffmpeg did not take all frames from it" +
                    expectedFound(std::to_string(chosen.size()) + " frames and exit code 0",
                                  std::to_string(prepared.size()) + " and " + std::to_string(taken.code)) +
                    ": " + taken.last);
  }
  listener.say("the sharpest " + std::to_string(prepared.size()) + " of " + std::to_string(meter.frames().size()) +
               " frames are kept, " + std::to_string(width) + " x " + std::to_string(height) +
               " (--frames N for more, --longest-side N for another size)");
  return prepared;
}

}  // namespace

std::string madeOf(const PhotosOptions& options) {
  const fs::path& input = options.input;
  std::error_code error;
  const fs::file_status status = fs::status(input, error);
  if (!fs::exists(status)) {
    throw Error(ErrorKind::cannotRead, input.string(), "cannot open: " + (error ? error.message() : "not there"));
  }
  const std::string size = "longest side " + std::to_string(options.longest_side) + "\n";
  if (!fs::is_directory(status)) {
    if (pictureFormat(input) != PictureFormat::none) tooFew(input, 1);
    if (fs::is_regular_file(status) && isArchive(input)) {
      throw Error(ErrorKind::badData, input.string(),
                  "is an archive (expected a folder of photographs or a film: unpack it first)");
    }
    return "film " + identity(input) + "\nframes " + std::to_string(options.frames) + "\n" + size;
  }
  if (hasCameras(input)) {
    throw Error(ErrorKind::usage, input.string(),
                "is a data set with cameras already: `tgtrain " + shellWord(input.string()) +
                    " -o model.tgz` trains it (its folder of photographs alone gets new cameras)");
  }
  const PhotographList list = findPhotographs(input);
  if (list.photographs.size() < kFewestPhotographs) tooFew(input, list.photographs.size(), list);
  std::string text = size;
  for (const fs::path& photograph : list.photographs) {
    text += photograph.string() + " " + identity(input / photograph) + "\n";
    if (const fs::path mask = maskOf(input, photograph); !mask.empty()) {
      text += nameFrom(input, mask) + " " + identity(mask) + "\n";
    }
  }
  return text;
}

std::vector<Prepared> prepareImages(const PhotosOptions& options, const fs::path& folder, const fs::path& masks,
                                    const fs::path& log, const PhotosListener& listener, const std::atomic<int>& stop) {
  std::error_code ignored;
  return fs::is_directory(options.input, ignored) ? prepareFolder(options, folder, masks, listener, stop)
                                                  : prepareFilm(options, folder, log, listener, stop);
}

std::string toJson(const std::vector<Prepared>& photographs) {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const Prepared& photograph : photographs) {
    nlohmann::ordered_json entry = {{"name", photograph.name},     {"source", photograph.source},
                                    {"width", photograph.width},   {"height", photograph.height},
                                    {"camera", photograph.camera}, {"focal", photograph.focal}};
    if (photograph.place) entry["place"] = {photograph.place->latitude, photograph.place->longitude};
    list.push_back(std::move(entry));
  }
  return dumpJson(list);
}

std::vector<Prepared> preparedFromJson(const std::string& json) {
  const std::string path = Ledger::kFile;
  const nlohmann::json list = parseJson(json, path);
  std::vector<Prepared> photographs;
  const JsonNode node{list, path, "photographs"};
  for (const nlohmann::json& value : node.array().value) {
    const JsonNode entry{value, path, "photograph " + std::to_string(photographs.size())};
    Prepared& photograph = photographs.emplace_back();
    photograph.name = entry.string("name");
    const bool plain = std::ranges::all_of(photograph.name, [](unsigned char c) {
      return std::isalnum(c) || c == '_' || c == '-' || c == '.' || c >= 0x80;
    });
    if (!plain || photograph.name.starts_with(".")) entry.fail("no plain name");
    photograph.source = entry.string("source");
    photograph.width = static_cast<int>(entry.integer("width", 1, 1 << 20));
    photograph.height = static_cast<int>(entry.integer("height", 1, 1 << 20));
    photograph.camera = entry.string("camera");
    photograph.focal = entry.number("focal", 0, 1e9);
    if (entry.has("place")) {
      const auto place = entry.numbers<2>("place");
      photograph.place = Place{place[0], place[1]};
    }
  }
  return photographs;
}

void makeEmpty(const fs::path& folder) {
  std::error_code error;
  fs::remove_all(folder, error);
  if (!error) fs::create_directories(folder, error);
  if (error) throw Error(ErrorKind::cannotWrite, folder.string(), "cannot make this folder: " + error.message());
}

void giveName(const fs::path& folder, const fs::path& name) {
  std::error_code error;
  fs::remove_all(name, error);
  if (!error) fs::rename(folder, name, error);
  if (error) throw Error(ErrorKind::cannotWrite, name.string(), "cannot make this folder: " + error.message());
}

}  // namespace tg
