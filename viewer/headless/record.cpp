// SPDX-License-Identifier: Apache-2.0
// Renders frame after frame while the writer compresses the ones before.
#include "viewer/headless/headless.h"

#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <memory>

#include "core/system/lower_case.h"
#include "viewer/headless/renderer.h"
#include "viewer/picture/frame_writer.h"
#include "viewer/view/shot.h"

namespace tg {
namespace {

// A line that is overwritten on a terminal; in a log, a line every tenth of the way.
class Progress {
 public:
  Progress(std::size_t frames, bool shown)
      : frames_(frames), shown_(shown), terminal_(shown && ::isatty(STDERR_FILENO) != 0) {}
  ~Progress() {
    if (terminal_ && done_ > 0) std::fputc('\n', stderr);
  }
  Progress& operator=(Progress&&) = delete;

  void step() {
    ++done_;
    if (!shown_) return;
    if (!terminal_ && done_ * 10 / frames_ == (done_ - 1) * 10 / frames_) return;
    const double seconds = this->seconds();
    std::fprintf(stderr, "%sframe %zu / %zu, %.0f ms a frame, %.0f s left%s", terminal_ ? "\r" : "", done_, frames_,
                 1000 * seconds / static_cast<double>(done_),
                 seconds / static_cast<double>(done_) * static_cast<double>(frames_ - done_), terminal_ ? "  " : "\n");
    std::fflush(stderr);
  }

  double seconds() const { return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count(); }

 private:
  const std::size_t frames_;
  const bool shown_;
  const bool terminal_;
  const std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
  std::size_t done_ = 0;
};

}  // namespace

void recordToFile(const ViewOptions& options) {
  const RecordTarget target = parseRecordTarget(options.record, "--output");
  const bool numbers = lowerExtension(target.path) == ".exr";
  ViewedScene viewed(options, options.model);
  const Scene& scene = viewed.scene();
  const std::vector<Camera> cameras = shotCameras(options, scene, target.video);
  const RenderSettings settings = settingsFor(options, scene.background);
  FrameWriter writer(target, cameras.front().size, options.fps, cameras.size());
  const HeadlessRenderer backend = makeHeadlessRenderer(options);

  double seconds = 0;
  std::size_t most = 0;  // Gaussians of a frame
  std::shared_ptr<const GaussianModel> set;
  {
    Progress progress(cameras.size(), !options.quiet);
    for (const Camera& camera : cameras) {
      if (auto model = viewed.modelFor(camera); model != set) {
        set = std::move(model);
        backend.renderer->setModel(set);
        most = std::max(most, set->size());
      }
      const Frame frame = backend.renderer->render(camera, settings);
      writer.add(numbers ? extract(frame, options.show) : shownPicture(frame, options, settings));
      progress.step();
    }
    requireNoValidationMessages(backend);
    writer.finish();
    seconds = progress.seconds();
  }
  if (options.quiet) return;
  std::printf("%s: %zu frames of %dx%d, %s, textures %s, %zu Gaussians, %.1f s on %s\n", target.path.c_str(),
              cameras.size(), cameras.front().size.x, cameras.front().size.y, std::string(name(options.show)).c_str(),
              drawnTextures(*set, settings).c_str(), most, seconds, backend.renderer->deviceName().c_str());
}

}  // namespace tg
