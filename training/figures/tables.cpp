// SPDX-License-Identifier: Apache-2.0
// Rows as CSV and LaTeX.
#include <cmath>

#include "core/system/numbers.h"
#include "training/figures/report.h"

namespace tg {
namespace {

std::string exact(double value) { return std::isinf(value) ? "inf" : numberText(value); }
std::string exact(const std::optional<double>& value) { return value ? exact(*value) : ""; }

std::string scores(const ViewScore& score) {
  return exact(score.psnr) + "," + exact(score.psnr_float) + "," + exact(score.ssim) + "," + exact(score.flip) + "," +
         exact(score.lpips);
}

constexpr const char* kScoreColumns = "psnr,psnr_float,ssim,flip,lpips";

// Which of the models' full rows has the best number, where there are two at least and numbers to compare.
std::vector<bool> best(const ReportedDataset& dataset, double (*badness)(const ViewScore&)) {
  std::vector<bool> result(dataset.models.size(), false);
  if (result.size() < 2) return result;
  std::vector<double> values;
  for (const ReportedModel& model : dataset.models) values.push_back(badness(meanView(model.full)));
  const double least = *std::min_element(values.begin(), values.end());
  for (std::size_t i = 0; i < values.size(); ++i) result[i] = values[i] == least;
  return result;
}

std::string cell(const std::string& text, bool bold) { return bold ? "\\textbf{" + text + "}" : text; }

void addModel(const ReportedDataset& dataset, std::size_t index, bool lpips, std::string& text) {
  static constexpr double (*kBadness[])(const ViewScore&) = {
      [](const ViewScore& s) { return -s.psnr; }, [](const ViewScore& s) { return -s.ssim; },
      [](const ViewScore& s) { return s.flip.value_or(0); }, [](const ViewScore& s) { return s.lpips.value_or(0); }};
  const ReportedModel& model = dataset.models[index];
  const auto row = [&](const std::string& name, const ViewScore& mean, bool full) {
    const auto winner = [&](std::size_t metric) { return full && best(dataset, kBadness[metric])[index]; };
    const std::string psnr = std::isinf(mean.psnr) ? "$\\infty$" : decibels(mean.psnr, 2);
    text += "  " + name + " & " + cell(psnr, winner(0)) + " & " + cell(formatted("%.4f", mean.ssim), winner(1)) +
            " & " + cell(formatted("%.4f", mean.flip.value_or(0)), winner(2));
    if (lpips) text += " & " + cell(mean.lpips ? formatted("%.4f", *mean.lpips) : "--", winner(3));
    if (full) {
      const ModelNumbers& n = model.numbers;
      text += " & " + grouped(n.gaussians, "\\,") + " & " + grouped(n.texels, "\\,") + " & " +
              formatted("%.3f", static_cast<double>(n.parameters) * 1e-6) + " & " +
              formatted("%.2f", static_cast<double>(n.bytes) * 1e-6);
    } else {
      text += " & & & &";
    }
    text += " \\\\\n";
  };
  row(latexText(model.label), meanView(model.full), true);
  if (!model.base.empty()) row("\\quad base only", meanView(model.base), false);
  if (!model.texture.empty()) row("\\quad texture only", meanView(model.texture), false);
}

}  // namespace

std::string decibels(double value, int decimals) {
  return std::isinf(value) ? "inf" : formatted("%.*f", decimals, value);
}

std::string grouped(std::uintmax_t number, const char* separator) {
  const std::string digits = std::to_string(number);
  std::string text;
  for (std::size_t i = 0; i < digits.size(); ++i) {
    if (i > 0 && (digits.size() - i) % 3 == 0) text += separator;
    text += digits[i];
  }
  return text;
}

std::string csvText(const std::string& text) {
  if (text.find_first_of(",\"\r\n") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? "\"\"" : std::string(1, c);
  return quoted + "\"";
}

std::string latexText(const std::string& text) {
  std::string result;
  for (const char c : text) {
    switch (c) {
      case '\\':
        result += "\\textbackslash{}";
        break;
      case '^':
        result += "\\textasciicircum{}";
        break;
      case '~':
        result += "\\textasciitilde{}";
        break;
      case '<':
        result += "\\textless{}";
        break;
      case '>':
        result += "\\textgreater{}";
        break;
      case '|':
        result += "\\textbar{}";
        break;
      case '"':
        result += "\\textquotedbl{}";
        break;
      // An option or a star of the line's end before it, and ligatures.
      case '[':
      case ']':
      case '*':
      case '-':
      case '`':
      case '\'':
        result += std::string("{") + c + "}";
        break;
      case '{':
      case '}':
      case '$':
      case '&':
      case '#':
      case '_':
      case '%':
        result += std::string("\\") + c;
        break;
      default:
        result += c;
    }
  }
  return result;
}

std::string formatCsv(const EvalComparison& report) {
  std::string text = std::string("dataset,split,model,part,views,") + kScoreColumns +
                     ",gaussians,textured,texels,parameters,bytes,effective_rank\n";
  for (const ReportRow& row : rowsOf(report)) {
    const ModelNumbers& n = row.model.numbers;
    text += csvText(row.dataset.name) + "," + row.dataset.split + "," + csvText(row.model.label) + "," + row.part +
            "," + std::to_string(row.model.full.size()) + "," + scores(row.mean) + "," + std::to_string(n.gaussians) +
            "," + std::to_string(n.textured) + "," + std::to_string(n.texels) + "," + std::to_string(n.parameters) +
            "," + std::to_string(n.bytes) + "," + numberText(n.ranks.mean) + "\n";
  }
  return text;
}

std::string formatViewsCsv(const EvalComparison& report) {
  std::string text = std::string("dataset,split,model,part,view,") + kScoreColumns + "\n";
  for (const ReportedDataset& dataset : report.datasets) {
    for (const ReportedModel& model : dataset.models) {
      const auto add = [&](const char* part, const std::vector<ViewScore>& views) {
        for (const ViewScore& view : views) {
          text += csvText(dataset.name) + "," + dataset.split + "," + csvText(model.label) + "," + part + "," +
                  csvText(displayText(view.name)) + "," + scores(view) + "\n";
        }
      };
      add("full", model.full);
      add("base only", model.base);
      add("texture only", model.texture);
    }
  }
  return text;
}

std::string formatLatex(const EvalComparison& report) {
  const bool lpips = !report.lpips.empty();
  std::string text =
      "% \\usepackage{booktabs}; letters beyond ASCII want LuaLaTeX or XeLaTeX, or a font that has them\n";
  text += std::string("\\begin{tabular}{lrrr") + (lpips ? "r" : "") + "rrrr}\n\\toprule\n";
  text += "Model & PSNR $\\uparrow$ & SSIM $\\uparrow$ & FLIP $\\downarrow$";
  if (lpips) text += " & LPIPS $\\downarrow$";
  text += " & Gaussians & Texels & Parameters [M] & MB \\\\\n";
  for (const ReportedDataset& dataset : report.datasets) {
    text += "\\midrule\n\\multicolumn{" + std::string(lpips ? "9" : "8") + "}{l}{\\emph{" + latexText(dataset.name) +
            "}, " + std::to_string(dataset.models.front().full.size()) + " views} \\\\\n";
    for (std::size_t i = 0; i < dataset.models.size(); ++i) addModel(dataset, i, lpips, text);
  }
  return text + "\\bottomrule\n\\end{tabular}\n";
}

}  // namespace tg
