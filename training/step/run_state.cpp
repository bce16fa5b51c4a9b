// SPDX-License-Identifier: Apache-2.0
// The order of views and the running mean.
#include "training/step/run_state.h"

#include <iterator>

#include "core/system/assert.h"

namespace tg {
namespace {

// By stage; the plain one always has a report.
constexpr std::optional<StageReport> TrainReport::* kReports[] = {&TrainReport::count, nullptr, &TrainReport::textured,
                                                                  &TrainReport::untextured, &TrainReport::quantized};
static_assert(std::size(kReports) == kCount<Stage>);

}  // namespace

const StageReport* reportOf(const TrainReport& report, Stage stage) {
  const auto member = kReports[static_cast<std::size_t>(stage)];
  if (!member) return &report.plain;
  return report.*member ? &*(report.*member) : nullptr;
}

void setReport(TrainReport& report, Stage stage, const StageReport& of) {
  if (const auto member = kReports[static_cast<std::size_t>(stage)]) {
    report.*member = of;
  } else {
    report.plain = of;
  }
}

std::size_t ViewOrder::next() {
  TG_ASSERT(!views.empty(), "there is a view to go to");
  TG_ASSERT(position < views.size(), "the position is among the views");
  if (position == 0) random.shuffle(views);
  const std::size_t view = views[position];
  position = static_cast<std::uint32_t>((position + 1) % views.size());
  return view;
}

std::optional<std::size_t> ViewOrder::following() const {
  TG_ASSERT(position == 0 || position < views.size(), "the position is among the views");
  return position == 0 ? std::nullopt : std::optional<std::size_t>(views[position]);
}

void RunningMean::add(double value) {
  constexpr double kPast = 0.98;  // about 50 views
  sum = kPast * sum + value;
  weight = kPast * weight + 1;
}

}  // namespace tg
