// SPDX-License-Identifier: Apache-2.0
// Says what is wrong with a file, and where.
#include "converter/check.h"

#include <nlohmann/json.hpp>
#include <unordered_map>
#include <unordered_set>
#include <utility>

#include "converter/registry/file_format.h"
#include "core/file/json.h"
#include "core/system/error.h"

namespace tg {
namespace {

using Json = nlohmann::ordered_json;

// "path: /a/b: what" and "/a/b: what" taken apart.
Finding findingOf(std::string text, const std::string& path) {
  if (text.rfind(path + ": ", 0) == 0) text.erase(0, path.size() + 2);
  const std::size_t end = text.find(": ");
  if (text.empty() || text[0] != '/' || end == std::string::npos) return {"", text};
  return {text.substr(0, end), text.substr(end + 2)};
}

// Lines that differ by numbers alone, as those of one rule at many places do, are one.
std::string kindOf(const std::string& line) {
  std::string kind;
  for (const char c : line) {
    const bool digit = c >= '0' && c <= '9';
    if (!digit) kind += c;
    if (digit && !kind.ends_with('#')) kind += '#';
  }
  return kind;
}

// Each line once, and each kind, in order.
std::vector<Finding> findingsOf(const std::vector<std::string>& lines, const std::string& path) {
  std::vector<Finding> findings;
  std::unordered_set<std::string> known;
  std::unordered_map<std::string, std::size_t> kinds;
  for (const std::string& line : lines) {
    Finding finding = findingOf(line, path);
    if (!known.insert(finding.pointer + ": " + finding.message).second) continue;
    const auto [kind, first] = kinds.try_emplace(kindOf(finding.pointer + ": " + finding.message), findings.size());
    if (first) {
      findings.push_back(std::move(finding));
    } else {
      ++findings[kind->second].more;
    }
  }
  return findings;
}

// What is found, as lines "pointer: message", perhaps after the file's name.
struct Lines {
  std::vector<std::string> errors, warnings;

  void addErrors(const std::vector<std::string>& added) { errors.insert(errors.end(), added.begin(), added.end()); }
  void addWarnings(const std::vector<std::string>& added) {
    warnings.insert(warnings.end(), added.begin(), added.end());
  }
};

void tryRead(const Format& format, const std::filesystem::path& path, bool base_only, CheckReport& report,
             Lines& lines) {
  std::vector<std::string> errors;  // of a glTF file, more than one
  try {
    Bundle loaded = format.read(path, {.base_only = base_only, .errors = &errors});
    report.gaussians = loaded.model.size();
    lines.addErrors(loaded.repairs);
    lines.addWarnings(loaded.warnings);
  } catch (const Error& error) {
    if (error.kind != ErrorKind::badData) throw;
    if (errors.empty()) errors.push_back(error.what());
  }
  lines.addErrors(errors);
}

Json toJson(const std::vector<Finding>& findings) {
  Json list = Json::array();
  for (const Finding& finding : findings) {
    Json entry = {{"pointer", finding.pointer}, {"message", finding.message}};
    if (finding.more > 0) entry["more"] = finding.more;
    list.push_back(std::move(entry));
  }
  return list;
}

}  // namespace

CheckReport checkFile(const std::filesystem::path& path) {
  CheckReport report;
  report.file = path.string();
  Lines lines;
  const auto attempt = [&](const auto& step) {
    try {
      step();
    } catch (const Error& error) {
      if (error.kind != ErrorKind::badData) throw;
      lines.addErrors({error.what()});
    }
  };
  const Format* format = nullptr;
  attempt([&] { format = &detectFormat(path); });
  if (format) report.format = format->name;
  std::vector<std::string> broken, repairs;  // broken: files, each of which counts
  if (format && format->overlooked) {
    attempt([&] {
      Overlooked found = format->overlooked(path);
      broken = std::move(found.broken);
      repairs = std::move(found.repairs);
      lines.addWarnings(found.warnings);
    });
  }
  const bool sound = broken.empty() && lines.errors.empty();  // else reading would say the first of them
  if (format && format->check) {
    attempt([&] { report.gaussians = format->check(path, lines.errors, lines.warnings); });
  } else if (format && sound) {
    tryRead(*format, path, true, report, lines);
    if (format->has_base) tryRead(*format, path, false, report, lines);
  }
  lines.addErrors(repairs);
  report.errors = findingsOf(lines.errors, report.file);
  for (const std::string& line : broken) report.errors.push_back(findingOf(line, report.file));
  report.warnings = findingsOf(lines.warnings, report.file);
  return report;
}

std::string describe(const CheckReport& report) {
  std::string text;
  const auto add = [&](const char* severity, const Finding& finding) {
    text += std::string(severity) + ": " + (finding.pointer.empty() ? "" : finding.pointer + ": ") + finding.message;
    if (finding.more > 0) text += " (and " + std::to_string(finding.more) + " more of this kind)";
    text += "\n";
  };
  for (const Finding& finding : report.errors) add("error", finding);
  for (const Finding& finding : report.warnings) add("warning", finding);
  const auto counted = [](std::size_t count, const char* what) {
    return ", " + std::to_string(count) + " " + what + (count == 1 ? "" : "s");
  };
  text += report.file + ": " + (report.errors.empty() ? "valid" : "not valid") +
          counted(report.errors.size(), "error") + counted(report.warnings.size(), "warning") + "\n";
  return text;
}

std::string describeJson(const CheckReport& report) {
  const Json json = {{"format", "tgconvert-check"},
                     {"version", 1},
                     {"file", report.file},
                     {"file_format", report.format},
                     {"valid", report.errors.empty()},
                     {"gaussians", report.gaussians},
                     {"errors", toJson(report.errors)},
                     {"warnings", toJson(report.warnings)}};
  return dumpJson(json, 2) + "\n";
}

}  // namespace tg
