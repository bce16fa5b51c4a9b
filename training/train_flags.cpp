// SPDX-License-Identifier: Apache-2.0
// Flags in groups, one an entry of the recipe, and files of settings below them.
#include "training/train_flags.h"

#include <algorithm>
#include <cstdio>
#include <string_view>
#include <vector>

#include "converter/registry/file_format.h"
#include "core/system/error.h"
#include "core/system/program.h"
#include "training/settings/idle.h"

namespace tg {

namespace {

// Every entry of the settings as a flag; what is given stands in `chosen`, over the preset. Switches are flags that
// also take =on and =off.
void addSettingFlags(CLI::App& app, TrainFlags& options) {
  const TrainSettings defaults;
  for (const SettingEntry& entry : settingEntries()) {
    const std::string flag = "--" + entry.name;
    const std::string value = entry.get(defaults);
    const bool is_switch = value == "on" || value == "off";
    const std::string help = entry.help + (entry.unit.empty() ? "" : " [" + entry.unit + "]");
    CLI::Option* option = is_switch ? app.add_flag(flag, options.chosen[&entry], help)
                                    : app.add_option(flag, options.chosen[&entry], help)->default_str(value);
    if (!entry.choices.empty()) {
      option->check(oneOf(entry.choices))->type_name("NAME");
    } else if (!is_switch) {
      option->type_name("N");
    }
    option->group("Recipe: numbers and names of --print-config");
  }
}

// Reads a file of settings as ever, and notes which flags stand beside it: it is read after them.
class SettingsFile : public CLI::ConfigTOML {
 public:
  SettingsFile(const CLI::App& app, TrainFlags& options) : app_(app), options_(options) {}
  std::vector<CLI::ConfigItem> from_config(std::istream& input) const override {
    for (const SettingEntry& entry : settingEntries()) {
      if (app_.count("--" + entry.name) > 0) options_.by_flag.insert(&entry);
    }
    std::vector<CLI::ConfigItem> found = CLI::ConfigTOML::from_config(input);
    const std::string& path = options_.settings_file = app_.get_config_ptr()->as<std::string>();
    for (const CLI::ConfigItem& item : found) {
      if (!item.parents.empty()) {  // a section would be a command's
        throw Error(ErrorKind::usage, path, "no such setting: [" + item.parents.front() + "] (expected no sections)");
      }
      const CLI::Option* option = app_.get_option_no_throw("--" + item.name);
      if (option && !option->get_configurable()) {
        throw Error(ErrorKind::usage, path, "no such setting: " + item.name + " (expected as a flag)");
      }
      if (item.inputs.empty() || item.inputs.front().empty()) {
        throw Error(ErrorKind::usage, path, item.name + ": expected a value, found none");
      }
    }
    return found;
  }

 private:
  const CLI::App& app_;
  TrainFlags& options_;
};

}  // namespace

TrainSettings settingsOf(const TrainFlags& options) {
  TrainSettings settings = presetSettings(options.preset);
  for (const auto& [entry, value] : options.chosen) {
    if (value.empty()) continue;
    try {
      entry->set(settings, value == "true" ? "on" : value == "false" ? "off" : value);
    } catch (const Error& error) {
      if (options.settings_file.empty() || options.by_flag.contains(entry)) throw;
      const std::string message = error.what();
      throw Error(error.kind, options.settings_file, message.starts_with("--") ? message.substr(2) : message);
    }
  }
  // What says how many Gaussians goes over what said it before: a flag over the file, both over the preset.
  const auto from = [&](std::string_view name) {
    const auto chosen = std::ranges::find_if(
        options.chosen, [&](const auto& setting) { return setting.first->name == name && !setting.second.empty(); });
    if (chosen == options.chosen.end()) return 0;
    return !options.settings_file.empty() && !options.by_flag.contains(chosen->first) ? 1 : 2;
  };
  if (from("percent") > from("gaussians") && settings.percent > 0) settings.gaussians = 0;
  if (from("gaussians") > from("percent") && settings.gaussians > 0) settings.percent = 0;
  settings.compare_untextured |= !options.untextured_output.empty();
  if (options.target_bytes == 0) checkSettings(settings);  // else what is planned completes them
  return settings;
}

void addTrainingOptions(CLI::App& app, TrainFlags& options) {
  app.add_option("dataset", options.dataset, "Folder: transforms_train.json, transforms.json or COLMAP sparse/0")
      ->type_name("FOLDER");
  app.option_defaults()->group("Model and report");
  app.add_option("-o,--output", options.output,
                 "Model to write, by its extension: " + listed(outputNames(true)) + "; optional with --run")
      ->configurable(false)
      ->type_name("FILE");
  addBytes(app, "--target-size", options.target_bytes,
           "Of a .sog or .glb: at most so many bytes, 900KB (900,000) or 1.5MB; chooses counts that nobody named")
      ->configurable(false);
  app.add_option("--steps", options.steps,
                 "Of a .sog or .glb: so many times as wide are the steps of its numbers (tgconvert --steps)")
      ->check(within(kLeastSteps, kMostSteps))
      ->excludes("--target-size")
      ->configurable(false);
  app.add_option("--untextured-output", options.untextured_output,
                 "Write the untextured model too (implies --compare-untextured)")
      ->configurable(false)
      ->type_name("FILE");
  app.add_option("--json", options.json,
                 "Also write training.json here; -: to standard output, which holds nothing else then")
      ->configurable(false)
      ->type_name("FILE");
  app.add_flag("--reproducible", options.reproducible,
               "No times and no memory in training.json: same seed, same bytes");
  app.add_flag("--overwrite", options.overwrite, "Replace existing files")->configurable(false);
  app.add_flag("-q,--quiet", options.quiet, "Errors only");
  addDatasetFlags(app, options.data);
  app.option_defaults()->group("Settings");
  app.add_option("--preset", options.preset, "Where settings start from; flags and --config go over it")
      ->check(oneOf(presetNames()))
      ->capture_default_str();
  app.set_config("--config", "", "Settings from a file, as --print-config writes it; flags go over it")
      ->type_name("FILE")
      ->configurable(false);
  app.config_formatter(std::make_shared<SettingsFile>(app, options));
  app.allow_config_extras(CLI::config_extras_mode::error);
  app.add_flag("--print-config", options.print_config, "Print all settings with their units and end")
      ->configurable(false);
  app.add_option(
         "--start-model", options.start_model,
         "Go on from this model (of any format); with --iterations 0, only add textures to it; one with textures goes "
         "on in stage 2")
      ->type_name("FILE");
  app.add_option("--context", options.context,
                 "Draw this model, too, and leave it as it is: a coarse one of the whole scene, around a block of it")
      ->type_name("FILE");
  addDeviceFlag(app, options.device, "Where to train; auto: a CUDA device if there is one");
  app.add_option("--threads", options.threads, "Threads (0: all cores); the model does not depend on it")
      ->check(within(0, 4096));
  addSettingFlags(app, options);
}

void addRunOptions(CLI::App& app, TrainFlags& options) {
  const auto add = [&](auto* option) { option->group("Run folder")->configurable(false); };
  const CLI::Validator iterations = within(0, 10'000'000);
  add(app.add_option("--run", options.run.folder,
                     "Folder for checkpoint, model.tgz, metrics.jsonl and previews/ of this run")
          ->type_name("FOLDER"));
  add(app.add_flag("--resume", options.run.resume, "Go on from the run folder's checkpoint, to the same model"));
  add(app.add_option("--checkpoint-every", options.run.checkpoint_seconds,
                     "Time between checkpoints (0: after every step) [s]")
          ->check(within(0.0, 1e6))
          ->capture_default_str());
  add(app.add_option("--metrics-every", options.run.metrics_every,
                     "A line of metrics.jsonl and of --serve (0: none) [iterations]")
          ->check(iterations)
          ->capture_default_str());
  add(app.add_option("--eval-every", options.run.eval_every,
                     "Test scores among them (0: at the end of each stage) [iterations]")
          ->check(iterations)
          ->capture_default_str());
  add(app.add_option("--preview-every", options.run.preview_every,
                     "A picture in previews/, truth beside rendering (0: none) [iterations]")
          ->check(iterations)
          ->capture_default_str());
  add(app.add_flag("--watch", options.watch, "Show the run in tgview while it trains"));
  add(app.add_option("--serve", options.serve,
                     "Show the run in browsers, on this machine alone where no address is named")
          ->type_name("[ADDRESS:]PORT"));
  add(app.add_option("--serve-token", options.serve_token,
                     "What the page's address must bring; without one a random one, where others reach it")
          ->type_name("TEXT"));
}

void refuseIdleFlags(const CLI::App& app, const TrainFlags& options) {
  const auto refuse = [&](const char* flag, const char* expected) {
    if (app.count(flag) > 0) throw Error(ErrorKind::usage, std::string(flag) + " expects " + expected);
  };
  if (!options.start_model.empty()) refuse("--points", "no --start-model, which is a start of its own");
  if (settingsOf(options).start == Start::random) refuse("--points", "no --start random, which has its own");
  if (!options.run.folder.empty()) return;
  for (const char* flag : {"--checkpoint-every", "--preview-every"}) refuse(flag, "a run folder (--run FOLDER)");
  if (!options.serve.empty()) return;
  for (const char* flag : {"--metrics-every", "--eval-every"}) refuse(flag, "--run FOLDER or --serve");
}

void warnIdleSettings(const TrainFlags& options, const GaussianModel* start) {
  if (options.print_config || options.dataset.empty() || (!start && !options.start_model.empty())) return;
  const ChosenSetting by_flag = [&](const SettingEntry& entry) {
    const auto found = options.chosen.find(&entry);
    return found != options.chosen.end() && !found->second.empty() &&
           (options.settings_file.empty() || options.by_flag.contains(&entry));
  };
  for (const std::string& line : idleSettings(settingsOf(options), by_flag, start, options.target_bytes > 0)) {
    std::fprintf(stderr, "tgtrain: %s\n", line.c_str());
  }
}

}  // namespace tg
