// SPDX-License-Identifier: Apache-2.0
// One file to another: read, write, read back, compare.
#include "converter/convert.h"

#include "converter/fallback.h"
#include "converter/quality.h"
#include "converter/write_gltf.h"
#include "core/bundle.h"
#include "core/error.h"
#include "core/ply.h"

namespace tg {
namespace {

enum class OutputFormat { bundle, ply, glb };

OutputFormat outputFormat(const std::filesystem::path& path) {
  const std::string extension = path.extension().string();
  if (extension == ".glb") return OutputFormat::glb;
  if (extension == ".ply") return OutputFormat::ply;
  if (extension == ".tgz") return OutputFormat::bundle;
  throw Error(ErrorKind::usage, path.string(),
              "unknown output format (expected .glb, .ply or .tgz, found \"" + extension + "\")");
}

bool isTextured(const GaussianModel& model) {
  return model.texture_mode != TextureMode::none && !model.atlas.rects.empty();
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

void writeAs(OutputFormat format, const std::filesystem::path& output, const LoadedModel& source,
             ConvertReport& report) {
  switch (format) {
    case OutputFormat::glb: {
      const GltfReport gltf = writeGlb(output, {source.model, source.cameras, source.background});
      report.output_format = "glb";
      report.atlases = gltf.atlases;
      report.atlas_width = gltf.atlas_width;
      report.atlas_height = gltf.atlas_height;
      report.texels = gltf.texels;
      report.clipped_texels = gltf.clipped_texels;
      report.texture_mode = gltf.atlases > 0 ? name(source.model.texture_mode) : name(TextureMode::none);
      break;
    }
    case OutputFormat::ply:
      writeSplatPly(output, bakeFallback(source.model));
      report.output_format = "ply";
      report.texture_mode = name(TextureMode::none);
      if (!source.cameras.empty()) report.warnings.push_back("PLY holds no cameras: they are left out");
      break;
    case OutputFormat::bundle: {
      Bundle bundle;
      bundle.model = source.model;
      bundle.cameras = source.cameras;
      bundle.background = source.background;
      bundle.training_json = source.training_json;
      bundle.preview = source.preview;
      writeBundle(output, bundle);
      report.output_format = "tgz";
      report.texture_mode = name(source.model.texture_mode);
      break;
    }
  }
}

void measure(const std::filesystem::path& output, const LoadedModel& source, ConvertReport& report) {
  const std::vector<Camera> views = qualityViews(source.model, source.cameras);
  report.views = views.size();
  const LoadedModel written = readModel(output);
  const double psnr = renderedPsnr(source.model, written.model, views, source.background);
  if (!isTextured(source.model)) {
    report.textured_psnr = psnr;
    return;
  }
  if (report.output_format == "ply") {
    report.base_psnr = psnr;
    return;
  }
  report.textured_psnr = psnr;
  if (report.output_format == "glb") {
    ReadOptions base;
    base.base_only = true;
    report.base_psnr = renderedPsnr(source.model, readModel(output, base).model, views, source.background);
  }
}

}  // namespace

ConvertReport convert(const std::filesystem::path& input, const std::filesystem::path& output,
                      const ConvertOptions& options) {
  const OutputFormat format = outputFormat(output);
  checkOutput(output, options.overwrite);
  ReadOptions read_options;
  read_options.base_only = options.base_only;
  const LoadedModel source = readModel(input, read_options);

  ConvertReport report;
  report.input_format = source.format;
  report.input_bytes = std::filesystem::file_size(input);
  report.gaussians = source.model.size();
  report.sh_degree = source.model.sh_degree;
  report.cameras = format == OutputFormat::ply ? 0 : source.cameras.size();
  report.warnings = source.warnings;
  writeAs(format, output, source, report);
  report.output_bytes = std::filesystem::file_size(output);
  if (options.measure) measure(output, source, report);
  return report;
}

}  // namespace tg
