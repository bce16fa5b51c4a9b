// SPDX-License-Identifier: Apache-2.0
// A folder that appears whole.
#include <cstdlib>
#include <filesystem>
#include <optional>
#include <regex>
#include <string>

#include "core/file/file.h"
#include "core/system/error.h"
#include "training/figures/report.h"

namespace tg {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void refuse(const fs::path& path, const std::string& problem) {
  throw Error(ErrorKind::cannotWrite, path.string(), problem);
}

// The name without a slash at its end.
fs::path named(const fs::path& folder) {
  const fs::path whole = folder.lexically_normal();
  return whole.has_filename() ? whole : whole.parent_path();
}

// A folder beside another one, for what becomes it, and gone at the end.
class HiddenFolder {
 public:
  explicit HiddenFolder(const fs::path& beside) {
    std::string name = (beside.parent_path() / ("." + beside.filename().string() + "-XXXXXX")).string();
    if (::mkdtemp(name.data()) == nullptr) refuse(beside, "cannot make a folder beside it: " + systemReason());
    path_ = name;
  }
  ~HiddenFolder() {
    std::error_code ignored;
    if (!kept_) fs::remove_all(path_, ignored);
  }
  HiddenFolder& operator=(HiddenFolder&&) = delete;
  const fs::path& path() const { return path_; }
  void keep() { kept_ = true; }

 private:
  fs::path path_;
  bool kept_ = false;
};

// What is in a folder and not a report's; none where all of it is.
std::optional<fs::path> stranger(const fs::path& folder) {
  static const std::regex ours(
      R"((index\.html|results\.csv|views\.csv|table\.tex|[a-z]+-[0-9]+\.svg|crops(/.*\.png)?))");
  for (const fs::directory_entry& entry :
       fs::recursive_directory_iterator(folder, fs::directory_options::skip_permission_denied)) {
    if (!std::regex_match(entry.path().lexically_relative(folder).string(), ours)) return entry.path();
  }
  return std::nullopt;
}

}  // namespace

void requireReportFolder(const fs::path& folder, bool overwrite) {
  const fs::path name = named(folder);
  if (name.filename().empty() || name.filename() == "." || name.filename() == "..") {
    refuse(folder, "expected the name of a folder to make");
  }
  std::error_code code;
  const fs::file_status status = fs::symlink_status(name, code);
  if (fs::exists(status)) {
    if (!fs::is_directory(status)) refuse(name, "exists already, and is no folder");
    if (!fs::is_empty(name, code) && !code) {
      if (!overwrite) refuse(name, "exists already (--overwrite replaces it)");
      const std::optional<fs::path> other = stranger(name);
      if (other) refuse(*other, "is not of a report, whose folder would be replaced");
    }
  }
  const HiddenFolder possible(name);
}

void writeReportFolder(const fs::path& folder, bool overwrite, const std::vector<ReportFile>& files) {
  requireReportFolder(folder, overwrite);  // whatever has come since the work began
  const fs::path name = named(folder);
  HiddenFolder hidden(name);
  const fs::path fresh = hidden.path() / "fresh", before = hidden.path() / "before";
  std::error_code code;
  for (const ReportFile& file : files) {
    const fs::path path = fresh / file.name;
    fs::create_directories(path.parent_path(), code);
    if (code) refuse(name, "cannot write: " + code.message());
    writeFileAtomically(path, file.bytes);
  }
  const bool replaces = fs::exists(name, code);
  if (replaces) fs::rename(name, before, code);
  if (!code) {
    fs::rename(fresh, name, code);
    if (code && replaces) {
      std::error_code lost;
      fs::rename(before, name, lost);
      if (lost) {
        hidden.keep();
        refuse(name, "cannot name the finished report: " + code.message() + "; the one before is " + before.string());
      }
    }
  }
  if (code) refuse(name, "cannot name the finished report: " + code.message());
}

}  // namespace tg
