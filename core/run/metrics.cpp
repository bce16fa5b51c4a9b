// SPDX-License-Identifier: Apache-2.0
// One schema for every line.
#include "core/run/metrics.h"

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "core/file/json.h"
#include "core/run/metrics_json.h"
#include "core/system/assert.h"
#include "core/system/error.h"

namespace tg {
namespace {

constexpr std::size_t kMaxStageName = 32;
constexpr double kLargest = 1e100;  // of what is measured: differences are numbers still

nlohmann::ordered_json optionalNumber(const std::optional<double>& value, int decimals) {
  if (!value || !std::isfinite(*value)) return nullptr;
  return rounded(*value, decimals);
}

std::optional<double> numberIn(const nlohmann::json& object, const char* key) {
  const auto found = object.find(key);
  if (found == object.end() || !found->is_number()) return std::nullopt;
  const double number = found->get<double>();
  return std::abs(number) <= kLargest ? std::optional(number) : std::nullopt;
}

// A count from 0 on.
template <typename T>
T countIn(const nlohmann::json& object, const char* key) {
  constexpr double kMost = std::numeric_limits<int>::max();
  const std::optional<double> number = numberIn(object, key);
  return number && *number >= 0 && *number <= kMost ? static_cast<T>(*number) : T{0};
}

}  // namespace

double rounded(double value, int decimals) {
  TG_ASSERT(decimals >= 0, "decimals are counted from 0");
  const double scale = std::pow(10.0, decimals);
  return std::round(value * scale) / scale;
}

void addMetrics(nlohmann::ordered_json& json, const RunMetrics& metrics) {
  json["stage"] = metrics.stage;
  json["iteration"] = metrics.iteration;
  json["iterations"] = metrics.iterations;
  json["loss"] = optionalNumber(metrics.loss, 6);
  json["train_psnr"] = optionalNumber(metrics.train_psnr, 4);
  json["gaussians"] = metrics.gaussians;
  json["per_second"] = optionalNumber(metrics.per_second, 3);
  json["seconds"] = rounded(metrics.seconds, 3);
  json["seconds_left"] = optionalNumber(metrics.seconds_left, 1);
  json["test_psnr"] = optionalNumber(metrics.test_psnr, 4);
  json["test_ssim"] = optionalNumber(metrics.test_ssim, 5);
  json["test_views"] = metrics.test_views ? nlohmann::ordered_json(*metrics.test_views) : nullptr;
}

std::optional<RunMetrics> metricsIn(const nlohmann::json& json) {
  const auto stage = json.is_object() ? json.find("stage") : json.end();
  if (!json.is_object() || stage == json.end() || !stage->is_string()) return std::nullopt;
  RunMetrics metrics;
  metrics.stage = stage->get<std::string>();
  if (metrics.stage.size() > kMaxStageName) return std::nullopt;
  metrics.iteration = countIn<int>(json, "iteration");
  metrics.iterations = countIn<int>(json, "iterations");
  metrics.loss = numberIn(json, "loss");
  metrics.train_psnr = numberIn(json, "train_psnr");
  metrics.gaussians = countIn<std::size_t>(json, "gaussians");
  metrics.per_second = numberIn(json, "per_second");
  metrics.seconds = numberIn(json, "seconds").value_or(0);
  metrics.seconds_left = numberIn(json, "seconds_left");
  metrics.test_psnr = numberIn(json, "test_psnr");
  metrics.test_ssim = numberIn(json, "test_ssim");
  if (numberIn(json, "test_views")) metrics.test_views = countIn<std::size_t>(json, "test_views");
  return metrics;
}

std::string formatMetrics(const RunMetrics& metrics) {
  nlohmann::ordered_json json = {{"format", "tgtrain-metrics"}, {"version", 1}};
  addMetrics(json, metrics);
  return dumpJson(json) + "\n";
}

std::optional<RunMetrics> parseMetrics(std::string_view line) {
  try {
    return metricsIn(parseJson(line, "metrics.jsonl"));
  } catch (const Error&) {
    return std::nullopt;
  }
}

}  // namespace tg
