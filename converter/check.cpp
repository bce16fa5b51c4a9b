// SPDX-License-Identifier: Apache-2.0
// Says what is wrong with a file, and where.
#include "converter/check.h"

#include <algorithm>
#include <nlohmann/json.hpp>
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

void addAll(std::vector<Finding>& findings, const std::vector<std::string>& messages, const std::string& path) {
  for (const std::string& message : messages) {
    Finding finding = findingOf(message, path);
    const bool known = std::ranges::any_of(
        findings, [&](const Finding& f) { return f.pointer == finding.pointer && f.message == finding.message; });
    if (!known) findings.push_back(std::move(finding));
  }
}

void tryRead(const Format& format, const std::filesystem::path& path, bool base_only, CheckReport& report) {
  std::vector<std::string> errors;  // of a glTF file, more than one
  try {
    Bundle loaded = format.read(path, {.base_only = base_only, .errors = &errors});
    report.gaussians = loaded.model.size();
    addAll(report.warnings, loaded.warnings, report.file);
  } catch (const Error& error) {
    if (error.kind != ErrorKind::badData) throw;
    if (errors.empty()) errors.push_back(error.what());
    addAll(report.errors, errors, report.file);
  }
}

Json toJson(const std::vector<Finding>& findings) {
  Json list = Json::array();
  for (const Finding& finding : findings) list.push_back({{"pointer", finding.pointer}, {"message", finding.message}});
  return list;
}

}  // namespace

CheckReport checkFile(const std::filesystem::path& path) {
  CheckReport report;
  report.file = path.string();
  const auto attempt = [&](const auto& step) {
    try {
      step();
    } catch (const Error& error) {
      if (error.kind != ErrorKind::badData) throw;
      addAll(report.errors, {error.what()}, report.file);
    }
  };
  const Format* format = nullptr;
  attempt([&] { format = &detectFormat(path); });
  if (!format) return report;
  report.format = format->name;
  tryRead(*format, path, true, report);
  if (!format->overlooked) return report;
  tryRead(*format, path, false, report);
  std::vector<std::string> errors, warnings;
  attempt([&] { format->overlooked(path, errors, warnings); });
  addAll(report.errors, errors, report.file);
  addAll(report.warnings, warnings, report.file);
  return report;
}

std::string describe(const CheckReport& report) {
  std::string text;
  const auto add = [&](const char* severity, const Finding& finding) {
    text +=
        std::string(severity) + ": " + (finding.pointer.empty() ? "" : finding.pointer + ": ") + finding.message + "\n";
  };
  for (const Finding& finding : report.errors) add("error", finding);
  for (const Finding& finding : report.warnings) add("warning", finding);
  text += report.file + ": " + (report.errors.empty() ? "valid" : "not valid") + ", " +
          std::to_string(report.errors.size()) + " errors, " + std::to_string(report.warnings.size()) + " warnings\n";
  return text;
}

std::string describeJson(const CheckReport& report) {
  const Json json = {
      {"file", report.file},           {"format", report.format},         {"valid", report.errors.empty()},
      {"gaussians", report.gaussians}, {"errors", toJson(report.errors)}, {"warnings", toJson(report.warnings)}};
  return dumpJson(json, 2) + "\n";
}

}  // namespace tg
