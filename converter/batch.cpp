// SPDX-License-Identifier: Apache-2.0
// A folder of models to a folder of models.
#include "converter/batch.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <new>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <system_error>

#include "converter/registry/file_format.h"
#include "core/file/file.h"
#include "core/file/json.h"
#include "core/system/error.h"
#include "core/system/lower_case.h"

namespace tg {
namespace {

bool isNamedAsModel(const std::filesystem::path& path) {
  const std::string name = lowerCase(path.filename().string());
  return std::ranges::any_of(formats(), [&](const Format& format) {
    return format.read && !format.names_others && name.ends_with(extensionOf(format));
  });
}

// By content or by name: what cannot be read, is empty or holds something else says so when its turn comes, and is not
// passed over.
bool isModel(const std::filesystem::path& path) {
  try {
    return !detectFormat(path).is_common || isNamedAsModel(path);
  } catch (const Error&) {
    return isNamedAsModel(path);
  }
}

// The name without its format: of a.compressed.ply, too, which a.ply is not to become.
std::string stemOf(const std::filesystem::path& model) {
  const std::string name = model.filename().string();
  std::size_t extension = model.extension().string().size();
  for (const Format& format : formats()) {
    const std::string ending = "." + std::string(format.name);
    if (lowerCase(name).ends_with(ending) && name.size() > ending.size())
      extension = std::max(extension, ending.size());
  }
  return name.substr(0, name.size() - extension);
}

// Where each goes: to its name without its format, or, where several would be that, with as much of it as the file
// system calls the stem.
std::vector<BatchItem> itemsOf(const std::vector<std::filesystem::path>& models, const std::filesystem::path& output,
                               const std::string& extension) {
  std::multiset<std::string> stems;
  for (const std::filesystem::path& model : models) stems.insert(stemOf(model));
  std::set<std::filesystem::path> outputs;
  std::vector<BatchItem> items;
  for (const std::filesystem::path& model : models) {
    const std::string longer = model.stem().string() + "." + extension;
    const bool apart = stems.count(stemOf(model)) > 1 && outputFormat(longer).name == extension;
    BatchItem& item = items.emplace_back();
    item.input = model;
    item.output = output / (apart ? longer : stemOf(model) + "." + extension);
    if (!outputs.insert(placeOfOutput(item.output)).second) {
      throw Error(ErrorKind::usage, model.string() + ": two models would become " + item.output.string());
    }
  }
  return items;
}

}  // namespace

std::vector<std::filesystem::path> modelsIn(const std::filesystem::path& folder) {
  std::vector<std::filesystem::path> models;
  std::error_code error;
  for (std::filesystem::directory_iterator entry(folder, error); !error && entry != end(entry);
       entry.increment(error)) {
    const bool hidden = entry->path().filename().string().starts_with('.');  // such as temporary files
    std::error_code unknown;                                                 // of a link that leads nowhere
    if (!hidden && !entry->is_directory(unknown) && isModel(entry->path())) models.push_back(entry->path());
  }
  if (error) throw Error(ErrorKind::cannotRead, folder.string(), "cannot be read: " + error.message());
  if (models.empty()) throw Error(ErrorKind::cannotRead, folder.string(), "holds no model");
  std::sort(models.begin(), models.end());
  return models;
}

BatchReport convertFolder(const std::filesystem::path& input, const std::filesystem::path& output,
                          const std::string& extension, const ConvertOptions& options,
                          const std::function<void(const BatchProgress&)>& progress) {
  BatchReport report;
  std::uint64_t total = 0;
  report.items = itemsOf(modelsIn(input), output, extension);
  const auto sizeOf = [](const BatchItem& item) -> std::uint64_t {  // for the progress
    std::error_code missing;
    const std::uintmax_t bytes = std::filesystem::file_size(item.input, missing);
    return missing ? 0 : bytes;
  };
  requireOpened(outputFormat(report.items.front().output), options);
  for (const BatchItem& item : report.items) total += sizeOf(item);
  std::error_code error;
  if (!options.dry_run) std::filesystem::create_directories(output, error);
  if (error) throw Error(ErrorKind::cannotWrite, output.string(), "cannot be made: " + error.message());
  std::uint64_t read = 0;
  for (std::size_t i = 0; i < report.items.size(); ++i) {
    BatchItem& item = report.items[i];
    progress({i, report.items.size(), printable(item.input.filename().string()),
              static_cast<double>(read) / static_cast<double>(std::max<std::uint64_t>(total, 1))});
    const auto failed = [&](ErrorKind kind, const std::string& what) {
      const std::string input_name = printable(item.input.string());
      const bool named = what.starts_with(input_name) || what.starts_with(printable(item.output.string()));
      item.error = named ? what : input_name + ": " + what;
      if (report.exit_code == 0) report.exit_code = static_cast<int>(kind);
    };
    try {
      item.report = convert(item.input, item.output, options);
    } catch (const Error& e) {
      failed(e.kind, e.what());
    } catch (const std::bad_alloc&) {
      failed(ErrorKind::device, "the model does not fit into memory");
    }
    read += sizeOf(item);
  }
  return report;
}

std::string describe(const BatchReport& report) {
  std::string text;
  std::size_t failures = 0;
  const bool dry_run = std::ranges::any_of(report.items, [](const BatchItem& item) { return item.report.dry_run; });
  std::uint64_t before = 0, after = 0;
  for (const BatchItem& item : report.items) {
    text += printable(item.input.filename().string()) + ": ";
    if (!item.error.empty()) {
      ++failures;
      text += "failed: " + item.error + "\n";
      continue;
    }
    before += item.report.input_bytes;
    after += item.report.output_bytes;
    char line[160];
    std::snprintf(line, sizeof(line), "%zu Gaussians, %llu -> %llu bytes", item.report.gaussians,
                  static_cast<unsigned long long>(item.report.input_bytes),
                  static_cast<unsigned long long>(item.report.output_bytes));
    text += line;
    const std::optional<double> psnr = item.report.textured_psnr ? item.report.textured_psnr : item.report.base_psnr;
    if (psnr && std::isinf(*psnr)) text += ", identical";
    if (psnr && !std::isinf(*psnr)) {
      std::snprintf(line, sizeof(line), ", %.2f dB", *psnr);
      text += line;
    }
    if (!item.report.warnings.empty()) text += ", " + std::to_string(item.report.warnings.size()) + " warnings";
    text += "\n";
  }
  return text + std::to_string(report.items.size() - failures) +
         (dry_run ? " models would be written, " : " models written, ") + std::to_string(failures) + " failed, " +
         std::to_string(before) + " -> " + std::to_string(after) + " bytes\n";
}

std::string describeJson(const BatchReport& report) {
  using Json = nlohmann::ordered_json;
  Json list = Json::array();
  for (const BatchItem& item : report.items) {
    Json entry = {{"input", item.input.string()}, {"output", item.output.string()}};
    if (item.error.empty()) {
      entry["report"] = Json::parse(describeJson(item.report));
    } else {
      entry["error"] = item.error;
    }
    list.push_back(std::move(entry));
  }
  return dumpJson(Json{{"format", "tgconvert-batch"}, {"version", 1}, {"models", std::move(list)}}, 2) + "\n";
}

}  // namespace tg
