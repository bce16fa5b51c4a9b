// SPDX-License-Identifier: Apache-2.0
// One walk over the fields of RunState serves the writer and the reader.
#include "training/run/checkpoint.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>
#include <zlib.h>

#include <algorithm>
#include <bit>
#include <cerrno>
#include <charconv>
#include <concepts>
#include <cstdio>
#include <cstring>
#include <memory>
#include <new>
#include <sstream>
#include <system_error>
#include <type_traits>
#include <vector>

#include "core/file/file.h"
#include "core/system/assert.h"
#include "core/system/error.h"
#include "core/system/member_count.h"
#include "training/run/report.h"
#include "training/run/trainer.h"

namespace tg {
namespace {

static_assert(std::endian::native == std::endian::little, "numbers are written as they lie in memory");
static_assert(sizeof(int) == 4 && sizeof(std::size_t) == 8 && sizeof(TextureRect) == 8 && sizeof(glm::vec3) == 12);

constexpr char kMagic[8] = {'T', 'G', 'C', 'K', 'P', 'T', '\r', '\n'};
constexpr std::uint32_t kVersion = 4;
static_assert(kFieldCount == 5, "older checkpoints lack the new parameter: raise kVersion");
constexpr std::uint64_t kMaxTextBytes = 1 << 20;
constexpr std::size_t kMaxGaussians = std::size_t{1} << 32;

using FileHandle = std::unique_ptr<std::FILE, int (*)(std::FILE*)>;

class BlockWriter {
 public:
  static constexpr bool kReads = false;

  explicit BlockWriter(std::FILE* file) : file_(file) {
    write(kMagic, sizeof kMagic);
    write(&kVersion, sizeof kVersion);
  }
  void bytes(const std::string& name, const void* content, std::size_t size) {
    crc_ = 0;
    const auto name_size = static_cast<std::uint16_t>(name.size());
    const auto content_size = static_cast<std::uint64_t>(size);
    write(&name_size, sizeof name_size);
    write(name.data(), name.size());
    write(&content_size, sizeof content_size);
    write(content, size);
    const auto crc = static_cast<std::uint32_t>(crc_);
    write(&crc, sizeof crc);
  }
  template <typename T>
  void value(const std::string& name, const T& value) {
    bytes(name, &value, sizeof value);
  }
  template <typename T>
  void array(const std::string& name, const std::vector<T>& values) {
    bytes(name, values.data(), values.size() * sizeof(T));
  }
  void text(const std::string& name, const std::string& text) { bytes(name, text.data(), text.size()); }
  void finish() { bytes("end", nullptr, 0); }

 private:
  void write(const void* data, std::size_t size) {
    if (size == 0) return;
    crc_ = crc32_z(crc_, static_cast<const Bytef*>(data), size);
    if (std::fwrite(data, 1, size, file_) != size) {
      throw std::system_error(errno, std::generic_category(), "cannot write");
    }
  }
  std::FILE* file_;
  uLong crc_ = 0;
};

class BlockReader {
 public:
  static constexpr bool kReads = true;

  BlockReader(std::FILE* file, std::uint64_t size, std::string path)
      : file_(file), left_(size), path_(std::move(path)) {
    char magic[sizeof kMagic];
    std::uint32_t version = 0;
    if (left_ < sizeof magic + sizeof version) fail("not a checkpoint (file of " + std::to_string(size) + " bytes)");
    read(magic, sizeof magic, "start");
    if (std::memcmp(magic, kMagic, sizeof magic) != 0) fail("not a checkpoint of tgtrain");
    read(&version, sizeof version, "start");
    if (version != kVersion) {
      fail("a checkpoint of another version of tgtrain (expected " + std::to_string(kVersion) + ", found " +
           std::to_string(version) + ")");
    }
  }
  template <typename T>
  void value(const std::string& name, T& value) {
    const std::uint64_t size = open(name);
    if (size != sizeof value) {
      fail(name + ": wrong length (expected " + std::to_string(sizeof value) + " bytes, found " + std::to_string(size) +
           ")");
    }
    if constexpr (std::same_as<T, bool>) {
      std::uint8_t byte = 0;
      read(&byte, 1, name);
      if (byte > 1) fail(name + ": expected 0 or 1, found " + std::to_string(byte));
      value = byte == 1;
    } else {
      read(&value, sizeof value, name);
    }
    close(name);
  }
  template <typename T>
  void array(const std::string& name, std::vector<T>& values) {
    const std::uint64_t size = open(name);
    if (size % sizeof(T) != 0) {
      fail(name + ": wrong length (expected a multiple of " + std::to_string(sizeof(T)) + " bytes, found " +
           std::to_string(size) + ")");
    }
    values.resize(size / sizeof(T));
    read(values.data(), size, name);
    close(name);
  }
  void text(const std::string& name, std::string& text) {
    const std::uint64_t size = open(name);
    if (size > kMaxTextBytes) {
      fail(name + ": too long (expected at most " + std::to_string(kMaxTextBytes) + " bytes, found " +
           std::to_string(size) + ")");
    }
    text.resize(size);
    read(text.data(), size, name);
    close(name);
  }
  void finish() {
    if (open("end") != 0) fail("end: expected no content");
    close("end");
    if (left_ > 0) fail(std::to_string(left_) + " bytes after the end");
  }
  [[noreturn]] void fail(const std::string& what) const { throw Error(ErrorKind::badData, path_, what); }

 private:
  // The length of the content, which the file is long enough for.
  std::uint64_t open(const std::string& name) {
    crc_ = 0;
    std::uint16_t name_size = 0;
    read(&name_size, sizeof name_size, name);
    std::string found(std::min<std::size_t>(name_size, 256), '\0');
    read(found.data(), found.size(), name);
    if (found != name) fail("unexpected block (expected " + name + ", found \"" + found + "\")");
    std::uint64_t size = 0;
    read(&size, sizeof size, name);
    if (size > left_) {
      fail(name + ": ends early (expected " + std::to_string(size) + " bytes, found " + std::to_string(left_) + ")");
    }
    return size;
  }
  void close(const std::string& name) {
    const auto expected = static_cast<std::uint32_t>(crc_);
    std::uint32_t found = 0;
    read(&found, sizeof found, name);
    if (found != expected) fail(name + ": damaged (its checksum is wrong)");
  }
  void read(void* data, std::size_t size, const std::string& name) {
    if (size == 0) return;
    if (size > left_ || std::fread(data, 1, size, file_) != size) fail(name + ": ends early");
    left_ -= size;
    crc_ = crc32_z(crc_, static_cast<const Bytef*>(data), size);
  }
  std::FILE* file_;
  std::uint64_t left_;
  std::string path_;
  uLong crc_ = 0;
};

template <typename T, typename Plain>
concept Is = std::same_as<std::remove_const_t<T>, Plain>;

// Names every member of a state. A member that is added to one of these structs breaks its structured binding here.
template <typename Archive>
class StateFields {
 public:
  explicit StateFields(Archive& archive) : archive_(archive) {}

  void state(Is<RunState> auto& run) {
    auto& [stage, iteration, finished, default_gaussians, training, min_sigma, statistics, densify_random, view_order,
           loss, squared_error, seconds, texture_groups, file_steps, untextured_start, textured, report] = run;
    choice("stage", stage, Stage::quantized);
    archive_.value("iteration", iteration);
    archive_.value("finished", finished);
    archive_.value("default_gaussians", default_gaussians);
    trainingState("training", training);
    archive_.array("min_sigma", min_sigma);
    densityStatistics("statistics", statistics);
    random("densify_random", densify_random);
    viewOrder("order", view_order);
    runningMean("loss", loss);
    runningMean("squared_error", squared_error);
    archive_.value("seconds", seconds);
    textureGroups("texture_groups", texture_groups);
    archive_.value("file_steps", file_steps);
    model("untextured_start", untextured_start);
    model("textured", textured);
    trainReport("report", report);
  }

 private:
  void textureGroups(const std::string& at, Is<std::optional<std::vector<std::uint32_t>>> auto& groups) {
    std::vector<std::uint32_t> each = groups.value_or(std::vector<std::uint32_t>());
    bool known = groups.has_value();
    archive_.value(at + ".known", known);
    archive_.array(at, each);
    if constexpr (Archive::kReads) {
      if (known) groups = std::move(each);
    }
  }
  void trainingState(const std::string& at, Is<TrainingState> auto& state) {
    auto& [gaussians, model_moments, step] = state;
    model(at + ".model", gaussians);
    forEachParameter([&](const Field& field, auto& each) { moments(at + "." + field.name, each); }, model_moments);
    archive_.value(at + ".step", step);
  }
  void model(const std::string& at, Is<GaussianModel> auto& model) {
    static_assert(memberCount<GaussianModel>() == 6, "name the model's new member here: all of them are");
    forEachField([&](const Field& field, auto& values) { archive_.array(at + "." + field.name, values); }, model);
    archive_.value(at + ".sh_degree", model.sh_degree);
    choice(at + ".texture_mode", model.texture_mode, TextureMode::rgba);
    choice(at + ".intersection", model.intersection, IntersectionModel::maxResponse);
    choice(at + ".outside", model.outside, TextureOutside::clip);  // edge is not trained
    auto& [rects, texels] = model.atlas;
    archive_.array(at + ".rects", rects);
    archive_.array(at + ".texels", texels);
  }
  void moments(const std::string& at, Is<Moments> auto& moments) {
    auto& [first, second] = moments;
    archive_.array(at + ".first", first);
    archive_.array(at + ".second", second);
  }
  void densityStatistics(const std::string& at, Is<DensityStatistics> auto& statistics) {
    auto& [score_sum, magnitude_sum, view_count, max_radius] = statistics;
    archive_.array(at + ".score_sum", score_sum);
    archive_.array(at + ".magnitude_sum", magnitude_sum);
    archive_.array(at + ".view_count", view_count);
    archive_.array(at + ".max_radius", max_radius);
  }
  void viewOrder(const std::string& at, Is<ViewOrder> auto& order) {
    auto& [views, generator, position] = order;
    archive_.array(at + ".views", views);
    random(at + ".random", generator);
    archive_.value(at + ".position", position);
  }
  void runningMean(const std::string& at, Is<RunningMean> auto& mean) {
    auto& [sum, weight] = mean;
    archive_.value(at + ".sum", sum);
    archive_.value(at + ".weight", weight);
  }
  void trainReport(const std::string& at, Is<TrainReport> auto& report) {
    auto& [extent, initial_gaussians, count, plain, textured, untextured, quantized, interrupted] = report;
    archive_.value(at + ".extent", extent);
    archive_.value(at + ".initial_gaussians", initial_gaussians);
    optional(at + ".count", count, [&](auto& stage) { stageReport(at + ".count", stage); });
    stageReport(at + ".plain", plain);
    optional(at + ".textured", textured, [&](auto& stage) { stageReport(at + ".textured", stage); });
    optional(at + ".untextured", untextured, [&](auto& stage) { stageReport(at + ".untextured", stage); });
    optional(at + ".quantized", quantized, [&](auto& stage) { stageReport(at + ".quantized", stage); });
    archive_.value(at + ".interrupted", interrupted);
  }
  void stageReport(const std::string& at, Is<StageReport> auto& report) {
    auto& [iterations, seconds, loss, train_psnr, gaussians, test] = report;
    archive_.value(at + ".iterations", iterations);
    archive_.value(at + ".seconds", seconds);
    archive_.value(at + ".loss", loss);
    archive_.value(at + ".train_psnr", train_psnr);
    archive_.value(at + ".gaussians", gaussians);
    optional(at + ".test", test, [&](auto& score) {
      auto& [psnr, ssim, views] = score;
      archive_.value(at + ".test.psnr", psnr);
      archive_.value(at + ".test.ssim", ssim);
      archive_.value(at + ".test.views", views);
    });
  }
  void random(const std::string& at, Is<Random> auto& random) {
    std::uint64_t state = random.state();
    archive_.value(at, state);
    if constexpr (Archive::kReads) random = Random(state);
  }
  // An enum whose last value is `last`.
  template <typename Enum>
  void choice(const std::string& at, Enum& value, std::remove_const_t<Enum> last) {
    auto number = static_cast<std::uint32_t>(value);
    archive_.value(at, number);
    if constexpr (Archive::kReads) {
      if (number > static_cast<std::uint32_t>(last)) {
        archive_.fail(at + ": expected 0 to " + std::to_string(static_cast<std::uint32_t>(last)) + ", found " +
                      std::to_string(number));
      }
      value = static_cast<Enum>(number);
    }
  }
  template <typename Optional, typename Visit>
  void optional(const std::string& at, Optional& value, const Visit& visit) {
    bool present = value.has_value();
    archive_.value(at, present);
    if constexpr (Archive::kReads) {
      if (present) value.emplace();
    }
    if (value) visit(*value);
  }

  Archive& archive_;
};

template <typename Archive>
void visitHeader(Archive& archive, Is<CheckpointHeader> auto& header) {
  auto& [identity, seconds, metrics_bytes] = header;
  auto& [settings, data] = identity;
  archive.text("settings", settings);
  archive.text("data", data);
  archive.value("run.seconds", seconds);
  archive.value("run.metrics_bytes", metrics_bytes);
}

// What firstOfGroups() expects: numbers in order of first appearance, textures of one size in each.
void checkGroups(const TextureAtlas& atlas, std::span<const std::uint32_t> groups, std::size_t count, const auto& fail,
                 const auto& expect) {
  expect("texture_groups", groups.size(), count);
  expect("texture_groups: textures", atlas.rects.size(), count);
  std::vector<TextureRect> sizes;
  for (std::size_t i = 0; i < count; ++i) {
    const TextureRect& rect = atlas.rects[i];
    if (groups[i] > sizes.size()) fail("texture_groups: a group of more than there are");
    if (groups[i] == sizes.size()) sizes.push_back(rect);
    const TextureRect& size = sizes[groups[i]];
    if (rect.width != size.width || rect.height != size.height) {
      fail("texture_groups: textures of two sizes in one group");
    }
  }
}

// The promises that sizes keep, which the trainer relies on.
void checkState(const RunState& state, const std::string& path) {
  const auto fail = [&](const std::string& what) { throw Error(ErrorKind::badData, path, what); };
  const auto expect = [&](const char* name, std::size_t found, std::size_t expected) {
    if (found != expected) {
      fail(std::string(name) + ": wrong length (expected " + std::to_string(expected) + ", found " +
           std::to_string(found) + ")");
    }
  };
  const TrainingState& training = state.training;
  for (const GaussianModel* model : {&training.model, &state.untextured_start, &state.textured}) {
    checkModel(*model, path);
  }
  const std::size_t count = training.model.size();
  if (count == 0) fail("no Gaussian inside (expected at least 1)");
  forEachParameter(
      [&](const Field& field, const auto& values, const Moments& moments) {
        const std::string name = std::string("training.") + field.name;
        expect(name.c_str(), moments.first.size(), values.size() * field.floats);
        expect(name.c_str(), moments.second.size(), values.size() * field.floats);
      },
      training.model, training.moments);
  constexpr std::int64_t kMostTrained = std::int64_t{1} << 40;  // of every stage together
  if (training.step < 0 || training.step > kMostTrained) {
    fail("training.step: expected 0 to " + std::to_string(kMostTrained) + ", found " + std::to_string(training.step));
  }
  if (!state.min_sigma.empty()) expect("min_sigma", state.min_sigma.size(), count);
  if (state.texture_groups && !state.texture_groups->empty()) {
    checkGroups(training.model.atlas, *state.texture_groups, count, fail, expect);
  }
  expect("statistics.score_sum", state.statistics.score_sum.size(), count);
  expect("statistics.magnitude_sum", state.statistics.magnitude_sum.size(), count);
  expect("statistics.view_count", state.statistics.view_count.size(), count);
  expect("statistics.max_radius", state.statistics.max_radius.size(), count);
  if (state.default_gaussians > kMaxGaussians) {
    fail("default_gaussians: expected at most " + std::to_string(kMaxGaussians) + ", found " +
         std::to_string(state.default_gaussians));
  }
  if (state.order.position > 0 && state.order.position >= state.order.views.size()) {
    fail("order.position: expected a position in " + std::to_string(state.order.views.size()) + " views, found " +
         std::to_string(state.order.position));
  }
}

Checkpoint read(std::FILE* file, std::uint64_t size, const std::string& path) {
  BlockReader reader(file, size, path);
  Checkpoint checkpoint;
  visitHeader(reader, checkpoint.header);
  StateFields(reader).state(checkpoint.state);
  reader.finish();
  checkState(checkpoint.state, path);
  return checkpoint;
}

using NamedLines = std::vector<std::pair<std::string, std::string>>;

NamedLines parseLines(const std::string& text) {
  NamedLines lines;
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line);) {
    const std::size_t space = line.find(' ');
    lines.emplace_back(line.substr(0, space), space == std::string::npos ? "" : line.substr(space + 1));
  }
  return lines;
}

// Settings of a run with those that its program did not know, and did what their defaults say.
std::string withDefaults(std::string settings) {
  const NamedLines lines = parseLines(settings);
  for (const SettingEntry& entry : settingEntries()) {
    const bool known = std::ranges::find(lines, entry.name, &NamedLines::value_type::first) != lines.end();
    if (!known) settings += entry.name + " " + entry.get({}) + "\n";
  }
  return settings;
}

constexpr const char* kTransparency = "transparency";

// The data of a run whose program did not look at this, with what it is now.
std::string withTransparency(std::string data, const std::string& now) {
  const auto has = [](const NamedLines::value_type& line) { return line.first == kTransparency; };
  const NamedLines lines = parseLines(now);
  const auto found = std::ranges::find_if(lines, has);
  if (found != lines.end() && std::ranges::none_of(parseLines(data), has)) {
    data += found->first + " " + found->second + "\n";
  }
  return data;
}

// "NAME (expected OLD, found NEW)" of the first line that is not the same in both; "" when all are.
std::string firstDifference(const std::string& old_text, const std::string& new_text, const std::string& prefix) {
  const NamedLines old_lines = parseLines(old_text), new_lines = parseLines(new_text);
  const auto valueIn = [](const NamedLines& lines, const std::string& name) -> const std::string* {
    const auto at = std::find_if(lines.begin(), lines.end(), [&](const auto& line) { return line.first == name; });
    return at == lines.end() ? nullptr : &at->second;
  };
  for (const auto& [name, value] : new_lines) {
    const std::string* old = valueIn(old_lines, name);
    if (old && *old != value) return prefix + name + " (expected " + *old + ", found " + value + ")";
  }
  for (const auto& [name, value] : new_lines) {
    if (!valueIn(old_lines, name)) return prefix + name + " (not known to the program that wrote it)";
  }
  for (const auto& [name, value] : old_lines) {
    if (!valueIn(new_lines, name)) return prefix + name + " (not known to this program)";
  }
  return "";
}

// CRC-32 of what it says, lengths of arrays included.
std::string modelFingerprint(const GaussianModel& model) {
  uLong crc = 0;
  const auto add = [&crc](const auto& values) {
    const std::uint64_t bytes = values.size() * sizeof(values[0]);
    crc = crc32_z(crc, reinterpret_cast<const Bytef*>(&bytes), sizeof bytes);
    if (bytes > 0) crc = crc32_z(crc, reinterpret_cast<const Bytef*>(values.data()), bytes);
  };
  forEachField([&](const Field&, const auto& values) { add(values); }, model);
  if (model.texture_mode != TextureMode::none) {
    std::vector<std::uint32_t> layout{static_cast<std::uint32_t>(model.texture_mode),
                                      static_cast<std::uint32_t>(model.intersection),
                                      static_cast<std::uint32_t>(model.outside)};
    for (const TextureRect& rect : model.atlas.rects) {
      layout.insert(layout.end(), {rect.offset, std::uint32_t{rect.width}, std::uint32_t{rect.height}});
    }
    add(layout);
    add(model.atlas.texels);
  }
  return std::to_string(crc);
}

template <typename Number>
std::string exactText(Number value) {
  char text[64];
  return {text, std::to_chars(text, text + sizeof text, value).ptr};
}

bool isReachable(const RunState& state, const TrainSettings& settings) {
  const bool textured = state.training.model.texture_mode != TextureMode::none;
  switch (state.stage) {
    case Stage::count:
      return !textured && settings.percent > 0 && settings.default_gaussians == 0;
    case Stage::plain:
      return !textured;
    case Stage::textured:
      return textured && settings.texture_mode != TextureMode::none &&
             (!settings.compare_untextured || state.untextured_start.size() > 0);
    case Stage::untextured:
      return !textured && settings.compare_untextured && state.textured.size() > 0;
    case Stage::quantized:
      return settings.quantize_iterations > 0;
  }
  return false;
}

}  // namespace

RunIdentity runIdentity(const Dataset& dataset, const TrainSettings& settings, const std::string& fingerprint,
                        const GaussianModel* start, const FlagTexts& quantized_for, const GaussianModel* context) {
  RunIdentity identity;
  for (const auto& [name, value] : quantized_for) {  // these first: a size decides other settings
    identity.settings += name + " " + (settings.quantize_iterations > 0 ? value : "none") + "\n";
  }
  for (const SettingEntry& entry : settingEntries()) identity.settings += entry.name + " " + entry.get(settings) + "\n";
  const auto fact = [&](const char* name, const std::string& value) {
    identity.data += std::string(name) + " " + value + "\n";
  };
  const Camera& camera = dataset.views.front();
  fact("train-views", std::to_string(dataset.indices(false).size()));
  fact("test-views", std::to_string(dataset.indices(true).size()));
  fact("image-size", std::to_string(camera.size.x) + "x" + std::to_string(camera.size.y));
  fact("points", std::to_string(dataset.points.position.size()));
  const glm::vec3& background = dataset.background;
  fact("background", exactText(background.x) + "," + exactText(background.y) + "," + exactText(background.z));
  fact("random-background", dataset.random_background ? "on" : "off");
  fact("start-model", start ? modelFingerprint(*start) : "none");
  fact("context", context ? modelFingerprint(*context) : "none");
  fact("fingerprint", fingerprint);
  if (dataset.random_background) fact(kTransparency, transparencyFingerprint(dataset));
  return identity;
}

void writeCheckpoint(const std::filesystem::path& path, const CheckpointHeader& header, const RunState& state) {
  TG_ASSERT(lengthsAgree(state.training.model), "the model's arrays have their lengths");
  TG_ASSERT(state.min_sigma.empty() || state.min_sigma.size() == state.training.model.size(),
            "a sigma a Gaussian, or none");
  writeFileAtomically(path, [&](const std::filesystem::path& temporary) {
    FileHandle file(std::fopen(temporary.c_str(), "wbe"), std::fclose);
    try {
      if (!file) throw std::system_error(errno, std::generic_category(), "cannot open");
      BlockWriter writer(file.get());
      visitHeader(writer, header);
      StateFields(writer).state(state);
      writer.finish();
      if (std::fclose(file.release()) != 0) throw std::system_error(errno, std::generic_category(), "cannot write");
    } catch (const std::system_error& error) {
      throw Error(ErrorKind::cannotWrite, path.string(), error.what());
    }
  });
}

Checkpoint readCheckpoint(const std::filesystem::path& path) {
  // Not blocking: a pipe in the file's place must not hang the program.
  const int descriptor = ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  FileHandle file(descriptor < 0 ? nullptr : ::fdopen(descriptor, "rb"), std::fclose);
  if (!file) throw Error(ErrorKind::cannotRead, path.string(), "cannot open: " + systemReason());
  struct stat status{};
  if (::fstat(descriptor, &status) != 0 || !S_ISREG(status.st_mode)) {
    throw Error(ErrorKind::cannotRead, path.string(), "is not a regular file");
  }
  return read(file.get(), static_cast<std::uint64_t>(status.st_size), path.string());
}

Checkpoint parseCheckpoint(std::span<const std::uint8_t> bytes, const std::string& path) {
  if (bytes.empty()) throw Error(ErrorKind::badData, path, "not a checkpoint (file of 0 bytes)");
  // Opened for reading only: the bytes are not written to.
  const FileHandle file(::fmemopen(const_cast<std::uint8_t*>(bytes.data()), bytes.size(), "rb"), std::fclose);
  if (!file) throw std::bad_alloc();
  return read(file.get(), bytes.size(), path);
}

void checkResumable(const Checkpoint& checkpoint, const RunIdentity& identity, const Dataset& dataset,
                    const TrainSettings& settings, const std::string& path) {
  const std::string setting =
      firstDifference(withDefaults(checkpoint.header.identity.settings), identity.settings, "--");
  if (!setting.empty()) throw Error(ErrorKind::usage, path, "is of a run with other settings: " + setting);
  const std::string data =
      firstDifference(withTransparency(checkpoint.header.identity.data, identity.data), identity.data, "");
  if (!data.empty()) throw Error(ErrorKind::usage, path, "is of a run with other data: " + data);

  const RunState& state = checkpoint.state;
  if (!isReachable(state, settings)) {
    throw Error(ErrorKind::badData, path,
                "stage: no run with these settings is at \"" + std::string(name(state.stage)) + "\" with such a model");
  }
  const int iterations = iterationsOf(settings, state.stage);
  if (state.iteration < 0 || state.iteration > iterations) {
    throw Error(
        ErrorKind::badData, path,
        "iteration: expected 0 to " + std::to_string(iterations) + ", found " + std::to_string(state.iteration));
  }
  std::vector<std::uint32_t> views = state.order.views;
  std::sort(views.begin(), views.end());
  const std::vector<std::size_t> train = dataset.indices(false);
  if (!std::equal(views.begin(), views.end(), train.begin(), train.end())) {
    throw Error(ErrorKind::badData, path, "order.views: expected every training view once");
  }
}

}  // namespace tg
