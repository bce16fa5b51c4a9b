// SPDX-License-Identifier: Apache-2.0
// One file to another: read, write, read back, compare.
#include "converter/convert.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include "converter/formats/gaussian_blocks.h"
#include "converter/gltf/document.h"
#include "converter/html/html.h"
#include "converter/lod/lod_scene.h"
#include "core/bundle/splat_rows.h"
#include "core/bundle/training_json.h"
#include "core/file/atomic_files.h"
#include "core/file/scratch_folder.h"
#include "core/model/float_steps.h"
#include "core/model/verbs.h"
#include "core/system/error.h"
#include "core/system/median.h"

namespace tg {
namespace {

void checkOutput(const Format& format, const std::filesystem::path& output, bool overwrite) {
  std::error_code status;
  if (std::filesystem::is_directory(output, status)) {
    throw Error(ErrorKind::cannotWrite, output.string(), "is a folder (expected a file)");
  }
  if (!overwrite && std::filesystem::exists(output, status)) {
    throw Error(ErrorKind::cannotWrite, output.string(), "exists already (--overwrite replaces it)");
  }
  requireOneFolder(format, output);
}

void measure(const Format& format, const std::filesystem::path& output, const Bundle& source,
             std::span<const Camera> views, ConvertReport& report) {
  report.views = views.size();
  const Bundle written = readModel(output);
  if (!report.adapted) {  // whose numbers are others on purpose
    const bool lost = isTextured(source.model) && !isTextured(written.model);
    const GaussianModel base = lost ? untextured(source).model : GaussianModel();
    const GaussianModel& expected = lost ? base : source.model;
    report.deviation = deviationOf(report.order.empty() ? expected : select(expected, report.order), written.model);
  }
  const bool only_base = isTextured(source.model) && !format.holds(kKeepsTextures);
  (only_base ? report.base_psnr : report.textured_psnr) =
      renderedPsnr(source.model, written.model, views, source.background);
  if (isTextured(source.model) && !only_base && format.has_base) {
    report.base_psnr =
        renderedPsnr(source.model, readModel(output, {.base_only = true}).model, views, source.background);
  }
  const bool alike = std::isinf(report.textured_psnr.value_or(report.base_psnr.value_or(0)));
  if (!alike || !showsNothing(source.model, views)) return;
  report.views = 0;
  report.textured_psnr = report.base_psnr = std::nullopt;
  report.warnings.emplace_back(std::string(kShowsNothing) + ": they are not compared");
}

// Edits may leave means where floats are too far apart for what they show; what is compared is rounded already.
void warnOfCoarseMeans(const GaussianModel& model, ConvertReport& report) {
  std::vector<float> far, sigmas;
  for (std::size_t i = 0; i < model.size(); ++i) {
    const glm::vec3 place = glm::abs(model.mean[i]);
    const glm::vec3 scale = model.log_scale[i];
    far.push_back(std::max({place.x, place.y, place.z}));
    sigmas.push_back(std::exp(glm::max(glm::min(scale.x, scale.y), glm::min(glm::max(scale.x, scale.y), scale.z))));
  }
  const std::string coarse = coarseFloats(medianOf(far), medianOf(sigmas));
  if (!coarse.empty()) report.warnings.push_back("means " + coarse + ", and are rounded to that");
}

// Whether numbers are rounded to steps because somebody asked for it.
bool isInSteps(const Format& format, const ConvertOptions& options) {
  return format.has_steps && (options.steps || options.target.given());
}

// Whether what is written may look otherwise than the model: not by the last bits of its numbers.
bool changesPictures(const GaussianModel& model, const Format& format, const ConvertOptions& options) {
  return isTextured(model) || !format.holds(kKeepsFloats) || options.quantize || options.viewer ||
         isInSteps(format, options) || losesIntersection(format, model);
}

constexpr const char* kIdleTextureStep = "--texture-step does nothing: the model has no textures";

// The input, where it can be converted without being a model in between.
std::unique_ptr<const SplatPlyFile> streamed(const std::filesystem::path& input, const Format& format,
                                             const ConvertOptions& options) {
  const bool rendered =
      options.measure == Measure::always || (options.measure == Measure::automatic && options.quantize);
  const bool whole = !options.edits.empty() || options.meshopt || options.viewer || isInSteps(format, options);
  if (!format.streams || whole || (rendered && !options.dry_run)) return nullptr;
  if (detectFormat(input).name != "ply") return nullptr;
  auto file = std::make_unique<const SplatPlyFile>(input);
  return file->rows().plain() ? std::move(file) : nullptr;
}

// Whether the output is a page that streams the input rather than one that holds it: levels of detail of which nothing
// is to be changed.
bool isStreamingPage(const std::filesystem::path& input, const Format& format, const ConvertOptions& options) {
  const bool changed = !options.edits.empty() || options.base_only || options.viewer || options.target.given() ||
                       options.steps || options.texture_step || options.quantize || options.meshopt ||
                       !options.views.empty() || !options.cameras || options.atlas != ConvertOptions().atlas;
  return format.name == "html" && isLodMeta(input) && !changed;
}

void writePageBeside(const std::filesystem::path& input, const std::filesystem::path& output, ConvertReport& report) {
  const LodScene scene = readLodScene(input);
  report.input_format = kLodMetaName;
  report.gaussians = scene.counts.front();
  report.input_bytes = storedBytes(*findFormat(report.input_format), input);
  report.sh_degree = scene.sh_degree.value_or(0);
  report.cameras = readLodCameras(scene, lodFolderReader(input), report.warnings).size();
  report.texture_mode = name(scene.texture_mode);
  report.warnings.emplace_back("the page holds no model: it streams " + input.filename().string() +
                               " from the server that both lie on");
  const std::optional<ScratchFolder> folder =
      report.dry_run ? std::optional<ScratchFolder>(std::in_place) : std::nullopt;
  const std::filesystem::path file = folder ? folder->path() / output.filename() : output;
  requireSameFolder(output, "the scene's address is as seen from there");
  writeStreamingHtml(file, addressFrom(output, input));
  report.output_bytes = std::filesystem::file_size(file);
}

// What a .gltf that is there refers to beside it; nothing of what is none.
std::vector<std::string> besideOlder(const Format& format, const std::filesystem::path& output) {
  std::error_code ignored;
  if (format.name != "gltf" || !std::filesystem::is_regular_file(output, ignored)) return {};
  try {
    return gltfFilesBeside(output);
  } catch (const Error&) {
    return {};
  }
}

// Of `names` beside an earlier file what the new one at `output` does not refer to.
void warnOfLeft(const std::vector<std::string>& names, const std::filesystem::path& output,
                std::vector<std::string>& warnings) {
  const std::vector<std::string> own = gltfFilesBeside(output);
  for (const std::string& name : names) {
    std::error_code ignored;
    const bool there = std::filesystem::is_regular_file(output.parent_path() / name, ignored);
    if (!there || name == output.filename() || std::ranges::binary_search(own, name)) continue;
    warnings.push_back(name + " stays beside " + output.filename().string() + ", which referred to it before");
  }
}

bool opens(const ViewerProfile& viewer, const Format& format) {
  return std::ranges::find(viewer.opens, format.name) != viewer.opens.end();
}

int newestSpz(const ConvertOptions& options) {
  return options.viewer ? std::min(kNewestSpz, profileOf(*options.viewer).newest_spz) : kNewestSpz;
}

// Of the source what is written where it is made for a viewer; `base` lives as long as the options.
Bundle adaptedBundle(const Bundle& source, const ConvertOptions& asked, const Format& format, GaussianModel& base,
                     WriteOptions& options, ConvertReport& report) {
  if (isTextured(source.model) && format.holds(kKeepsTextures) && !format.is_gltf) {
    const bool opens_glb = opens(profileOf(*asked.viewer), *findFormat("glb"));
    throw Error(ErrorKind::usage, "--for: a ." + std::string(format.name) +
                                      " has one base for textures and viewers (expected " +
                                      (opens_glb ? ".glb, .gltf or " : "") + "--no-textures)");
  }
  Adapted adapted = adaptTo(*asked.viewer, source, format.is_gltf, asked.aim, asked.listener);
  report.adapted = adapted.report;
  if (isTextured(source.model) && !format.holds(kKeepsTextures)) report.warnings.push_back(lostTextures(format));
  Bundle written = source;
  written.model = std::move(adapted.model);
  base = std::move(adapted.base);
  options.parts = std::move(adapted.parts);
  if (base.size() > 0) options.base = &base;
  return written;
}

}  // namespace

void requireOpened(const Format& format, const ConvertOptions& options) {
  if (!options.viewer) return;
  const ViewerProfile& viewer = profileOf(*options.viewer);
  const auto refuse = [&](const std::string& what) {
    throw Error(ErrorKind::usage,
                "--for " + std::string(name(*options.viewer)) + ": " + std::string(viewer.program) + " opens " + what);
  };
  if (!opens(viewer, format)) {
    std::vector<std::string> known;
    for (const std::string_view other : viewer.opens) known.push_back(extensionOf(*findFormat(other)));
    refuse("no " + extensionOf(format) + " (expected " + listed(known) + ")");
  }
  const bool packed = options.meshopt || isInSteps(format, options);
  if (format.is_gltf && packed && !viewer.opens_meshopt) {
    refuse("no " + extensionOf(format) + " packed by EXT_meshopt_compression (expected no " +
           (options.meshopt ? "--meshopt"
            : options.steps ? "--steps"
                            : "target") +
           ")");
  }
  if (format.name == "spz" && options.spz_version && *options.spz_version > viewer.newest_spz) {
    refuse("no .spz of version " + std::to_string(*options.spz_version) + " (expected " +
           std::to_string(viewer.newest_spz) + ")");
  }
}

ConvertReport convert(const std::filesystem::path& input, const std::filesystem::path& output,
                      const ConvertOptions& options) {
  const Format& format = outputFormat(output);
  requireOpened(format, options);
  if (options.target.given() && !format.has_steps) {
    throw Error(ErrorKind::usage, output.string(), "a target is only for .sog, .glb, .gltf and .html");
  }
  if (!options.dry_run) checkOutput(format, output, options.overwrite);
  const std::vector<std::string> beside_older =
      options.dry_run ? std::vector<std::string>() : besideOlder(format, output);
  ConvertReport report;
  report.dry_run = options.dry_run;
  report.output_format = format.name;
  WriteOptions write_options{.lean = options.lean,
                             .atlas = options.atlas,
                             .quantize = options.quantize,
                             .meshopt = options.meshopt,
                             .steps = options.steps,
                             .texture_step = options.texture_step,
                             .spz_version = options.spz_version.value_or(newestSpz(options)),
                             .replace = options.overwrite || options.dry_run};
  // To the output, or for a forecast: the exact size comes from the exact bytes, which are written where nobody looks.
  const auto write = [&](const Bundle& source) {
    const std::optional<ScratchFolder> folder =
        options.dry_run ? std::optional<ScratchFolder>(std::in_place) : std::nullopt;
    const KeepExisting no_other_run(!options.overwrite && !options.dry_run);
    const std::filesystem::path file = folder ? folder->path() / output.filename() : output;
    writeTrial(format, file, output, source, write_options, report);
    if (report.output_bytes == 0) report.output_bytes = std::filesystem::file_size(file);
    if (!beside_older.empty()) warnOfLeft(beside_older, output, report.warnings);
  };
  if (isStreamingPage(input, format, options)) {
    if (options.measure == Measure::always) {
      throw Error(ErrorKind::usage, output.string(),
                  "nothing is measured: the page holds no model, but streams it (expected no PSNR)");
    }
    const KeepExisting no_other_run(!options.overwrite && !options.dry_run);
    writePageBeside(input, output, report);
    return report;
  }
  if (const auto file = streamed(input, format, options)) {
    const FileBlocks blocks(*file, input.string());
    const ConvertReport before = report;
    report.input_format = "ply";
    report.input_bytes = storedBytes(*findFormat(report.input_format), input);
    report.gaussians = blocks.size();
    report.sh_degree = blocks.shDegree();
    if (options.texture_step) report.warnings.emplace_back(kIdleTextureStep);
    file->rows().warn(report.warnings);
    write_options.gaussians = &blocks;
    try {
      Bundle beside;
      beside.knows_background = false;
      beside.views = options.views;
      write(beside);
      return report;
    } catch (const BrokenRows&) {
      report = before;
      write_options.gaussians = nullptr;
    }
  }

  Bundle source = readModel(input, {.base_only = options.base_only, .spz_axes = options.spz_axes});
  if (options.cameras && !options.dry_run) requireStorable(format, output, source.cameras);
  if (wasInterrupted(source.training_json)) source.warnings.emplace_back(kInterruptedTraining);
  const bool small = isMeasuredUnasked(source.model);
  const bool measured =
      !options.dry_run && (options.measure == Measure::always || (options.measure == Measure::automatic && small));
  if (!options.views.empty() || !options.cameras) source.views = options.views;
  report.edits = applyEdits(source, options.edits, measured);
  report.input_format = source.format;
  report.input_axes = source.axes;
  report.input_bytes = storedBytes(*findFormat(source.format), input);
  report.gaussians = source.model.size();
  report.sh_degree = format.holds(kKeepsSh) ? source.model.sh_degree : 0;
  // Pictures are compared from the source's cameras also where they are not written.
  const std::vector<Camera> views =
      measured || options.target.given() ? qualityViews(source.model, source.cameras) : std::vector<Camera>();
  report.warnings = source.warnings;
  if (!options.edits.empty()) warnOfCoarseMeans(source.model, report);
  if (options.texture_step && !isTextured(source.model)) report.warnings.emplace_back(kIdleTextureStep);
  const bool changes = changesPictures(source.model, format, options);
  if (changes && !measured && !options.dry_run && options.measure == Measure::automatic) {
    report.warnings.push_back(
        "not rendered for the summary, which takes several times the model's memory (--psnr does)");
  }
  GaussianModel base;
  std::optional<Bundle> adapted;
  if (options.viewer) adapted = adaptedBundle(source, options, format, base, write_options, report);
  if (!options.cameras) (adapted ? *adapted : source).cameras.clear();
  const Bundle* written = adapted ? &*adapted : &source;
  report.cameras = format.holds(kKeepsCameras) ? written->cameras.size() : 0;
  report.gaussians = written->model.size();
  std::optional<Bundle> bare;
  if (options.target.given()) {
    const Chosen chosen = chooseSteps(format, output, *written, views, write_options, options.target, options.listener);
    write_options.steps = chosen.steps;
    if (!chosen.textured) {
      bare = untextured(*written);
      written = &*bare;
      report.warnings.emplace_back(
          "written without textures: in so few bytes that is nearer to the model, or all that fits");
    }
  }
  if (format.has_steps) report.steps = write_options.steps;
  write(*written);
  if (report.output_bytes < options.target.bytes && report.steps == kLeastSteps) {
    report.warnings.emplace_back("the finest steps take " + std::to_string(report.output_bytes) + " bytes");
  }
  if (measured && format.read && (changes || options.measure == Measure::always)) {
    measure(format, output, source, views, report);
  }
  return report;
}

}  // namespace tg
