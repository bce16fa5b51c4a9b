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
  std::optional<double> silence;    // [s] since the worker's last sign of life, where it is taken for dead
};

// `stale` [s]: a worker without a sign of life for so long is dead, by the clock of this machine and the share's.
std::vector<FarmRow> rowsOf(const FarmFolder& farm, double stale);

// "3 of 6 done, 2 taken (1 by the dead), 1 open"
std::string summaryOf(const std::vector<FarmRow>& rows);
std::string statusTable(const std::vector<FarmRow>& rows);
// A page of its own: no script, nothing from elsewhere. Same rows in, same bytes out.
std::string statusPage(const std::string& title, const std::vector<FarmRow>& rows);

}  // namespace tg
