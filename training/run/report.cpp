// SPDX-License-Identifier: Apache-2.0
// Numbers to text.
#include "training/run/report.h"

#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <vector>

#include "core/system/assert.h"
#include "core/system/numbers.h"

namespace tg {
namespace {

using Json = nlohmann::ordered_json;

// FNV-1a.
class Fingerprint {
 public:
  void add(const void* data, std::size_t size) {
    const auto* bytes = static_cast<const unsigned char*>(data);
    for (std::size_t i = 0; i < size; ++i) hash_ = (hash_ ^ bytes[i]) * 0x100000001b3u;
  }
  std::string text() const { return formatted("%016llx", static_cast<unsigned long long>(hash_)); }

 private:
  std::uint64_t hash_ = 0xcbf29ce484222325u;
};

Json stageJson(const StageReport& stage, bool measurements) {
  Json json = {{"iterations", stage.iterations},
               {"gaussians", stage.gaussians},
               {"loss", rounded(stage.loss, 6)},
               {"train_psnr", rounded(stage.train_psnr, 4)}};
  if (stage.test) {
    json["test_psnr"] = rounded(stage.test->psnr, 4);
    json["test_ssim"] = rounded(stage.test->ssim, 5);
    json["test_views"] = stage.test->views;
  }
  if (measurements) json["seconds"] = rounded(stage.seconds, 2);
  return json;
}

std::string stageLine(Stage stage, const StageReport& report) {
  std::string line = formatted("%-11s %6d iterations  %8zu Gaussians", std::string(name(stage)).c_str(),
                               report.iterations, report.gaussians);
  if (report.iterations > 0) line += formatted("  loss %.4f", report.loss);
  if (report.test) {
    line += formatted("  test PSNR %.2f dB  SSIM %.4f (%zu views)", report.test->psnr, report.test->ssim,
                      report.test->views);
  }
  return line + "  " + formatSeconds(report.seconds) + "\n";
}

}  // namespace

ProgressLine::ProgressLine() : terminal_(isatty(STDERR_FILENO) != 0) {}

ProgressLine::~ProgressLine() { finish(); }

void ProgressLine::show(const TrainProgress& progress) {
  const auto now = std::chrono::steady_clock::now();
  const bool last = progress.iteration == progress.iterations;
  if (now < next_ && !last) return;
  next_ = now + (terminal_ ? std::chrono::milliseconds(100) : std::chrono::milliseconds(5000));
  const std::string text = formatProgress(progress);
  std::fprintf(stderr, terminal_ ? "\r\033[K%s" : "%s\n", text.c_str());
  open_ = terminal_;
  if (last) finish();
}

void ProgressLine::show(const std::string& what, std::size_t done, std::size_t count) {
  const auto now = std::chrono::steady_clock::now();
  if (what != counted_) {
    counted_ = what;
    counted_since_ = now;
    next_ = now + std::chrono::seconds(1);
  }
  if (done == count) {
    counted_.clear();
    if (open_) std::fputs("\r\033[K", stderr);
    open_ = false;
    next_ = {};
    return;
  }
  if (now < next_ || done == 0) return;
  next_ = now + (terminal_ ? std::chrono::milliseconds(100) : std::chrono::milliseconds(5000));
  const double seconds = std::chrono::duration<double>(now - counted_since_).count();
  const double left = seconds / static_cast<double>(done) * static_cast<double>(count - done);
  std::fprintf(stderr, terminal_ ? "\r\033[K%s: %zu of %zu, %s left" : "%s: %zu of %zu, %s left\n", what.c_str(), done,
               count, formatSeconds(left).c_str());
  open_ = terminal_;
}

void ProgressLine::finish() {
  if (open_) std::fputc('\n', stderr);
  open_ = false;
}

std::string formatProgress(const TrainProgress& progress) {
  return formatted("%s %d/%d  loss %.4f  PSNR %.2f dB  %zu Gaussians  %.1f it/s  %s left",
                   std::string(name(progress.stage)).c_str(), progress.iteration, progress.iterations, progress.loss,
                   progress.psnr, progress.gaussians, progress.per_second,
                   formatSeconds(progress.seconds_left).c_str());
}

std::string formatSummary(const TrainReport& report, double total_seconds) {
  std::string text = report.count ? stageLine(Stage::count, *report.count) : "";
  if (report.plain.gaussians > 0) text += stageLine(Stage::plain, report.plain);
  if (report.textured) text += stageLine(Stage::textured, *report.textured);
  if (report.untextured) text += stageLine(Stage::untextured, *report.untextured);
  if (report.quantized) text += stageLine(Stage::quantized, *report.quantized);
  if (report.textured && report.textured->test && report.untextured && report.untextured->test) {
    text += formatted("textures gain %+.2f dB PSNR, %+.4f SSIM at the same Gaussians and iterations\n",
                      report.textured->test->psnr - report.untextured->test->psnr,
                      report.textured->test->ssim - report.untextured->test->ssim);
  }
  text += formatted("%s in all, peak memory %.0f MiB\n", formatSeconds(total_seconds).c_str(),
                    static_cast<double>(peakMemory()) / (1 << 20));
  return text;
}

RunMetrics metricsOf(const TrainProgress& progress, double seconds) {
  RunMetrics metrics;
  metrics.stage = name(progress.stage);
  metrics.iteration = progress.iteration;
  metrics.iterations = progress.iterations;
  if (progress.iteration > 0) {
    metrics.loss = progress.loss;
    metrics.train_psnr = progress.psnr;
    metrics.per_second = progress.per_second;
    metrics.seconds_left = progress.seconds_left;
  }
  metrics.gaussians = progress.gaussians;
  metrics.seconds = seconds;
  return metrics;
}

std::string datasetFingerprint(const Dataset& dataset) {
  Fingerprint hash;
  for (std::size_t i = 0; i < dataset.views.size(); ++i) {
    const Camera& camera = dataset.views[i];
    const double intrinsics[] = {camera.focal.x, camera.focal.y, camera.center.x, camera.center.y,
                                 camera.test ? 1.0 : 0.0};
    hash.add(intrinsics, sizeof intrinsics);
    hash.add(&camera.rotation, sizeof camera.rotation);
    hash.add(&camera.translation, sizeof camera.translation);
    const std::shared_ptr<const ViewPixels> pixels = dataset.pixels(i);
    hash.add(pixels->rgb.data(), pixels->rgb.size());
    hash.add(pixels->mask.data(), pixels->mask.size());
  }
  hash.add(dataset.points.position.data(), dataset.points.position.size() * sizeof(glm::vec3));
  hash.add(dataset.points.color.data(), dataset.points.color.size() * sizeof(glm::vec3));
  return hash.text();
}

std::string transparencyFingerprint(const Dataset& dataset) {
  Fingerprint hash;
  for (const std::size_t i : dataset.indices(false)) {
    const std::shared_ptr<const Photograph> photograph = dataset.photographs->get(i);
    const std::vector<std::uint8_t>& alpha = photograph->alpha;
    const bool opaque = std::ranges::all_of(alpha, [](std::uint8_t value) { return value == 255; });
    const std::uint64_t size = opaque ? 0 : alpha.size();
    hash.add(&size, sizeof size);
    hash.add(alpha.data(), size);
  }
  return hash.text();
}

std::string formatTrainingJson(const Dataset& dataset, const TrainSettings& settings, const TrainReport& report,
                               const GaussianModel& model, const TrainingJsonOptions& options) {
  const Camera& camera = dataset.views.front();
  Json json;
  json["format"] = "tgtrain-training";
  json["version"] = 1;
  json["dataset"] = {{"name", dataset.name},
                     {"layout", name(dataset.layout)},
                     {"train_views", dataset.indices(false).size()},
                     {"test_views", dataset.indices(true).size()},
                     {"validation", dataset.validation},
                     {"masks", name(dataset.masks)},
                     {"missing_images", dataset.missing_images},
                     {"width", camera.size.x},
                     {"height", camera.size.y},
                     {"downscale", options.downscale},
                     {"points", dataset.points.position.size()},
                     {"normalized", nullptr},
                     {"fingerprint", options.fingerprint.empty() ? datasetFingerprint(dataset) : options.fingerprint}};
  if (const std::optional<Normalization>& made = dataset.normalized) {
    json["dataset"]["normalized"] = {{"scale", made->scale},
                                     {"origin", {made->origin.x, made->origin.y, made->origin.z}}};
  }
  for (const SettingEntry& entry : settingEntries()) {
    const std::string value = entry.get(settings);
    const Json number = Json::parse(value, nullptr, false);
    json["settings"][entry.name] = number.is_number() ? number : Json(value);
  }
  json["background"] = {dataset.background.x, dataset.background.y, dataset.background.z};
  json["extent"] = report.extent;
  json["initial_gaussians"] = report.initial_gaussians;
  json["gaussians"] = model.size();
  json["texels"] = model.atlas.texels.size();
  json["interrupted"] = report.interrupted;
  if (report.count) json["stages"]["count"] = stageJson(*report.count, options.measurements);
  if (report.plain.gaussians > 0) json["stages"]["plain"] = stageJson(report.plain, options.measurements);
  if (report.textured) json["stages"]["textured"] = stageJson(*report.textured, options.measurements);
  if (report.untextured) json["stages"]["untextured"] = stageJson(*report.untextured, options.measurements);
  if (report.quantized) json["stages"]["quantized"] = stageJson(*report.quantized, options.measurements);
  if (options.measurements) {
    json["machine"] = {{"device", options.device},
                       {"threads", options.threads},
                       {"seconds", rounded(options.total_seconds, 2)},
                       {"peak_memory_bytes", peakMemory()}};
  }
  return json.dump(1, ' ', false, Json::error_handler_t::replace) + "\n";
}

std::uint64_t peakMemory() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<std::uint64_t>(usage.ru_maxrss) * 1024;  // Linux counts KiB
}

}  // namespace tg
