// SPDX-License-Identifier: Apache-2.0
// One file to another: read, write, read back, compare.
#include "converter/convert.h"

#include <stdlib.h>

#include <memory>
#include <optional>
#include <string>
#include <system_error>
#include <utility>

#include "converter/edit/quality.h"
#include "converter/formats/gaussian_blocks.h"
#include "converter/formats/repair.h"
#include "converter/formats/write_splat.h"
#include "converter/formats/write_spz.h"
#include "converter/gltf/fallback.h"
#include "converter/gltf/write_atlas.h"
#include "converter/gltf/write_gltf.h"
#include "converter/html/write_html.h"
#include "converter/registry/file_format.h"
#include "core/bundle/bundle.h"
#include "core/bundle/ply.h"
#include "core/model/verbs.h"
#include "core/system/error.h"

namespace tg {
namespace {

enum class OutputFormat { bundle, ply, splat, spz, glb, gltf, html, png };

// Rendering holds both models, and what both renderers make of them.
constexpr std::uint64_t kMeasuredBytes = std::uint64_t{1} << 29;

OutputFormat outputFormat(const std::filesystem::path& path) {
  const std::string extension = path.extension().string();
  if (extension == ".glb") return OutputFormat::glb;
  if (extension == ".html") return OutputFormat::html;
  if (extension == ".gltf") return OutputFormat::gltf;
  if (extension == ".png") return OutputFormat::png;
  if (extension == ".ply") return OutputFormat::ply;
  if (extension == ".splat") return OutputFormat::splat;
  if (extension == ".spz") return OutputFormat::spz;
  if (extension == ".tgz") return OutputFormat::bundle;
  throw Error(ErrorKind::usage, path.string(),
              "unknown output format (expected .glb, .gltf, .html, .ply, .png, .splat, .spz or .tgz, found \"" +
                  extension + "\")");
}

void checkOutput(const std::filesystem::path& output, bool overwrite) {
  std::error_code status;
  if (std::filesystem::is_directory(output, status)) {
    throw Error(ErrorKind::cannotWrite, output.string(), "is a folder (expected a file)");
  }
  if (!overwrite && std::filesystem::exists(output, status)) {
    throw Error(ErrorKind::cannotWrite, output.string(), "exists already (--overwrite replaces it)");
  }
}

GltfReport writeScene(OutputFormat format, const std::filesystem::path& output, const GltfContent& content) {
  switch (format) {
    case OutputFormat::gltf:
      return writeGltf(output, content);
    case OutputFormat::html:
      return writeHtml(output, content);
    case OutputFormat::png:
      return writeAtlas(output, content);
    default:
      return writeGlb(output, content);
  }
}

void writeScene(OutputFormat format, const std::filesystem::path& output, const GltfContent& content,
                ConvertReport& report) {
  const GltfReport gltf = writeScene(format, output, content);
  report.output_format = output.extension().string().substr(1);
  report.output_bytes = gltf.bytes;
  if (gltf.dropped_source) {
    report.warnings.push_back("a GLB ends at 4 GiB: the numbers that bring a .ply back bit by bit are left out");
  }
  report.atlases = gltf.atlases;
  report.atlas_width = gltf.atlas_width;
  report.atlas_height = gltf.atlas_height;
  report.texels = gltf.texels;
  report.clipped_texels = gltf.clipped_texels;
  report.texture_mode = gltf.atlases > 0 ? name(content.model.texture_mode) : name(TextureMode::none);
}

// What a format without textures holds.
template <typename Write>
auto writeBase(const GaussianModel& model, const Write& write) {
  return isTextured(model) ? write(bakeFallback(model)) : write(model);
}

// The source is as it was afterwards; on an error, it is not.
void writeAs(OutputFormat format, const std::filesystem::path& output, Bundle& source,
             const ConvertOptions& options, ConvertReport& report) {
  switch (format) {
    case OutputFormat::png:
    case OutputFormat::glb:
    case OutputFormat::gltf:
    case OutputFormat::html:
      writeScene(format, output,
                 {source.model, source.cameras, source.background, options.lean, options.atlas, options.quantize,
                  options.meshopt, options.overwrite || options.dry_run},
                 report);
      break;
    case OutputFormat::ply:
      writeBase(source.model, [&](const GaussianModel& base) { writeSplatPly(output, base); });
      report.output_format = "ply";
      report.texture_mode = name(TextureMode::none);
      if (!source.cameras.empty()) report.warnings.push_back("PLY holds no cameras: they are left out");
      break;
    case OutputFormat::splat: {
      const SplatReport splat =
          writeBase(source.model, [&](const GaussianModel& base) { return writeSplat(output, base); });
      report.output_format = "splat";
      report.texture_mode = name(TextureMode::none);
      if (!source.cameras.empty()) report.warnings.push_back(".splat holds no cameras: they are left out");
      if (splat.dropped_sh) report.warnings.push_back(".splat holds no SH: colours are those of degree 0");
      warnRepair(report.warnings, splat.clipped_colors, "with a colour outside 0 to 255: clipped");
      break;
    }
    case OutputFormat::spz: {
      const SpzReport spz = writeBase(source.model, [&](const GaussianModel& base) { return writeSpz(output, base); });
      report.output_format = "spz";
      report.texture_mode = name(TextureMode::none);
      if (!source.cameras.empty()) report.warnings.push_back("SPZ holds no cameras: they are left out");
      warnRepair(report.warnings, spz.clipped_scales, "with a scale outside SPZ's e^-10 to e^5.94: clipped");
      warnRepair(report.warnings, spz.clipped_colors, "with a colour outside SPZ's range: clipped");
      warnRepair(report.warnings, spz.clipped_sh, "with SH coefficients outside [-1, 1]: clipped");
      break;
    }
    case OutputFormat::bundle: {
      Bundle bundle;
      bundle.model = std::move(source.model);  // and back: twice in memory is once too often
      bundle.cameras = source.cameras;
      bundle.background = source.background;
      bundle.training_json = source.training_json;
      bundle.preview = source.preview;
      writeBundle(output, bundle);
      source.model = std::move(bundle.model);
      report.output_format = "tgz";
      report.texture_mode = name(source.model.texture_mode);
      break;
    }
  }
}

// A folder for one file, gone afterwards.
class TemporaryFolder {
 public:
  TemporaryFolder() {
    std::string name = (std::filesystem::temp_directory_path() / "tgconvert-XXXXXX").string();
    if (::mkdtemp(name.data()) == nullptr) throw Error(ErrorKind::cannotWrite, name, "cannot make a temporary folder");
    path_ = name;
  }
  ~TemporaryFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;

  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

void measure(const std::filesystem::path& output, const Bundle& source, ConvertReport& report) {
  const std::vector<Camera> views = qualityViews(source.model, source.cameras);
  report.views = views.size();
  const Bundle written = readModel(output);
  if (written.model.texture_mode == source.model.texture_mode || !isTextured(source.model)) {
    report.deviation = deviationOf(source.model, written.model);
  }
  const double psnr = renderedPsnr(source.model, written.model, views, source.background);
  if (!isTextured(source.model)) {
    report.textured_psnr = psnr;
    return;
  }
  if (report.output_format == "ply" || report.output_format == "splat" || report.output_format == "spz") {
    report.base_psnr = psnr;
    return;
  }
  report.textured_psnr = psnr;
  const bool has_base =
      report.output_format == "glb" || report.output_format == "gltf" || report.output_format == "html";
  if (has_base) {
    ReadOptions base;
    base.base_only = true;
    report.base_psnr = renderedPsnr(source.model, readModel(output, base).model, views, source.background);
  }
}

// Whether what is written may look otherwise than the model: not by the last bits of its numbers.
bool changesPictures(const GaussianModel& model, OutputFormat format, const ConvertOptions& options) {
  return isTextured(model) || format == OutputFormat::splat || format == OutputFormat::spz || options.quantize;
}

// The input, where it can be converted without being a model in between.
std::unique_ptr<const SplatPlyFile> streamed(const std::filesystem::path& input, OutputFormat format,
                                             const ConvertOptions& options) {
  const bool scene = format == OutputFormat::glb || format == OutputFormat::gltf;
  const bool rendered =
      options.measure == Measure::always || (options.measure == Measure::automatic && options.quantize);
  if (!scene || !options.edits.empty() || options.meshopt || (rendered && !options.dry_run)) return nullptr;
  if (detectFormat(input) != FileFormat::ply) return nullptr;
  auto file = std::make_unique<const SplatPlyFile>(input);
  return file->rows().plain() ? std::move(file) : nullptr;
}

}  // namespace

ConvertReport convert(const std::filesystem::path& input, const std::filesystem::path& output,
                      const ConvertOptions& options) {
  const OutputFormat format = outputFormat(output);
  if (!options.dry_run) checkOutput(output, options.overwrite);
  ConvertReport report;
  std::error_code unknown;
  const std::uintmax_t bytes = std::filesystem::file_size(input, unknown);
  report.input_bytes = unknown ? 0 : bytes;  // what cannot be read says so below
  report.dry_run = options.dry_run;
  // Calls write(file) for the output, or for a forecast: the exact size comes from the exact bytes, which are written
  // where nobody looks.
  const auto writeTo = [&](const auto& write) {
    const std::optional<TemporaryFolder> folder =
        options.dry_run ? std::optional<TemporaryFolder>(std::in_place) : std::nullopt;
    const std::filesystem::path file = folder ? folder->path() / ("forecast" + output.extension().string()) : output;
    write(file);
    if (report.output_bytes == 0) report.output_bytes = std::filesystem::file_size(file);
  };
  if (const auto file = streamed(input, format, options)) {
    GaussianModel none;
    const FileBlocks blocks(*file, input);
    report.input_format = name(FileFormat::ply);
    report.gaussians = blocks.size();
    report.sh_degree = blocks.shDegree();
    GltfContent content = {none, {}};
    content.lean = options.lean;
    content.quantize = options.quantize;
    content.replace = options.overwrite || options.dry_run;
    content.gaussians = &blocks;
    writeTo([&](const std::filesystem::path& to) { writeScene(format, to, content, report); });
    return report;
  }

  ReadOptions read_options;
  read_options.base_only = options.base_only;
  Bundle source = readModel(input, read_options);
  const bool small = bytesOf(source.model) <= kMeasuredBytes;
  const bool measured =
      !options.dry_run && (options.measure == Measure::always || (options.measure == Measure::automatic && small));
  report.edits = applyEdits(source, options.edits, measured);
  report.input_format = source.format;
  report.gaussians = source.model.size();
  report.sh_degree = source.model.sh_degree;
  const bool keeps_cameras = format != OutputFormat::ply && format != OutputFormat::splat &&
                             format != OutputFormat::spz && format != OutputFormat::png;
  report.cameras = keeps_cameras ? source.cameras.size() : 0;
  report.warnings = source.warnings;
  const bool changes = changesPictures(source.model, format, options);
  if (changes && !measured && !options.dry_run && options.measure == Measure::automatic) {
    report.warnings.push_back(
        "not rendered for the summary, which takes several times the model's memory (--psnr does)");
  }
  writeTo([&](const std::filesystem::path& to) { writeAs(format, to, source, options, report); });
  if (measured && format != OutputFormat::png && (changes || options.measure == Measure::always)) {
    measure(output, source, report);
  }
  return report;
}

}  // namespace tg
