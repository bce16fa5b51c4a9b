// SPDX-License-Identifier: Apache-2.0
// Text for people, JSON for programs, pictures for the eye.
#include "training/score/eval_report.h"

#include <algorithm>
#include <cstdio>
#include <iterator>
#include <nlohmann/json.hpp>

#include "core/image/color_map.h"
#include "core/system/assert.h"
#include "core/system/error.h"
#include "core/system/numbers.h"

namespace tg {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::size_t kWidestName = 48;
constexpr int kBarWidth = 50;
constexpr int kGap = 4;  // [px] between the pictures
constexpr float kGapGrey = 0.5f;

std::string numbers(const ViewScore& score) {
  std::string line = formatted("  %9.3f  %10.3f  %8.5f", score.psnr, score.psnr_float, score.ssim);
  if (score.flip) line += formatted("  %8.5f", *score.flip);
  if (score.lpips) line += formatted("  %8.5f", *score.lpips);
  return line;
}

void addNumbers(const ViewScore& score, Json& json) {
  json["psnr"] = score.psnr;
  json["psnr_float"] = score.psnr_float;
  json["ssim"] = score.ssim;
  if (score.flip) json["flip"] = *score.flip;
  if (score.lpips) json["lpips"] = *score.lpips;
}

// The mean of the views at seams, or of the others.
ViewScore meanOf(const std::vector<ViewScore>& scores, const std::vector<bool>& at_seams, bool seams) {
  std::vector<ViewScore> chosen;
  for (std::size_t i = 0; i < std::min(scores.size(), at_seams.size()); ++i) {
    if (at_seams[i] == seams) chosen.push_back(scores[i]);
  }
  return meanView(chosen);
}

std::size_t countOf(const EvalReport::Views& views, bool seams) {
  const auto end = views.seams->at_seams.begin() + static_cast<std::ptrdiff_t>(views.scores.size());
  return static_cast<std::size_t>(std::count(views.seams->at_seams.begin(), end, seams));
}

std::string seamLines(const EvalReport::Views& views) {
  std::string text;
  for (const bool seams : {true, false}) {
    const std::size_t count = countOf(views, seams);
    text += formatted("%s: %zu views", seams ? "at seams" : "inside blocks", count);
    if (count > 0) {
      const double psnr = meanOf(views.scores, views.seams->at_seams, seams).psnr;
      text += formatted(", %.3f dB", psnr);
      if (!views.seams->whole.empty()) {
        const double whole = meanOf(views.seams->whole, views.seams->at_seams, seams).psnr;
        text += formatted("; unsplit %.3f dB, so %+.3f dB", whole, psnr - whole);
      }
    }
    text += "\n";
  }
  return text;
}

Json seamsJson(const EvalReport::Views& views) {
  Json json;
  for (const bool seams : {true, false}) {
    const std::size_t count = countOf(views, seams);
    Json& part = json[seams ? "at_seams" : "inside"];
    part["views"] = count;
    if (count == 0) continue;
    part["psnr"] = meanOf(views.scores, views.seams->at_seams, seams).psnr;
    if (!views.seams->whole.empty()) {
      part["unsplit_psnr"] = meanOf(views.seams->whole, views.seams->at_seams, seams).psnr;
    }
  }
  return json;
}

Json ranksJson(const EffectiveRanks& ranks) {
  return {{"mean", ranks.mean},   {"needle", ranks.needle}, {"flat", ranks.flat},
          {"round", ranks.round}, {"first", 1.0},           {"bin_width", 2.0 / EffectiveRanks::kBins},
          {"bins", ranks.bins}};
}

}  // namespace

std::string formatScores(const EvalReport& report) {
  const EvalReport::Views& views = *report.views;
  std::vector<std::string> names;
  std::size_t width = 4;
  for (const ViewScore& score : views.scores) {
    names.push_back(printable(score.name));
    width = std::max(width, std::min(names.back().size(), kWidestName));
  }
  const auto cell = [&](const std::string& name) {
    return name + std::string(width - std::min(width, name.size()), ' ');
  };
  const ViewScore mean = meanView(views.scores);
  std::string text = cell("view") + "  PSNR [dB]  float [dB]      SSIM";
  if (mean.flip) text += "      FLIP";
  if (mean.lpips) text += "     LPIPS";
  text += "\n";
  for (std::size_t i = 0; i < names.size(); ++i) text += cell(names[i]) + numbers(views.scores[i]) + "\n";
  if (!views.scores.empty()) text += cell("mean") + numbers(mean) + "\n";
  text += formatted("%s split: %zu views, %zu Gaussians, %.3f M parameters, %ju bytes\n", views.split.c_str(),
                    views.scores.size(), report.gaussians, static_cast<double>(report.parameters) * 1e-6, report.bytes);
  if (mean.flip) text += formatted("FLIP at %.4g pixels per degree", views.options.pixels_per_degree);
  if (views.options.lpips) {
    text += formatted("%sLPIPS %s, input in %s", mean.flip ? "; " : "",
                      std::string(name(views.options.lpips->network())).c_str(),
                      std::string(name(views.options.lpips_range)).c_str());
  }
  if (mean.flip || views.options.lpips) text += "\n";
  if (views.seams) text += seamLines(views);
  if (views.scores.size() < views.asked) {
    text += formatted("interrupted: %zu of %zu views were scored\n", views.scores.size(), views.asked);
  }
  return text;
}

std::string formatRanks(const EffectiveRanks& ranks) {
  std::string text = "effective rank         share\n";
  const std::size_t highest = std::max<std::size_t>(*std::max_element(ranks.bins.begin(), ranks.bins.end()), 1);
  const double width = 2.0 / EffectiveRanks::kBins;
  for (int bin = 0; bin < EffectiveRanks::kBins; ++bin) {
    const std::size_t count = ranks.bins[static_cast<std::size_t>(bin)];
    const auto bar =
        static_cast<std::size_t>(static_cast<double>(count) / static_cast<double>(highest) * kBarWidth + 0.5);
    text += formatted("%.2f to %.2f  %12.2f %%", 1 + bin * width, 1 + (bin + 1) * width,
                      100.0 * static_cast<double>(count) / static_cast<double>(std::max<std::size_t>(ranks.count, 1)));
    text += (bar > 0 ? "  " + std::string(bar, '#') : "") + "\n";
  }
  text +=
      formatted("mean %.3f of %zu Gaussians: %.1f %% needles (below 1.5), %.1f %% flat, %.1f %% round (above 2.5)\n",
                ranks.mean, ranks.count, 100 * ranks.needle, 100 * ranks.flat, 100 * ranks.round);
  return text;
}

std::string formatEvalJson(const EvalReport& report) {
  Json json = {{"format", "tgeval"}, {"version", 1}};
  if (report.views) {
    json["dataset"] = report.views->dataset;
    json["split"] = report.views->split;
    json["device"] = report.views->device;
    const glm::vec3& background = report.views->background;
    json["background"] = {background.x, background.y, background.z};
    if (report.views->outside) json["outside"] = name(*report.views->outside);
  }
  json["gaussians"] = report.gaussians;
  json["texels"] = report.texels;
  json["parameters"] = report.parameters;
  json["bytes"] = report.bytes;
  if (report.views) {
    const EvalReport::Views& views = *report.views;
    if (views.options.flip) json["flip_pixels_per_degree"] = views.options.pixels_per_degree;
    if (views.options.lpips) {
      json["lpips_network"] = name(views.options.lpips->network());
      json["lpips_range"] = name(views.options.lpips_range);
    }
    json["interrupted"] = views.scores.size() < views.asked;
    addNumbers(meanView(views.scores), json);
    if (views.seams) json["blocks"] = seamsJson(views);
    json["views"] = Json::array();
    for (const ViewScore& score : views.scores) {
      Json view = {{"name", score.name}};
      addNumbers(score, view);
      json["views"].push_back(std::move(view));
    }
  }
  if (report.ranks) json["effective_rank"] = ranksJson(*report.ranks);
  return json.dump(1, ' ', false, Json::error_handler_t::replace) + "\n";
}

Image flipPicture(const Image& flip_map) {
  TG_ASSERT(flip_map.channels == 1, "a map has one number a pixel");
  Image picture(flip_map.width, flip_map.height, 3);
  for (std::size_t i = 0; i < flip_map.data.size(); ++i) {
    const glm::vec3 color = colorOf(ColorMap::magma, flip_map.data[i]);
    for (std::size_t c = 0; c < 3; ++c) picture.data[3 * i + c] = color[static_cast<glm::length_t>(c)];
  }
  return picture;
}

void requireSideBySide(glm::ivec2 view, const std::string& path) {
  const std::int64_t pixels = (std::int64_t{3} * view.x + 2 * kGap) * view.y;
  if (pixels <= kMaxImagePixels) return;
  throw Error(ErrorKind::cannotWrite, path,
              "three pictures of " + std::to_string(view.x) + " x " + std::to_string(view.y) +
                  " beside each other have too many pixels" +
                  atMost(static_cast<std::uint64_t>(kMaxImagePixels), static_cast<std::uint64_t>(pixels)));
}

Image sideBySide(const ViewPixels& photograph, const Image& picture, const Image& flip_map) {
  TG_ASSERT(picture.width == photograph.width && picture.height == photograph.height && picture.channels == 3,
            "the picture is the photograph's view");
  TG_ASSERT(flip_map.width == picture.width && flip_map.height == picture.height && flip_map.channels == 1,
            "the map is of the picture");
  Image result(3 * picture.width + 2 * kGap, picture.height, 3, kGapGrey);
  const Image truth = photograph.image();
  for (int y = 0; y < picture.height; ++y) {
    for (int x = 0; x < picture.width; ++x) {
      const bool counts =
          photograph.mask.empty() ||
          photograph.mask[static_cast<std::size_t>(y) * static_cast<std::size_t>(picture.width) + x] != 0;
      const glm::vec3 error = counts ? colorOf(ColorMap::magma, flip_map.at(x, y, 0)) : glm::vec3(kGapGrey);
      for (int c = 0; c < 3; ++c) {
        result.at(x, y, c) = truth.at(x, y, c);
        result.at(x + picture.width + kGap, y, c) = picture.at(x, y, c);
        result.at(x + 2 * (picture.width + kGap), y, c) = error[c];
      }
    }
  }
  return result;
}

}  // namespace tg
