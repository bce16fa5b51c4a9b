// SPDX-License-Identifier: Apache-2.0
// What training over several processes exchanges: its ranks as threads, their messages counted.
#include <CLI/CLI.hpp>
#include <cstdio>
#include <string>

#include "core/system/parallel.h"
#include "core/system/program.h"
#include "training/data/dataset.h"
#include "training/mpi/engine.h"
#include "training/mpi/thread_channel.h"
#include "training/run/trainer.h"

int main(int argc, char** argv) {
  return tg::runProgram("sharded_bench", [&] {
    CLI::App app("Prints how many bytes a step of training over several processes sends.", "sharded_bench");
    std::string data;
    int ranks = 2, iterations = 20, downscale = 1;
    int texels = 0;
    app.add_option("--data", data, "Data set")->required();
    app.add_option("--ranks", ranks, "Processes")->check(tg::within(1, 64))->capture_default_str();
    app.add_option("--iterations", iterations, "Steps that are counted")
        ->check(tg::within(1, 1000000))
        ->capture_default_str();
    app.add_option("--texels", texels, "Side of the textures (0: none)")
        ->check(tg::within(0, 64))
        ->capture_default_str();
    app.add_option("--downscale", downscale, "Shrink the photographs")->capture_default_str();
    tg::addExamples(app, {{"build/bin/sharded_bench --data scene --ranks 4 --texels 4", "with textures"}});
    if (const std::optional<int> code = tg::parseCommandLine(app, argc, argv)) return *code;
    tg::DatasetOptions options;
    options.downscale = downscale;
    const tg::Dataset dataset = tg::loadDataset(data, options);
    tg::TrainSettings settings;
    settings.densification = tg::Densification::none;
    settings.iterations = texels > 0 ? 0 : iterations + 1;
    settings.texture_iterations = texels > 0 ? iterations + 1 : 0;
    if (texels > 0) settings.texture_size = texels;
    tg::test::ThreadRanks shared(ranks);
    tg::test::atRanks(shared, [&](tg::Channel& channel) {
      if (channel.rank() > 0) {
        tg::serveRank(channel, dataset);
        return;
      }
      const auto renderer = tg::makeShardedRenderer(channel, dataset);
      tg::Trainer trainer(dataset, settings, *renderer);
      trainer.step();  // parts the model
      const std::size_t before = shared.sent();
      for (int i = 0; i < iterations; ++i) trainer.step();
      const double bytes = static_cast<double>(shared.sent() - before) / iterations;
      const tg::Camera& camera = dataset.views.front();
      std::printf("%d ranks, %zu Gaussians, %d x %d: %.2f MB a step between ranks\n", ranks,
                  trainer.progress().gaussians, camera.size.x, camera.size.y, bytes / 1e6);
      tg::endRanks(channel, 0);
    });
    return 0;
  });
}
