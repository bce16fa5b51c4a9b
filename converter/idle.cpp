// SPDX-License-Identifier: Apache-2.0
// Options of a conversion that do nothing.
#include "converter/idle.h"

#include <algorithm>
#include <string_view>

#include "core/system/error.h"

namespace tg {
namespace {

// Options that shape a file, and of which formats.
struct ShapingOption {
  std::string_view name;
  bool (*shapes)(const Format& format);
};
constexpr ShapingOption kShapingOptions[] = {
    {"--no-cameras", [](const Format& format) { return format.holds(kKeepsCameras); }},
    {"--lean", [](const Format& format) { return format.is_gltf && format.name != "html"; }},  // which always is
    {"--quantize", [](const Format& format) { return format.is_gltf; }},
    {"--meshopt", [](const Format& format) { return format.is_gltf; }},
    {"--atlas", [](const Format& format) { return format.is_gltf || format.name == "png"; }},
    {"--steps", [](const Format& format) { return format.has_steps; }},
    {"--target-size", [](const Format& format) { return format.has_steps; }},
    {"--target-psnr", [](const Format& format) { return format.has_steps; }},
    {"--texture-step", [](const Format& format) { return format.has_steps; }},
    {"--views", [](const Format& format) { return format.is_gltf; }},
    {"--spz-version", [](const Format& format) { return format.name == "spz"; }},
    {"--for",
     [](const Format& format) { return format.name != "tgz" && format.name != "html" && format.name != "png"; }},
};

[[noreturn]] void refuseIdleOption(std::string_view name, const std::string& formats) {
  throw Error(ErrorKind::usage, std::string(name) + " does nothing here: it is only for " + formats);
}

// What cannot be told apart suits: it says so itself, later.
bool suits(const std::filesystem::path& input, bool (*suited)(const Format& format)) {
  try {
    return suited(detectFormat(input));
  } catch (const Error&) {
    return true;
  }
}

}  // namespace

std::vector<std::string> basedNames() {
  std::vector<std::string> names;
  for (const Format& format : formats()) {
    if (format.has_base) names.push_back(extensionOf(format));
  }
  return names;
}

void refuseIdle(const std::set<std::string>& given, const Format* output,
                const std::function<std::vector<std::filesystem::path>()>& inputs, const ConvertOptions& options) {
  if (given.contains("--for-aim") && !given.contains("--for")) refuseIdleOption("--for-aim", "--for");
  if (given.contains("--dry-run") && given.contains("--psnr")) {
    throw Error(ErrorKind::usage, "--psnr does nothing beside --dry-run, which writes nothing");
  }
  for (const ShapingOption& option : kShapingOptions) {
    if (output == nullptr || !given.contains(std::string(option.name)) || option.shapes(*output)) continue;
    std::vector<std::string> names;
    for (const Format& format : formats()) {
      if (format.write && option.shapes(format)) names.push_back(extensionOf(format));
    }
    refuseIdleOption(option.name, listed(names));
  }
  if (output && !output->read && given.contains("--psnr") && options.edits.empty()) {
    throw Error(ErrorKind::usage, "--psnr does nothing here: a ." + std::string(output->name) +
                                      " is not read again, and no edit is compared");
  }
  if (output && output->name == "html" && options.atlas == AtlasFormat::exr) {
    throw Error(ErrorKind::usage, "--atlas: a page reads no EXR (expected png8, png16 or webp, found \"exr\")");
  }
  if (!given.contains("--spz-axes") && !given.contains("--base-only")) return;
  std::vector<std::filesystem::path> files = inputs();
  for (const Edit& edit : options.edits) {
    if (edit.option == "--merge") files.emplace_back(edit.value);
  }
  const auto reads = [&](bool (*suited)(const Format& format)) {
    return std::ranges::any_of(files, [&](const std::filesystem::path& file) { return suits(file, suited); });
  };
  if (given.contains("--spz-axes") && !reads([](const Format& format) { return format.name == "spz"; })) {
    refuseIdleOption("--spz-axes", "an .spz that is read");
  }
  if (given.contains("--base-only") && !reads([](const Format& format) { return format.has_base; })) {
    refuseIdleOption("--base-only", "a " + listed(basedNames()) + " that is read");
  }
}

}  // namespace tg
