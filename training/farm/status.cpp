// SPDX-License-Identifier: Apache-2.0
// The same cells twice: with spaces between them, and with tags.
#include "training/farm/status.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cstddef>
#include <filesystem>
#include <string_view>
#include <system_error>

#include "core/run/curves.h"
#include "core/run/live.h"
#include "core/system/error.h"
#include "core/system/numbers.h"
#include "training/figures/report.h"

namespace tg {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kColumns = 7;
using Cells = std::array<std::string, kColumns>;
constexpr std::array<std::string_view, kColumns> kHeads = {
    "job", "state", "attempts", "iteration", "PSNR", "left", "worker, and why it failed"};

std::string attemptsOf(const JobView& view) {
  std::string text = std::to_string(view.attempts);
  if (view.failures > 0) text += ", " + std::to_string(view.failures) + " failed";
  if (view.deaths > 0) text += ", " + std::to_string(view.deaths) + " died";
  return text;
}

Cells cellsOf(const FarmRow& row) {
  const JobView& view = row.view;
  Cells cells = {row.job, std::string(name(view.state)), attemptsOf(view), "", "", "", view.worker};
  if (row.now) {
    cells[3] = row.now->stage + " " + std::to_string(row.now->iteration) + " / " + std::to_string(row.now->iterations);
    if (view.state == JobState::taken && !row.silence && row.now->seconds_left)
      cells[5] = formatSeconds(*row.now->seconds_left);
  }
  if (row.test_psnr) cells[4] = formatted("%.2f dB", *row.test_psnr);
  if (view.failure) {
    const Failure& failure = *view.failure;
    cells[6] = (failure.worker.empty() ? "" : failure.worker + ", ") + "exit code " + std::to_string(failure.code) +
               ": " + failure.words;
  }
  if (row.silence) cells[6] += (cells[6].empty() ? "" : ", ") + ("no sign of life for " + formatSeconds(*row.silence));
  for (std::string& cell : cells) cell = printable(cell);
  return cells;
}

// [s] None where it is being removed.
std::optional<double> silenceOf(const fs::path& attempt) {
  std::error_code error;
  fs::file_time_type last = fs::last_write_time(attempt / "beat", error);
  if (error) last = fs::last_write_time(attempt, error);  // died before the first
  if (error) return std::nullopt;
  return std::chrono::duration<double>(fs::file_time_type::clock::now() - last).count();
}

}  // namespace

std::vector<FarmRow> rowsOf(const FarmFolder& farm, double stale) {
  std::vector<FarmRow> rows;
  for (const FarmJob& job : farm.jobs()) {
    FarmRow& row = rows.emplace_back();
    row.job = job.name;
    row.view = farm.look(job.name);
    const fs::path attempt = farm.attempt(job.name, row.view.attempts);
    if (row.view.state == JobState::taken) row.silence = silenceOf(attempt);
    if (row.silence && *row.silence < stale) row.silence.reset();
    const fs::path run = row.view.state == JobState::done ? farm.result(job.name) : attempt / "run";
    MetricsFile metrics(run / kMetricsName);
    metrics.update();
    for (const RunMetrics& line : metrics.lines()) {
      row.now = line;
      if (line.test_psnr) row.test_psnr = line.test_psnr;
    }
  }
  return rows;
}

std::string summaryOf(const std::vector<FarmRow>& rows) {
  const auto count = [&](JobState state) {
    return std::ranges::count(rows, state, [](const FarmRow& row) { return row.view.state; });
  };
  std::string text = std::to_string(count(JobState::done)) + " of " + std::to_string(rows.size()) + " done";
  for (const JobState state : {JobState::taken, JobState::open, JobState::failed}) {
    if (count(state) > 0) text += ", " + std::to_string(count(state)) + " " + std::string(name(state));
    const auto dead = std::ranges::count_if(rows, [](const FarmRow& row) { return row.silence.has_value(); });
    if (state == JobState::taken && dead > 0) text += " (" + std::to_string(dead) + " by the dead)";
  }
  return text;
}

std::string statusTable(const std::vector<FarmRow>& rows) {
  std::vector<Cells> lines(1);
  std::ranges::copy(kHeads, lines[0].begin());
  for (const FarmRow& row : rows) lines.push_back(cellsOf(row));
  std::array<std::size_t, kColumns> widths{};
  for (const Cells& cells : lines) {
    for (std::size_t i = 0; i < kColumns; ++i) widths[i] = std::max(widths[i], cells[i].size());
  }
  std::string text;
  for (const Cells& cells : lines) {
    std::string line;
    for (std::size_t i = 0; i < kColumns; ++i) line += cells[i] + std::string(widths[i] - cells[i].size() + 2, ' ');
    text += line.substr(0, line.find_last_not_of(' ') + 1) + "\n";
  }
  return text;
}

std::string statusPage(const std::string& title, const std::vector<FarmRow>& rows) {
  std::string page =
      "<!doctype html>\n<html lang=\"en\"><meta charset=\"utf-8\">"
      "<meta name=\"viewport\" content=\"width=device-width\"><title>" +
      htmlText(title) + "</title>\n" +
      R"(<style>:root{color-scheme:light dark}
body{margin:16px auto;max-width:1120px;padding:0 16px;font:16px/1.45 system-ui,sans-serif}
.wide{overflow-x:auto}table{border-collapse:collapse;width:100%;font-variant-numeric:tabular-nums}
th,td{padding:6px 10px;text-align:left;border-top:1px solid #8886}
.done td:nth-child(2){color:#1a7f37}.failed td:nth-child(2){color:#d1242f;font-weight:700}
@media (prefers-color-scheme:dark){.done td:nth-child(2){color:#4ac26b}.failed td:nth-child(2){color:#ff7b72}}
</style>
<h1>)" +
      htmlText(title) + "</h1>\n<p>" + htmlText(summaryOf(rows)) + "</p>\n<div class=\"wide\"><table>\n<thead><tr>";
  for (const std::string_view head : kHeads) page += "<th>" + std::string(head) + "</th>";
  page += "</tr></thead>\n<tbody>\n";
  for (const FarmRow& row : rows) {
    page += "<tr class=\"" + std::string(name(row.view.state)) + "\">";
    for (const std::string& cell : cellsOf(row)) page += "<td>" + htmlText(cell) + "</td>";
    page += "</tr>\n";
  }
  return page + "</tbody></table></div>\n</html>\n";
}

}  // namespace tg
