// SPDX-License-Identifier: Apache-2.0
// tgeval --report: several models on several data sets.
#pragma once
#include <atomic>
#include <span>
#include <string>
#include <vector>

#include "training/score_model.h"

namespace tg {

// The models of a data set, in the order of the command line.
struct EvalGroup {
  std::vector<std::string> models;
  std::string dataset;  // a folder; empty: none was named after the last models
};
// Each folder is the data set of the models before it, back to the folder before. Throws Error(usage) for a folder
// without models.
std::vector<EvalGroup> groupsOf(std::span<const std::string> arguments);

// Scores all views with all models and writes the report; prints the means. A set `stop` ends after the view at hand
// and reports what was scored. Throws Error of every kind; then there is no report.
void compareModels(const EvalOptions& options, std::span<const EvalGroup> groups, const std::atomic<bool>& stop);

}  // namespace tg
