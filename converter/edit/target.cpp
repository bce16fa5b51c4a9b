// SPDX-License-Identifier: Apache-2.0
// A file of a size, or of a likeness to its model.
#include "converter/edit/target.h"

#include <cmath>
#include <cstdio>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>

#include "converter/edit/quality.h"
#include "core/file/scratch_folder.h"
#include "core/model/fallback.h"
#include "core/model/verbs.h"
#include "core/system/assert.h"
#include "core/system/error.h"

namespace tg {

namespace {

constexpr double kNearSize = 0.99;  // of the bytes that are asked for

std::uint64_t write(const Format& format, const std::filesystem::path& file, const std::filesystem::path& name,
                    const Bundle& source, const WriteOptions& options) {
  std::error_code ignored;
  std::filesystem::remove(file, ignored);  // a trial replaces the last one, whatever outputs may do (KeepExisting)
  Written trial;
  writeTrial(format, file, name, source, options, trial);
  return trial.output_bytes > 0 ? trial.output_bytes : std::filesystem::file_size(file);
}

}  // namespace

void writeTrial(const Format& format, const std::filesystem::path& file, const std::filesystem::path& name,
                const Bundle& source, const WriteOptions& options, Written& written) {
  try {
    writeModel(format, file, source, options, written);
  } catch (const Error& error) {
    std::string said = error.what();
    const std::string folder = printable(file.parent_path().string()), hidden = printable(file.string());
    if (file == name || !said.starts_with(folder)) throw;
    const std::size_t path = said.find(": ", said.starts_with(hidden) ? hidden.size() : folder.size());
    // Not of models that no file holds, which are as wrong where they are to be.
    if (error.kind == ErrorKind::cannotWrite && path != std::string::npos &&
        said.substr(path).starts_with(": cannot ")) {
      throw Error(error.kind, file.parent_path().parent_path().string(),
                  said.substr(path + 2) + " (a trial of " + name.filename().string() + ", in the temporary folder)");
    }
    if (!said.starts_with(hidden)) throw;
    throw Error(error.kind, said.replace(0, hidden.size(), name.string()));
  }
}

float stepsFor(const Format& format, const std::filesystem::path& name, const Bundle& source,
               std::span<const Camera> views, WriteOptions options, const Target& target,
               const ConvertListener& listener) {
  TG_ASSERT(target.given(), "a target is given");
  TG_ASSERT(format.has_steps, "the format has steps");
  const ScratchFolder folder;
  const std::filesystem::path file = folder.path() / name.filename();
  options.replace = true;
  const bool by_size = target.bytes > 0;
  // An end, then halvings of nine octaves: steps of 2.5 %. For a size as far as 0.2 to 0.3 % while 1 % of it is free,
  // as bytes jump where steps of positions or rotations become the next power of 2.
  constexpr std::size_t kTrials = 9, kTrialsOfSize = 13;
  const std::size_t most = by_size ? kTrialsOfSize : kTrials;
  const double wanted = by_size ? static_cast<double>(target.bytes) : target.psnr;
  double reached = 0, fitting = 0;  // by the last trial, and by the finest file that is small enough
  std::size_t trials = 0;
  if (listener) listener(ConvertPart::target, trials, most);
  const auto isFineEnough = [&](double logarithm) {  // finer than a size allows, or no coarser than pictures do
    options.steps = static_cast<float>(std::exp2(logarithm));
    const std::uint64_t bytes = write(format, file, name, source, options);
    reached = by_size ? static_cast<double>(bytes)
                      : renderedPsnr(source.model, readModel(file).model, views, source.background);
    ++trials;
    if (listener) listener(ConvertPart::target, trials, most);
    if (by_size && reached <= wanted) fitting = reached;
    return by_size ? reached > wanted : reached >= wanted;
  };
  const double finest = std::log2(kLeastSteps);
  double fine = finest, coarse = std::log2(kMostSteps);
  if (by_size ? isFineEnough(coarse) : !isFineEnough(fine)) {
    const auto number = [&](double value) {
      char text[64];
      std::snprintf(text, sizeof(text), by_size ? "%.0f" : "%.1f", value);
      return std::string(text);
    };
    const std::string limit = number(reached), found = number(wanted);
    throw Error(ErrorKind::usage, name.string(),
                by_size ? "--target-size is out of reach" + expectedFound("at least " + limit + " bytes", found) +
                              ": fewer Gaussians or a lower SH degree take less"
                        : "--target-psnr is out of reach" + expectedFound("at most " + limit + " dB", found));
  }
  const auto isNear = [&] { return fitting >= kNearSize * wanted; };
  for (bool tried_finest = false; trials < kTrials || (trials < most && !isNear());) {
    if (by_size && fine == finest && coarse < 0 && !std::exchange(tried_finest, true)) {
      if (!isFineEnough(finest)) return kLeastSteps;
      continue;
    }
    const double middle = 0.5 * (fine + coarse);
    (isFineEnough(middle) ? fine : coarse) = middle;
  }
  return static_cast<float>(std::exp2(by_size ? coarse : fine));
}

Chosen chooseSteps(const Format& format, const std::filesystem::path& name, const Bundle& source,
                   std::span<const Camera> views, const WriteOptions& options, const Target& target,
                   const ConvertListener& listener) {
  if (target.psnr > 0 && showsNothing(source.model, views)) {
    throw Error(ErrorKind::usage, name.string(), "--target-psnr: " + std::string(kShowsNothing));
  }
  const auto search = [&](const Bundle& of) { return stepsFor(format, name, of, views, options, target, listener); };
  const bool has_choice = isTextured(source.model) && format.holds(kKeepsTextures) && !options.base;
  if (target.bytes == 0 || !has_choice || !isMeasuredUnasked(source.model)) return {.steps = search(source)};
  const auto reached = [&](const Bundle& of) -> std::optional<float> {
    try {
      return search(of);
    } catch (const Error& error) {
      if (error.kind != ErrorKind::usage) throw;
      return std::nullopt;
    }
  };
  const auto psnrTo = [&](const GaussianModel& model) {
    return renderedPsnr(source.model, model, views, source.background);
  };
  const auto psnrOf = [&](const Bundle& of, float steps) {
    const ScratchFolder folder;
    const std::filesystem::path file = folder.path() / name.filename();
    WriteOptions own = options;
    own.steps = steps;
    write(format, file, name, of, own);
    return psnrTo(readModel(file).model);
  };
  const Bundle bare = untextured(source);
  const std::optional<float> steps = reached(source);
  if (!steps) return {.steps = search(bare), .textured = false};
  const double psnr = psnrOf(source, *steps);
  if (psnr >= psnrTo(bare.model)) return {.steps = *steps};  // no steps bring the other one nearer
  const std::optional<float> bare_steps = reached(bare);
  if (bare_steps && psnrOf(bare, *bare_steps) > psnr) return {.steps = *bare_steps, .textured = false};
  return {.steps = *steps};
}

Bundle untextured(const Bundle& source) {
  Bundle bare = source;
  bare.model = bakeFallback(source.model, FallbackScale::fitted);
  return bare;
}

std::uint64_t bytesOf(const Format& format, const std::filesystem::path& name, const Bundle& source,
                      WriteOptions options) {
  const ScratchFolder folder;
  options.replace = true;
  return write(format, folder.path() / name.filename(), name, source, options);
}

}  // namespace tg
