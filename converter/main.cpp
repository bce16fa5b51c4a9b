// SPDX-License-Identifier: Apache-2.0
// tgconvert: models between tgz, ply, glb and what other programs write.
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "converter/batch.h"
#include "converter/check.h"
#include "converter/convert.h"
#include "converter/idle.h"
#include "converter/merge_blocks.h"
#include "converter/registry/file_format.h"
#include "core/bundle/camera_file.h"
#include "core/bundle/training_json.h"
#include "core/system/error.h"
#include "core/system/program.h"
#include "core/system/signals.h"

namespace {

struct Arguments {
  std::vector<std::string> files;  // IN..., OUT
  std::string input;
  std::string output;
  bool quiet = false;
  bool json = false;
  bool info = false;
  bool psnr = false;
  bool no_psnr = false;
  bool no_cameras = false;
  std::string views;
  bool stats = false;
  std::string to;
  tg::ConvertOptions options;
};

void warn(const Arguments& arguments, const std::string& input, const std::vector<std::string>& warnings) {
  if (arguments.quiet || arguments.json) return;  // the JSON lists them
  for (const std::string& warning : warnings) {
    std::fprintf(stderr, "warning: %s\n", tg::printable(input + ": " + warning).c_str());
  }
}

void print(const Arguments& arguments, const std::string& text, const std::string& json) {
  if (arguments.json) {
    std::fputs(json.c_str(), stdout);
  } else if (!arguments.quiet) {
    std::fputs(text.c_str(), stdout);
  }
}

// One line on a terminal that is overwritten: how far a batch or a conversion is, and how long the rest takes at this
// speed.
class ProgressLine {
 public:
  explicit ProgressLine(bool shown) : shown_(shown && isatty(STDERR_FILENO) != 0) {}
  ~ProgressLine() {
    if (shown_) std::fputs("\r\x1b[K", stderr);
  }
  void show(const tg::BatchProgress& progress) const {
    if (!shown_) return;
    std::fprintf(stderr, "\r\x1b[K[%zu/%zu] %s", progress.item + 1, progress.items, progress.name.c_str());
    showPart(progress.done);
  }
  // `what`: as "fitting to three".
  void show(const std::string& what, std::size_t done, std::size_t steps) {
    if (!shown_) return;
    if (done == 0) start_ = Clock::now();
    std::fprintf(stderr, "\r\x1b[K%s", what.c_str());
    showPart(static_cast<double>(done) / static_cast<double>(steps));
  }

 private:
  using Clock = std::chrono::steady_clock;
  void showPart(double done) const {
    const double seconds = std::chrono::duration<double>(Clock::now() - start_).count();
    std::fprintf(stderr, ", %.0f %%", 100.0 * done);
    if (done > 0.0) std::fprintf(stderr, ", %.0f s left", seconds / done * (1.0 - done));
    std::fflush(stderr);
  }

  const bool shown_;
  Clock::time_point start_ = Clock::now();
};

// Whether it is there, and not only by its name what it should be.
bool isModelNamed(const std::filesystem::path& path, std::string_view format) {
  try {
    return tg::detectFormat(path).name == format;
  } catch (const tg::Error&) {
    return false;
  }
}

int runBatch(const Arguments& arguments) {
  if (arguments.to.empty()) {
    for (const auto& [name, format] : {std::pair("lod-meta.json", "lod-meta.json"), std::pair("meta.json", "meta.json"),
                                       std::pair("model.tgz", "tgz")}) {  // levels of detail, a SOG, a run
      const std::filesystem::path inside = std::filesystem::path(arguments.input) / name;
      if (!isModelNamed(inside, format)) continue;
      throw tg::Error(tg::ErrorKind::usage, arguments.input,
                      "is a folder (did you mean " + tg::printable(inside.string()) + "?)");
    }
    throw tg::Error(tg::ErrorKind::usage, "--to is missing (a folder is converted to what format?)");
  }
  tg::BatchReport report;
  {
    const ProgressLine line(!arguments.quiet && !arguments.json);
    report = tg::convertFolder(arguments.input, arguments.output, arguments.to, arguments.options,
                               [&](const tg::BatchProgress& progress) { line.show(progress); });
  }
  if (arguments.quiet && !arguments.json) {
    for (const tg::BatchItem& item : report.items) {
      if (!item.error.empty()) std::fprintf(stderr, "tgconvert: %s\n", item.error.c_str());
    }
  }
  for (const tg::BatchItem& item : report.items) warn(arguments, item.input.string(), item.report.warnings);
  print(arguments, tg::describe(report), tg::describeJson(report));
  return report.exit_code;
}

tg::ConvertReport convertOne(const Arguments& arguments) {
  ProgressLine line(!arguments.quiet && !arguments.json);
  tg::ConvertOptions options = arguments.options;
  options.listener = [&](tg::ConvertPart part, std::size_t done, std::size_t steps) {
    const bool fits = part == tg::ConvertPart::fit;
    const std::string aim = fits                       ? std::string(tg::name(*options.viewer))
                            : options.target.bytes > 0 ? "its size"
                                                       : "its pictures";
    line.show((fits ? "fitting to " : "steps for ") + aim, done, steps);
  };
  return tg::convert(arguments.input, arguments.output, options);
}

// The exit code.
int run(const Arguments& arguments) {
  if (arguments.info || arguments.stats || arguments.output == "null") {
    tg::Bundle loaded = tg::readModel(
        arguments.input, {.base_only = arguments.options.base_only, .spz_axes = arguments.options.spz_axes});
    if (tg::wasInterrupted(loaded.training_json)) loaded.warnings.emplace_back(tg::kInterruptedTraining);
    warn(arguments, arguments.input, loaded.warnings);
    print(arguments, tg::describe(loaded, arguments.stats), tg::describeJson(loaded, arguments.stats));
    return 0;
  }
  if (arguments.output.empty()) throw tg::Error(tg::ErrorKind::usage, "OUT is missing (or give --info or --stats)");
  std::error_code ignored;  // what cannot be looked at cannot be read, which says so
  if (std::filesystem::is_directory(arguments.input, ignored)) return runBatch(arguments);
  const tg::ConvertReport report = convertOne(arguments);
  warn(arguments, arguments.input, report.warnings);
  print(arguments, tg::describe(report), tg::describeJson(report));
  return 0;
}

// IN, OUT and what is merged with IN before anything else.
void takeFiles(Arguments& arguments) {
  std::vector<std::string> files = arguments.files;
  arguments.input = files.front();
  files.erase(files.begin());
  if (!files.empty()) {
    arguments.output = files.back();
    files.pop_back();
  }
  for (auto file = files.rbegin(); file != files.rend(); ++file) {
    arguments.options.edits.insert(arguments.options.edits.begin(), {"--merge", *file, {}});
  }
  for (tg::Edit& edit : arguments.options.edits) {
    edit.reading.base_only = arguments.options.base_only;
    edit.reading.spz_axes = arguments.options.spz_axes;
  }
}

// Options of one name may be given often; their order among all edits is what counts.
class EditParser {
 public:
  explicit EditParser(CLI::App& app) : app_(app) {
    for (const tg::EditOption& option : tg::editOptions()) {
      const std::string name(option.name), help(option.help);
      CLI::Option* added = option.value.empty()
                               ? app.add_flag(name, help)
                               : app.add_option(name, help)->type_name(std::string(option.value))->type_size(1);
      added->expected(option.value.empty() ? 0 : 1)->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
      added->group("Edits, in the order they are given (axes: x right, y down, z forward)");
    }
  }

  // After parsing.
  std::vector<tg::Edit> edits() const {
    std::vector<tg::Edit> edits;
    std::map<const CLI::Option*, std::size_t> next;
    for (const CLI::Option* option : app_.parse_order()) {
      const std::string name = option->get_name();
      for (const tg::EditOption& known : tg::editOptions()) {
        if (known.name != name) continue;
        edits.push_back({name, known.value.empty() ? std::string() : option->results().at(next[option]++), {}});
      }
    }
    return edits;
  }

 private:
  const CLI::App& app_;
};

std::string outputExtensions() {
  std::vector<std::string> names = tg::outputNames(true);  // models before mere pictures
  for (const std::string& name : tg::outputNames(false)) names.push_back(name);
  for (std::string& name : names) name.insert(0, ".");
  return tg::listed(names);
}

// What stands before a command would be lost.
void refuseBefore(const CLI::App& app, const std::string& command, const std::string& usage) {
  for (const CLI::Option* option : app.get_options()) {
    if (option->count() == 0) continue;
    const std::string what = option->nonpositional() ? option->get_name() : "\"" + option->results().front() + "\"";
    throw tg::Error(tg::ErrorKind::usage, what + " does nothing before " + command + " (expected " + usage + ")");
  }
}

// --info, --stats and null read one file and write none.
void refuseBesideInfo(const CLI::App& app, const Arguments& arguments) {
  const auto refuse = [](const std::string& what) {
    throw tg::Error(tg::ErrorKind::usage, what + " does nothing beside --info, --stats or null: nothing is written");
  };
  for (const CLI::Option* option : app.get_options()) {
    if (option->count() == 0 || !option->nonpositional()) continue;
    constexpr std::array kBeside = {"--info", "--stats", "--json", "--quiet", "--base-only", "--spz-axes"};
    if (std::ranges::find(kBeside, option->get_name()) == kBeside.end()) refuse(option->get_name());
  }
  for (std::size_t k = 1; k < arguments.files.size(); ++k) {
    if (k + 1 < arguments.files.size() || arguments.output != "null") refuse("\"" + arguments.files[k] + "\"");
  }
}

// What is asked for and does nothing is a mistake that nobody would see.
void refuseIdle(const CLI::App& app, const Arguments& arguments) {
  const auto given = [&](const char* name) { return app.get_option(name)->count() > 0; };
  std::error_code ignored;
  const bool folder = std::filesystem::is_directory(arguments.input, ignored);
  if (given("--to") && !folder) {
    throw tg::Error(tg::ErrorKind::usage, "--to is for a folder (OUT's extension names the format of a file)");
  }
  const bool looks = arguments.info || arguments.stats || arguments.output == "null";
  if (looks) refuseBesideInfo(app, arguments);
  const bool writes = !looks && !arguments.output.empty();
  const tg::Format* output = nullptr;
  if (writes && !folder) output = &tg::outputFormat(arguments.output);
  if (writes && folder && given("--to")) output = tg::findFormat(arguments.to);
  std::set<std::string> flags;
  for (const CLI::Option* option : app.get_options()) {
    if (option->count() > 0) flags.insert(option->get_name());
  }
  const auto inputs = [&] {
    return folder ? tg::modelsIn(arguments.input) : std::vector<std::filesystem::path>{arguments.input};
  };
  tg::refuseIdle(flags, output, inputs, arguments.options);
}

struct CheckArguments {
  std::string file;
  bool json = false;
  bool quiet = false;
};

void addCheck(CLI::App& app, CheckArguments& arguments) {
  app.add_option("FILE", arguments.file, "any format that tgconvert reads")->required()->type_name("FILE");
  app.add_flag("--json", arguments.json, "print the findings as JSON");
  app.add_flag("-q,--quiet", arguments.quiet, "print nothing: the exit code says it");
  tg::addExamples(app, {{"tgconvert check scene.glb", "a line for each finding, then the verdict"},
                        {"tgconvert check scene.glb --json", "the same for programs, with JSON pointers"},
                        {"tgconvert check scene.spz && tgconvert scene.spz scene.ply", "go on only if it is valid"},
                        {"tgconvert check --quiet scene.sog || echo broken", "the exit code alone"},
                        {"for f in *.ply; do tgconvert check \"$f\"; done", "many files"}});
}

int runCheck(const CheckArguments& arguments) {
  const tg::CheckReport report = tg::checkFile(arguments.file);
  if (arguments.json || !arguments.quiet) {
    std::fputs((arguments.json ? tg::describeJson(report) : tg::describe(report)).c_str(), stdout);
  }
  return report.errors.empty() ? 0 : static_cast<int>(tg::ErrorKind::badData);
}

struct MergeArguments {
  std::string blocks, models, output;
  bool overwrite = false;
  bool quiet = false;
};

void addMerge(CLI::App& app, MergeArguments& arguments) {
  app.add_option("BLOCKS", arguments.blocks, "folder that tgtrain split wrote")->required()->type_name("FOLDER");
  app.add_option("MODELS", arguments.models, "folder with NAME/model.tgz or NAME.tgz of each block: a farm's results")
      ->required()
      ->type_name("FOLDER");
  app.add_option("OUT", arguments.output, "model to write, in any format that is read, too")
      ->required()
      ->type_name("FILE");
  app.add_flag("--overwrite", arguments.overwrite, "replace OUT if it exists");
  app.add_flag("-q,--quiet", arguments.quiet, "print errors only");
  tg::addExamples(app, {{"tgconvert merge-blocks blocks farm/results city.tgz", "after tgtrain farm"},
                        {"tgconvert merge-blocks blocks models city.sog", "of models/block_0_0.tgz, ..., for the web"},
                        {"tgconvert merge-blocks blocks farm/results city.tgz --overwrite", "anew"},
                        {"tgconvert merge-blocks blocks farm/results city.glb -q", "silently"},
                        {"tgeval city.tgz city --blocks blocks", "what the seams cost"}});
}

int runMerge(const MergeArguments& arguments) {
  const tg::MergeReport report =
      tg::mergeBlocks(arguments.blocks, arguments.models, arguments.output, arguments.overwrite);
  if (arguments.quiet) return 0;
  for (const std::string& warning : report.warnings) {
    std::fprintf(stderr, "warning: %s\n", tg::printable(warning).c_str());
  }
  for (const tg::MergedBlock& block : report.blocks) {
    std::printf("%s: %zu of %zu Gaussians lie in its cell\n", tg::printable(block.name).c_str(), block.kept,
                block.trained);
  }
  std::printf("wrote %s: %zu Gaussians\n", tg::printable(arguments.output).c_str(), report.gaussians);
  return 0;
}

void addSizes(CLI::App& app, Arguments& arguments) {
  app.option_defaults()->group("Size and precision");
  CLI::Option* steps =
      app.add_option(
             "--steps", arguments.options.steps,
             "sog, glb, gltf, html: steps of all numbers so many times as wide, 1 without it for sog, and packed for "
             "glb: smaller and coarser")
          ->check(tg::within(tg::kLeastSteps, tg::kMostSteps));
  CLI::Option* target_size =
      tg::addBytes(
          app, "--target-size", arguments.options.target.bytes,
          "sog, glb, gltf, html: the finest steps with which OUT has at most this size: 900KB (900,000 bytes), 1.5MB")
          ->excludes(steps);
  app.add_option("--target-psnr", arguments.options.target.psnr,
                 "sog, glb, gltf, html: the coarsest steps with which pictures of up to four views are so near to IN's "
                 "after EDITS [dB]")
      ->check(tg::within(tg::kLeastTargetPsnr, tg::kMostTargetPsnr))
      ->excludes(target_size)
      ->excludes(steps);
  app.add_option("--texture-step", arguments.options.texture_step,
                 "sog, glb, gltf, html: between a texture's colours, coarser where they weigh less; 1/32 without it "
                 "for sog and --steps")
      ->check(tg::within(tg::kLeastTextureStep, tg::kMostTextureStep));
  app.add_flag(
      "--quantize", arguments.options.quantize,
      "glb, gltf, html: integers for rotations, opacities, COLOR_0; with --meshopt fewer bits for scales and SH");
  app.add_flag("--meshopt", arguments.options.meshopt, "glb, gltf, html: pack by EXT_meshopt_compression");
  app.add_flag("--lean", arguments.options.lean,
               "glb, gltf: leave out the numbers that only bring a .ply back bit by bit");
  app.add_option_function<std::string>(
         "--atlas",
         [&](const std::string& text) { arguments.options.atlas = tg::parse<tg::AtlasFormat>(text, "--atlas"); },
         "glb, gltf, html, png: texels as png8, png16, exr (half floats, with png8 for readers without EXR) or webp "
         "(the numbers of png8 in fewer bytes)")
      ->check(tg::oneOf<tg::AtlasFormat>());
  app.add_option("--spz-version", arguments.options.spz_version,
                 "spz: 4 (Zstandard), or 3 (gzip) for programs that do not know it yet; without it 4, or what --for's "
                 "viewer opens")
      ->check(tg::within(tg::kOldestSpz, tg::kNewestSpz));
  app.add_option_function<std::string>(
         "--spz-axes",
         [&](const std::string& text) { arguments.options.spz_axes = tg::parse<tg::SpzAxes>(text, "--spz-axes"); },
         "of an spz that is read, whatever it says: rub (x right, y up, z back, the format's own), or rdf for files "
         "that hold a PLY's numbers, as tgconvert 0.2 wrote them")
      ->check(tg::oneOf<tg::SpzAxes>());
}

void addConversion(CLI::App& app, Arguments& arguments) {
  app.add_option("FILES", arguments.files,
                 "IN... OUT. IN: model to read, " + tg::listed(tg::inputNames()) +
                     "; several are merged. OUT: file to write, " + outputExtensions() +
                     "; null writes nothing and prints what IN holds")
      ->type_name("FILE");
  app.option_defaults()->group("What is written");
  app.add_flag("--overwrite", arguments.options.overwrite, "replace OUT if it exists");
  app.add_flag("--dry-run", arguments.options.dry_run, "say how large OUT would be and write nothing");
  app.add_option("--to", arguments.to, "when IN is a folder: OUT becomes a folder of files of this format")
      ->check(tg::oneOf(tg::outputNames(true)));
  app.add_flag("--base-only", arguments.options.base_only,
               "leave the textures aside, as readers do that know none, of " + tg::listed(tg::basedNames()));
  app.add_option_function<std::string>(
         "--for",
         [&](const std::string& text) { arguments.options.viewer = tg::parse<tg::SplatViewer>(text, "--for"); },
         "make what viewers without textures show look right in this one: wide Gaussians in pieces, opacities, colours "
         "and shapes fitted to how it draws")
      ->check(tg::oneOf<tg::SplatViewer>());
  app.add_option_function<std::string>(
         "--for-aim",
         [&](const std::string& text) { arguments.options.aim = tg::parse<tg::FitAim>(text, "--for-aim"); },
         "the picture that --for aims at: ours with textures, or ours of the base")
      ->default_str(std::string(tg::name(tg::FitAim::textures)))
      ->check(tg::oneOf<tg::FitAim>());
  app.add_flag("--no-cameras", arguments.no_cameras, "leave cameras and named views out of OUT");
  app.add_option(
         "--views", arguments.views,
         "glb, gltf, html: the cameras of FILE, a cameras.json such as tgview's bookmarks, become named views; a "
         "page starts with the first one")
      ->type_name("FILE");
  addSizes(app, arguments);
  app.option_defaults()->group("What is said");
  app.add_flag("--info", arguments.info, "print what IN holds and write nothing");
  app.add_flag("--stats", arguments.stats, "with the distribution of every number; writes nothing");
  app.add_flag("--json", arguments.json, "print the summary as JSON");
  CLI::Option* psnr = app.add_flag("--psnr", arguments.psnr,
                                   "render source and result for the summary also where no number is rounded, and "
                                   "however large the model is");
  app.add_flag("--no-psnr", arguments.no_psnr, "do not render them even where textures or rounding change pictures")
      ->excludes(psnr);
  app.add_flag("-q,--quiet", arguments.quiet, "print errors only");
  tg::addExamples(app,
                  {{"tgconvert model.tgz scene.glb", "glTF with its textures"},
                   {"tgconvert model.tgz scene.html", "a page that shows it in any browser"},
                   {"tgconvert model.tgz scene.sog --target-size 900KB", "a file of at most that size"},
                   {"tgconvert scan.ply small.spz --crop-box -2,-2,-2,2,2,2 --decimate 200000", "cut, then thin out"},
                   {"tgconvert model.tgz scene.glb --for three --upright", "for three.js, the right way up"},
                   {"tgconvert a.ply b.ply both.ply", "merge"},
                   {"tgconvert models/ out/ --to glb", "every model of a folder"},
                   {"tgconvert model.tgz --info --stats", "what a file holds"}});
}

int convertMain(int argc, char** argv) {
  Arguments arguments;
  CheckArguments check_arguments;
  CLI::App app(
      "Converts splat models to tgz, ply, compressed ply, splat, spz, sog, glb, 3D Tiles or a page that shows them. "
      "The input's format is its content, the output's its extension.",
      "tgconvert");
  app.require_subcommand(0, 1);
  addConversion(app, arguments);
  const EditParser edit_parser(app);
  app.option_defaults()->group("Options");
  CLI::App* check = app.add_subcommand("check",
                                       "Says what is wrong with a splat file, and where. Exit code 3 when the file "
                                       "breaks its format's rules, also where readers mend what is wrong or drop "
                                       "splats. Bytes behind the end of a file that they pass over break none.");
  addCheck(*check, check_arguments);
  MergeArguments merge_arguments;
  CLI::App* merge = app.add_subcommand("merge-blocks", "Joins the blocks of a scene that tgtrain split has cut.");
  addMerge(*merge, merge_arguments);
  if (const std::optional<int> code = tg::parseCommandLine(app, argc, argv)) return *code;
  if (*check) {
    refuseBefore(app, "check", "check FILE [--json] [--quiet]");
    return runCheck(check_arguments);
  }
  if (*merge) {
    refuseBefore(app, "merge-blocks", "merge-blocks BLOCKS MODELS OUT");
    return runMerge(merge_arguments);
  }
  if (arguments.files.empty()) throw tg::Error(tg::ErrorKind::usage, "IN and OUT are missing (see --help)");
  arguments.options.edits = edit_parser.edits();
  arguments.options.cameras = !arguments.no_cameras;
  takeFiles(arguments);
  if (arguments.psnr) arguments.options.measure = tg::Measure::always;
  if (arguments.no_psnr || (arguments.quiet && !arguments.json)) arguments.options.measure = tg::Measure::never;
  refuseIdle(app, arguments);
  if (!arguments.views.empty()) {
    arguments.options.views = tg::readCameras(arguments.views);
    if (arguments.options.views.empty()) {
      throw tg::Error(tg::ErrorKind::badData, arguments.views, "no cameras (expected one at least)");
    }
  }
  return run(arguments);
}

}  // namespace

int main(int argc, char** argv) {
  tg::handleStopSignals(tg::endAtOnce);
  return tg::runProgram("tgconvert", [&] { return convertMain(argc, argv); });
}
