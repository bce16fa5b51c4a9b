// SPDX-License-Identifier: Apache-2.0
// Flags, their help, and which go together.
#include "viewer/flags.h"

#include <CLI/CLI.hpp>

#include <algorithm>
#include <map>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "converter/lod/lod_scene.h"
#include "converter/registry/file_format.h"
#include "core/system/error.h"
#include "core/system/lower_case.h"
#include "core/system/program.h"
#include "viewer/headless/renderer.h"
#include "viewer/model/follower.h"
#include "viewer/picture/frame_writer.h"
#include "viewer/view/camera_path.h"
#include "viewer/view/legend.h"
#include "viewer/view/parse.h"
#include "viewer/view/session.h"
#include "viewer/view/state.h"

namespace tg {
namespace {

constexpr const char* kFooter =
    "Keys in the window: press ? or F1.\n"
    "Exit codes: 1 usage, 2 cannot read, 3 bad data, 4 cannot write, 5 device.";

// Flags as typed; their values are checked here so that every refusal names its flag.
struct Flags {
  ViewOptions view;
  std::vector<std::filesystem::path> models;
  std::string compare_mode;
  std::map<std::string_view, std::string> settings;  // by the name of their RenderSetting
  std::string show = "final", size, backend = "auto", up = "cameras";
  std::string turntable, elevation, radius, fps = "30", inspect, splat_budget;
  std::filesystem::path benchmark;
  bool list_cameras = false, list_devices = false, window = false, no_session = false;
};

// All that the value can be; empty: more than can be listed.
std::vector<std::string> choicesOf(const RenderSetting& setting) {
  std::vector<std::string> names;
  if (setting.more_values) return names;
  for (const RenderSetting::Choice& choice : setting.choices) names.emplace_back(choice.name);
  return names;
}

void declarePicture(CLI::App& app, Flags& flags) {
  app.option_defaults()->group("Picture");
  app.add_option("--render", flags.view.out, "write one image and exit: .png, .jpg, or .exr for the raw numbers")
      ->type_name("FILE");
  app.add_option("--camera", flags.view.camera, "number of a model's camera, or a cameras.json (its first camera)")
      ->type_name("FILE");
  app.add_option("--show", flags.show, "what is shown")->check(oneOf<Output>())->capture_default_str();
  flags.settings["textures"] = texturesName(RenderSettings().textures);
  for (const RenderSetting& setting : renderSettings()) {
    if (setting.name == "background") {  // its place in the help
      app.add_option("--splat-budget", flags.splat_budget,
                     "how many Gaussians of a scene with levels of detail are drawn, at most")
          ->type_name("N");
      app.add_option("--size", flags.size, "WIDTHxHEIGHT of the image or the window")->type_name("SIZE");
    }
    const std::string unit = setting.unit.empty() ? "" : "[" + std::string(setting.unit) + "] ";
    CLI::Option* option =
        app.add_option("--" + std::string(setting.name), flags.settings[setting.name], unit + setting.help)
            ->capture_default_str();
    if (const std::vector<std::string> choices = choicesOf(setting); !choices.empty()) {
      option->check(oneOf(choices));
    } else {
      option->type_name("VALUE");
    }
  }
}

void declareDevice(CLI::App& app, Flags& flags) {
  app.option_defaults()->group("Device");
  app.add_option("--backend", flags.backend,
                 "auto, vulkan, opengl or cpu: what renders; auto is Vulkan or OpenGL on a GPU, else the CPU")
      ->check(oneOf<Backend>())
      ->capture_default_str();
  app.add_option("--device", flags.view.device, "number in --list-devices, or part of the name, of the device to use")
      ->type_name("DEVICE");
  app.add_flag("--list-devices", flags.list_devices,
               "print the devices of Vulkan and OpenGL with their limits and exit");
  app.add_flag("--validation", flags.view.validation,
               "run under Vulkan's validation layer or OpenGL's debug output; messages are errors");
  app.add_option("--frames-in-flight", flags.view.frames_in_flight, "frames that a Vulkan window has under way: 1 or 2")
      ->check(within(1, 2));
}

void declareRecording(CLI::App& app, Flags& flags) {
  app.option_defaults()->group("Camera path");
  app.add_option("-o,--output", flags.view.record,
                 "record --path or --turntable: a video (.mp4, .mov, .mkv, .webm), frames/####.png, or a folder")
      ->type_name("FILE");
  app.add_option(
         "--path", flags.view.path,
         "a camera path, or the cameras of a cameras.json or a model, a second apart; without -o, for the window")
      ->type_name("FILE");
  app.add_option("--turntable", flags.turntable, "once round the model in that many frames")->type_name("N");
  app.add_option("--elevation", flags.elevation, "[degrees] of the turntable above the horizon")->type_name("X");
  app.add_option("--radius", flags.radius, "[world units] of the turntable")->type_name("X");
  app.add_option("--fps", flags.fps, "frames a second of --path and videos")->type_name("X")->capture_default_str();
  app.add_option("--benchmark", flags.benchmark, "time a camera path's frames and print JSON")->type_name("FILE");
  app.add_flag("--window", flags.window, "with --benchmark: in a window, as it is shown");
}

void declare(CLI::App& app, Flags& flags) {
  app.add_option("model", flags.models,
                 listed(inputNames()) + ", several or none for the window; a run folder with --follow")
      ->type_name("FILE");
  declarePicture(app, flags);
  app.option_defaults()->group("Comparison");
  app.add_option("--compare", flags.view.compare, "another model, to compare the first with")->type_name("FILE");
  app.add_option("--photos", flags.view.photographs, "a folder of the data set's photographs, to compare with")
      ->type_name("FOLDER");
  app.add_option("--compare-mode", flags.compare_mode, "side, wipe, difference, flip or (in a window) flicker")
      ->check(oneOf<CompareMode>());
  app.add_flag("--legend", flags.view.legend, "draw into the picture what its colours stand for");
  app.option_defaults()->group("Window");
  app.add_flag("--follow", flags.view.follow,
               "read the model again whenever it changes; model may be a run folder of tgtrain");
  app.add_option("--serve", flags.view.serve,
                 "show the model in browsers instead of a window, on this machine alone where no address is named")
      ->type_name("[ADDRESS:]PORT");
  app.add_option("--serve-token", flags.view.serve_token,
                 "what the page's address must bring; without one a random one, where others reach it")
      ->type_name("TEXT");
  app.add_option("--up", flags.up, "cameras, +x, -x, +y, -y, +z or -z: what the horizon is kept by")
      ->check(oneOf<UpAxis>())
      ->capture_default_str();
  app.add_option("--session", flags.view.session, "keep the window's state in this file instead of the usual one")
      ->type_name("FILE");
  app.add_flag("--no-session", flags.no_session, "keep nothing of this run, and begin with nothing of the last one");
  app.add_option("--script", flags.view.script, "drive the window from a file (docs/viewer.md)")->type_name("FILE");
  app.add_flag("--timings", flags.view.timings, "print how long the window took to its first pictures");
  declareRecording(app, flags);
  app.option_defaults()->group("Facts");
  app.add_option("--inspect", flags.inspect, "x,y: print the splats under that pixel as JSON and exit")
      ->type_name("X,Y");
  app.add_flag("--list-cameras", flags.list_cameras, "print the model's cameras and exit");
  app.add_flag("-q,--quiet", flags.view.quiet, "errors only: no warnings, no progress, no line about what is written");
  declareDevice(app, flags);
  addExamples(app,
              {{"tgview model.tgz", "in a window"},
               {"tgview model.tgz --render a.png --size 1920x1080", "to a file, without a display"},
               {"tgview model.tgz --photos fox --camera 3 --render a.png", "beside the photograph"},
               {"tgview model.tgz --turntable 120 -o turn.mp4", "a video"},
               {"tgview a.tgz --compare b.tgz", "two models"},
               {"tgview --follow run", "a training run"},
               {"tgview model.tgz --serve 8080", "in a browser"},
               {"tgview model.tgz --inspect 640,360 --size 1280x720", "what is blended at a pixel"}},
              kFooter);
}

void parseSettings(Flags& flags) {
  for (const RenderSetting& setting : renderSettings()) {
    const std::string& text = flags.settings[setting.name];
    // An empty text leaves the default, but is no name of textures: their flag shows its default.
    if (!text.empty() || setting.name == "textures") {
      setting.set(flags.view.settings, text, "--" + std::string(setting.name));
    }
  }
  if (!flags.settings["background"].empty()) flags.view.background = flags.view.settings.background;
}

void refuseIf(bool wrong, const char* problem) {
  if (wrong) throw Error(ErrorKind::usage, problem);
}

// What a run does: it decides what a flag can change.
enum class Task {
  window,
  picture,
  numbers,
  comparison,
  recording,
  benchmark,
  windowBenchmark,
  inspection,
  cameraList,
  serving
};
constexpr auto namesOf(Task) {
  return enumNames("in a window", "with --render", "with --render to .exr", "with --render of a comparison",
                   "with --output", "with --benchmark", "with --benchmark --window", "with --inspect",
                   "with --list-cameras", "with --serve");
}

bool isExr(const std::filesystem::path& path) { return lowerExtension(path) == ".exr"; }

Task taskOf(const Flags& flags) {
  const ViewOptions& view = flags.view;
  if (flags.list_cameras) return Task::cameraList;
  if (view.inspect) return Task::inspection;
  if (!view.out.empty()) {
    if (!view.compare.empty() || !view.photographs.empty()) return Task::comparison;
    return isExr(view.out) ? Task::numbers : Task::picture;
  }
  if (view.benchmark) return flags.window ? Task::windowBenchmark : Task::benchmark;
  if (!view.serve.empty()) return Task::serving;
  return view.record.empty() ? Task::window : Task::recording;
}

[[noreturn]] void refuseIdle(const std::string& flag, Task task, const std::string& expected) {
  throw Error(ErrorKind::usage, flag + ": does nothing " + std::string(name(task)) + " (expected " + expected + ")");
}

// Of the outputs that `holds` says yes to.
template <typename Holds>
std::string namesWhere(const Holds& holds) {
  std::string names;
  for (const Output output : valuesOf<Output>()) {
    if (holds(output)) names += (names.empty() ? "" : ", ") + std::string(name(output));
  }
  return names;
}

// Of a setting of the pictures.
void refuseIdleSetting(const RenderSetting& setting, const Flags& flags, Task task) {
  const std::string flag = "--" + std::string(setting.name);
  if (task == Task::cameraList) refuseIdle(flag, task, "no other flag");
  if (task == Task::serving) refuseIdle(flag, task, "a picture or a window; the page has settings of its own");
  if (task == Task::window) return;
  const bool for_pictures =
      setting.name == "exposure" || setting.name == "gain" || setting.name == "colors" || setting.name == "range";
  const bool no_picture =
      task == Task::numbers || task == Task::inspection || (task == Task::recording && isExr(flags.view.record));
  if (for_pictures && no_picture) refuseIdle(flag, task, "a picture");
  if (task == Task::inspection) return;
  const bool own_colors = task == Task::benchmark || task == Task::windowBenchmark;
  if (own_colors && (setting.name == "colors" || setting.name == "range"))
    refuseIdle(flag, task, "--render or a window");
  if (setting.name == "gain" && flags.view.compare_mode == CompareMode::difference) return;
  // Photographs lie over it, too.
  if (setting.name == "background" && !flags.view.photographs.empty()) return;
  if (setting.outputs.has(flags.view.show)) return;
  throw Error(ErrorKind::usage, flag + ": does nothing to " + std::string(name(flags.view.show)) +
                                    " (expected --show with one of " +
                                    namesWhere([&](Output output) { return setting.outputs.has(output); }) +
                                    (setting.name == "gain" ? ", or --compare-mode difference" : "") + ")");
}

// A flag that would do nothing is a mistake of whoever typed it.
void refuseIdleFlags(const CLI::App& app, const Flags& flags) {
  using enum Task;
  const ViewOptions& view = flags.view;
  const Task task = taskOf(flags);
  struct Use {
    const char* flag;
    std::vector<Task> tasks;  // that it changes
    const char* expected;
  };
  const bool turns = view.turntable > 0, legible = hasLegend(view.show);
  const std::vector<Task> drawn = {window, picture, numbers, comparison, recording, benchmark, windowBenchmark};
  std::vector<Task> viewed = {window, picture, numbers, comparison, inspection};
  std::vector<Task> timed = {window, benchmark, windowBenchmark}, turned = {},
                    up = {window, picture, numbers, comparison, inspection};
  if (turns) {
    for (std::vector<Task>* tasks : {&viewed, &turned, &up}) tasks->push_back(recording);
  }
  if (!turns || (!view.record.empty() && parseRecordTarget(view.record, "--output").video)) timed.push_back(recording);
  const std::vector<Use> uses = {
      {"--render", {picture, numbers, comparison}, "one of them"},
      {"--camera", viewed, "a view, no path"},
      {"--show", drawn, "a picture"},
      {"--size",
       {window, picture, numbers, comparison, recording, benchmark, windowBenchmark, inspection},
       "a picture"},
      {"--splat-budget", {window, picture, numbers, comparison, recording, inspection}, "a picture"},
      {"--backend", drawn, "a picture"},
      {"--device", drawn, "a picture"},
      {"--validation", drawn, "a picture"},
      {"--follow", {window, picture, numbers, serving}, "a window, --render or --serve"},
      {"--output", {recording}, "one of them"},
      {"--path", {window, recording}, "a window or --output"},
      {"--turntable", {recording}, "--output"},
      {"--elevation", turned, "--turntable"},
      {"--radius", turned, "--turntable"},
      {"--fps", timed, "a path, a video or a window"},
      {"--benchmark", {benchmark, windowBenchmark}, "one of them"},
      {"--up", up, "a view, no path"},
      {"--compare", {window, comparison}, "a window or --render"},
      {"--photos", {window, comparison}, "a window or --render"},
      {"--frames-in-flight", {window, windowBenchmark}, "a window"},
      {"--timings", {window, windowBenchmark}, "a window"},
      {"--session", {window, windowBenchmark}, "a window"},
      {"--no-session", {window, windowBenchmark}, "a window"},
      {"--script", {window}, "a window"},
      {"--quiet",
       {picture, numbers, comparison, recording, benchmark, inspection, cameraList, serving},
       "no window, whose lines are on screen"},
      {"--legend", {picture, comparison, recording}, "a picture; a window shows it by itself"},
  };
  for (const Use& use : uses) {
    if (app.count(use.flag) > 0 && std::ranges::find(use.tasks, task) == use.tasks.end()) {
      refuseIdle(use.flag, task, use.expected);
    }
  }
  for (const RenderSetting& setting : renderSettings()) {
    if (app.count("--" + std::string(setting.name)) > 0) refuseIdleSetting(setting, flags, task);
  }
  refuseIf(view.legend && task == comparison && !hasLegend(view.compare_mode),
           "--legend: side and wipe have none (expected --compare-mode difference or flip with it)");
  if (view.legend && task != comparison && (!legible || isExr(view.record))) {
    throw Error(ErrorKind::usage,
                "--legend: there are no numbers to explain (expected a picture, and --show with one of " +
                    namesWhere([](Output output) { return hasLegend(output); }) + ")");
  }
  refuseIf(app.count("--device") > 0 && view.backend == Backend::cpu,
           "--device: is of Vulkan and OpenGL (expected --backend vulkan, opengl or auto with it)");
  refuseIf(view.validation && view.backend == Backend::cpu && task != window && task != windowBenchmark,
           "--validation: is of Vulkan and OpenGL (expected --backend vulkan, opengl or auto with it)");
  refuseIf(app.count("--session") > 0 && app.count("--no-session") > 0,
           "--session and --no-session (expected one of them)");
  refuseIf(app.count("--frames-in-flight") > 0 && (view.backend == Backend::opengl || view.backend == Backend::cpu),
           "--frames-in-flight: is of Vulkan (expected --backend vulkan or auto with it)");
}

void parseShot(Flags& flags) {
  ViewOptions& view = flags.view;
  if (!flags.inspect.empty()) {
    view.inspect = parsePixel(flags.inspect, "--inspect");
    refuseIf(!view.out.empty() || !view.record.empty() || !view.script.empty() || view.follow,
             "--inspect prints (expected no --render, --output, --script or --follow with it)");
  }
  view.up = parse<UpAxis>(flags.up, "--up");
  view.fps = parseNumber(flags.fps, kMinFps, kMaxFps, "--fps");
  if (!flags.turntable.empty()) {
    view.turntable = static_cast<int>(parseCount(flags.turntable, 1, kMaxPathFrames, "--turntable"));
  }
  if (!flags.elevation.empty()) view.elevation = parseNumber(flags.elevation, -88, 88, "--elevation") * kDegrees;
  if (!flags.radius.empty()) view.radius = parseNumber(flags.radius, 1e-4, 1e9, "--radius");
  if (!flags.benchmark.empty()) {
    refuseIf(!view.record.empty() || !view.out.empty() || view.follow || !view.script.empty() || !view.path.empty() ||
                 view.turntable > 0,
             "--benchmark times (expected no --render, --output, --path, --turntable, --follow or --script)");
    view.path = flags.benchmark;
    view.benchmark = true;
    return;
  }
  refuseIf(!view.path.empty() && view.turntable > 0, "--path and --turntable (expected one of them)");
  refuseIf(!view.record.empty() && view.path.empty() && view.turntable == 0,
           "--output records a camera path (expected --path or --turntable with it)");
  refuseIf(flags.window, "--window says how to time (expected --benchmark with it)");
  refuseIf(view.record.empty() && view.turntable > 0, "--turntable makes frames (expected --output with it)");
  refuseIf(!view.path.empty() && !view.out.empty(), "--path goes through a scene (expected no --render with it)");
  refuseIf(!view.record.empty() && (!view.out.empty() || view.follow || !view.script.empty()),
           "--output records (expected no --render, --follow or --script with it)");
}

void parseValues(Flags& flags) {
  ViewOptions& view = flags.view;
  const bool window = view.out.empty() && view.record.empty() && flags.benchmark.empty() && !flags.list_cameras &&
                      flags.inspect.empty();
  if (flags.models.empty()) {
    const bool needs_none = window && !view.follow && view.compare.empty() && view.photographs.empty();
    refuseIf(!needs_none, "model is required (only a window of its own opens without)");
  } else {
    view.model = flags.models.front();
    view.more_models.assign(flags.models.begin() + 1, flags.models.end());
  }
  if (!view.more_models.empty() && (!window || view.follow)) {
    throw Error(ErrorKind::usage,
                view.more_models.front().string() + ": several models are for the window (expected one model here)");
  }
  const std::string out = view.out.string();
  refuseIf(out.starts_with("-") && view.out.extension().empty(),
           ("--render: expected a file name, found \"" + out + "\"").c_str());
  view.show = parse<Output>(flags.show, "--show");
  parseSettings(flags);
  if (!flags.size.empty()) view.size = parseSize(flags.size, "--size");
  if (!flags.splat_budget.empty()) {
    view.splat_budget =
        static_cast<std::size_t>(parseCount(flags.splat_budget, kLeastSplatBudget, kMostSplatBudget, "--splat-budget"));
  }
  view.backend = parse<Backend>(flags.backend, "--backend");
  if (!flags.compare_mode.empty()) view.compare_mode = parse<CompareMode>(flags.compare_mode, "--compare-mode");
  if (view.compare_mode == CompareMode::difference) {
    view.difference_gain = std::exchange(view.settings.gain, 1.0f);
  }
  const bool compares = !view.compare.empty() || !view.photographs.empty();
  const bool follows = view.follow && (!view.compare.empty() || !view.out.empty());
  refuseIf(compares && (!view.record.empty() || !flags.benchmark.empty() || follows),
           "--compare and --photos are for windows and pictures (expected no --output, --benchmark, --follow)");
  refuseIf(!flags.compare_mode.empty() && !compares,
           "--compare-mode says how (expected --compare or --photos with it)");
  refuseIf(!view.compare.empty() && !view.photographs.empty() && !view.out.empty(),
           "--compare and --photos (expected one of them with --render)");
  parseShot(flags);
  const bool other = !window || compares || view.inspect || !view.script.empty() || !view.more_models.empty();
  refuseIf(!view.serve.empty() && (other || view.model.empty()),
           "--serve shows a model in browsers (expected one model, and no other output with it)");
  refuseIf(view.serve.empty() && !view.serve_token.empty(), "--serve-token is of a page (expected --serve with it)");
  refuseIf((view.follow || view.benchmark) && isLodMeta(view.model),
           "--follow and --benchmark are of a model that is read whole (expected no lod-meta.json with it)");
  if (view.follow) view.model = followedFile(view.model);
  refuseIf(!view.out.empty() && !view.script.empty(), "--script drives the window (expected no --render with it)");
}

}  // namespace

std::optional<int> readFlags(int argc, char** argv, CommandLine& line) {
  CLI::App app("Shows models of textured Gaussians, in a window or to a file.", "tgview");
  Flags flags;
  declare(app, flags);
  if (const std::optional<int> code = parseCommandLine(app, argc, argv)) return code;
  if (flags.list_devices) {
    refuseIf(argc > 2, "--list-devices prints (expected nothing else with it)");
    printDevices();
    return 0;
  }
  flags.view.show_given = app.count("--show") > 0;
  flags.view.textures_given = app.count("--textures") > 0;
  flags.view.up_given = app.count("--up") > 0;
  parseValues(flags);
  refuseIdleFlags(app, flags);
  // A script's run must not depend on what someone did before.
  if (flags.view.session.empty() && flags.view.script.empty() && flags.benchmark.empty()) {
    flags.view.session = sessionFile();
  }
  if (flags.no_session) flags.view.session.clear();
  line = {std::move(flags.view), flags.list_cameras, flags.window};
  return std::nullopt;
}

}  // namespace tg
