// SPDX-License-Identifier: Apache-2.0
// The members of a line, in any JSON object. Private to core/run.
#pragma once
#include <nlohmann/json_fwd.hpp>
#include <optional>

#include "core/run/metrics.h"

namespace tg {

void addMetrics(nlohmann::ordered_json& json, const RunMetrics& metrics);
std::optional<RunMetrics> metricsIn(const nlohmann::json& json);

}  // namespace tg
