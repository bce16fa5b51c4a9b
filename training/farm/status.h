// SPDX-License-Identifier: Apache-2.0
// How a farm stands: a table for the terminal, and a page.
#pragma once
#include <optional>
#include <string>
#include <vector>

#include "core/run/metrics.h"
#include "training/farm/claims.h"

namespace tg {

struct FarmRow {
  std::string job;
  JobView view;
  std::optional<RunMetrics> now;    // the newest line of its metrics
  std::optional<double> test_psnr;  // [dB] the newest of them
};

std::vector<FarmRow> rowsOf(const FarmFolder& farm);

// "3 of 6 done, 2 taken, 1 open"
std::string summaryOf(const std::vector<FarmRow>& rows);
std::string statusTable(const std::vector<FarmRow>& rows);
// A page of its own: no script, nothing from elsewhere. Same rows in, same bytes out.
std::string statusPage(const std::string& title, const std::vector<FarmRow>& rows);

}  // namespace tg
