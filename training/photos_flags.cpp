// SPDX-License-Identifier: Apache-2.0
// Flags to options, stages to lines.
#include "training/photos_flags.h"

#include <atomic>
#include <cstdio>
#include <vector>

#include "core/system/error.h"
#include "core/system/names.h"
#include "core/system/program.h"
#include "core/system/signals.h"
#include "training/photos/child.h"
#include "training/run/report.h"

namespace tg {
namespace {

std::atomic<int> stopped_by{0};  // a signal

// The first asks the stages to end, the second ends the program; a child goes with it.
void stopPhotos(int signal) {
  if (stopped_by.exchange(signal) != 0) endAtOnce(signal);
}

template <typename E>
std::vector<std::string> everyName() {
  constexpr auto names = namesOf(E{});
  return {names.begin(), names.end()};
}

}  // namespace

void addPhotosFlags(CLI::App& app, PhotosFlags& flags) {
  const auto add = [&](CLI::Option* option) { option->group("Photographs")->configurable(false); };
  const auto one_of = [](CLI::Option* option, const std::vector<std::string>& names) {
    return option->check(oneOf(names))->capture_default_str();
  };
  add(app.add_option(
      "--work", flags.work,
      "Folder for photographs, cameras and run (beside the model: model.photos); the same command goes on "
      "in it"));
  add(app.add_option("--frames", flags.frames, "Frames of a film to keep: the sharpest of as many stretches")
          ->check(within(3, 5000))
          ->capture_default_str());
  add(app.add_option("--longest-side", flags.longest_side,
                     "Photographs larger than this are reduced to it (0: none is) [px]")
          ->check(within(0, 65536))
          ->capture_default_str());
  add(one_of(
      app.add_option("--cameras-by", flags.solver, "Which COLMAP finds the cameras: the program or Python's module"),
      everyName<SolverKind>()));
  add(one_of(app.add_option("--matching", flags.matching,
                            "Which pairs are matched. auto: a film's neighbours; all of up to 200 photographs; of more "
                            "the nearest by GPS, or neighbours by name"),
             everyName<Matching>()));
  add(one_of(app.add_option("--mapper", flags.mapper, "COLMAP's way to the cameras; global wants version 4"),
             everyName<Mapper>()));
  add(one_of(app.add_option("--lens", flags.lens, "The lens model that COLMAP fits"), everyName<LensModel>()));
  add(app.add_option("--least-registered", flags.least_registered,
                     "Share of the photographs that must get a camera [%]")
          ->check(within(0.0, 100.0))
          ->capture_default_str());
  add(app.add_flag("--no-open", flags.no_open, "Do not open the model in tgview at the end"));
}

PhotosOptions photosOptions(const PhotosFlags& flags, const std::string& input, const std::string& output,
                            int threads) {
  PhotosOptions options;
  options.input = input;
  options.work = flags.work.empty() ? std::filesystem::path(output).replace_extension(".photos").string() : flags.work;
  options.frames = flags.frames;
  options.longest_side = flags.longest_side;
  options.solver = parse<SolverKind>(flags.solver).value_or(SolverKind::automatic);
  options.matching = parse<Matching>(flags.matching).value_or(Matching::automatic);
  options.mapper = parse<Mapper>(flags.mapper).value_or(Mapper::incremental);
  options.lens = parse<LensModel>(flags.lens).value_or(LensModel::simpleRadial);
  options.least_registered = flags.least_registered;
  options.threads = threads;
  return options;
}

void preparePhotosAloud(const PhotosOptions& options, Ledger& ledger, bool talks, bool quiet) {
  ProgressLine progress;
  PhotosListener listener;
  listener.say = [&](const std::string& line) {
    progress.finish();
    if (talks) std::printf("%s\n", printable(line).c_str());
    std::fflush(stdout);
  };
  listener.warn = [&](const std::string& line) {
    progress.finish();
    std::fprintf(stderr, "tgtrain: %s\n", printable(line).c_str());
  };
  listener.progress = [&](const std::string& what, std::size_t done, std::size_t count) {
    if (!quiet) progress.show(what, done, count);
  };
  handleStopSignals(stopPhotos);
  try {
    preparePhotos(options, ledger, listener, stopped_by);
  } catch (const Stopped&) {
  }
  handleStopSignals(endAtOnce);  // until training has its own
  if (stopped_by == 0) return;
  progress.finish();
  std::fprintf(stderr, "tgtrain: stopped; the same command goes on\n");
  endAtOnce(stopped_by);
}

}  // namespace tg
