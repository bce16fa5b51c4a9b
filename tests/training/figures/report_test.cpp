// SPDX-License-Identifier: Apache-2.0
// A report's files: what they say, what they escape, and that they appear together or not at all.
#include "training/figures/report.h"

#include <algorithm>
#include <fstream>
#include <limits>
#include <sstream>

#include "core/image/drawn.h"
#include "core/image/image.h"
#include "core/model/verbs.h"
#include "core/system/error.h"
#include "support/catch.h"
#include "support/scenes.h"
#include "support/temporary_folder.h"

using namespace tg;
namespace fs = std::filesystem;

namespace {

ViewScore score(const std::string& name, double psnr) { return {name, psnr, psnr + 0.01, 0.9, 0.05, std::nullopt}; }

Crop crop() {
  const Image picture(4, 4, 3, 0.5f), error(4, 4, 1, 0.25f);
  return {"r_1", {{8, 4}, {4, 4}}, false, 0.25, picture, {picture, picture}, {error, error}, picture};
}

EvalComparison sample(const std::string& label = "textured") {
  const GaussianModel model = test::makeScene(test::SceneKind::mixed, 3).model;
  EvalComparison report;
  ReportedModel plain{"plain", numbersOf(withoutTextures(model), 1234), {score("r_0", 30), score("r_1", 28)}, {}, {}};
  ReportedModel textured{label, numbersOf(model, 56789), {score("r_0", 31), score("r_1", 29.5)}, {}, {}};
  textured.base = {score("r_0", 20), score("r_1", 21)};
  textured.texture = {score("r_0", 10), score("r_1", 11)};
  report.datasets.push_back({"scene", "test", 2, {plain, textured}, {crop()}});
  return report;
}

std::string text(const std::vector<ReportFile>& files, const std::string& name) {
  const auto file = std::ranges::find(files, name, &ReportFile::name);
  REQUIRE(file != files.end());
  return {file->bytes.begin(), file->bytes.end()};
}

std::string read(const fs::path& path) {
  std::ifstream file(path);
  std::stringstream text;
  text << file.rdbuf();
  return text.str();
}

}  // namespace

TEST_CASE("a model's numbers count every Gaussian once in each histogram") {
  const GaussianModel model = test::makeScene(test::SceneKind::mixed, 3).model;
  const ModelNumbers numbers = numbersOf(model, 99);
  const auto sum = [](const auto& bins) {
    std::size_t total = 0;
    for (const std::size_t count : bins) total += count;
    return total;
  };
  CHECK(numbers.gaussians == model.size());
  CHECK(sum(numbers.opacity) == model.size());
  CHECK(sum(numbers.scale) == 3 * model.size());
  CHECK(sum(numbers.texel_counts) == model.size());
  CHECK(numbers.texel_counts[0] == model.size() - numbers.textured);
  CHECK(numbers.textured > 0);
  CHECK(numbers.bytes == 99);
  GaussianModel one = select(model, std::vector<std::uint32_t>{0});
  one.opacity_logit[0] = 100;
  one.log_scale[0] = {std::log(0.00105f), 200, -200};
  one.atlas = {};
  const ModelNumbers ends = numbersOf(one, 0);
  CHECK(ends.opacity.back() == 1);
  CHECK(ends.scale[40] == 1);  // four decades above the first bin
  CHECK(ends.scale.front() == 1);
  CHECK(ends.scale.back() == 1);
  CHECK(ends.texel_counts[0] == 1);
}

TEST_CASE("a report has a row for each model and each part of a textured one") {
  const std::vector<ReportFile> files = reportFiles(sample());
  const std::string csv = text(files, "results.csv");
  CHECK(std::count(csv.begin(), csv.end(), '\n') == 5);
  CHECK_THAT(csv, Contains("scene,test,plain,full,2,29,") && Contains("scene,test,textured,full,2,30.25,") &&
                      Contains("scene,test,textured,base only,2,20.5,") &&
                      Contains("scene,test,textured,texture only,2,10.5,"));
  const std::string views = text(files, "views.csv");
  CHECK(std::count(views.begin(), views.end(), '\n') == 9);
  CHECK_THAT(views, Contains("scene,test,textured,full,r_1,29.5,"));
  for (const char* name : {"psnr-1.svg", "difference-1.svg", "opacity-1.svg", "scale-1.svg", "rank-1.svg",
                           "texels-1.svg", "crops/1-1-view.png", "crops/1-1-photograph.png", "crops/1-1-model-2.png",
                           "crops/1-1-flip-2.png", "index.html"}) {
    INFO(name);
    const auto file = std::ranges::find(files, name, &ReportFile::name);
    REQUIRE(file != files.end());
    CHECK(isDrawn(file->bytes) == std::string_view(name).ends_with(".png"));
  }
  const std::vector<ReportFile> again = reportFiles(sample());
  REQUIRE(again.size() == files.size());
  for (std::size_t i = 0; i < files.size(); ++i) CHECK(again[i].bytes == files[i].bytes);
}

TEST_CASE("LaTeX is of booktabs, names the best, and escapes what TeX reads") {
  const std::string latex = formatLatex(sample());
  CHECK_THAT(latex, Contains("\\toprule") && Contains("\\bottomrule") && Contains("\\textbf{30.25}") &&
                        Contains("\\quad texture only & 10.50 &") && !Contains("LPIPS"));
  // Every row has as many cells as the table has columns.
  std::istringstream lines(latex);
  for (std::string line; std::getline(lines, line);) {
    if (!line.ends_with("\\\\") || line.starts_with("\\multicolumn")) continue;
    INFO(line);
    CHECK(std::count(line.begin(), line.end(), '&') == 7);
  }
  CHECK(latexText("a_b%c#d$e&f{g}h\\i^j~k") ==
        "a\\_b\\%c\\#d\\$e\\&f\\{g\\}h\\textbackslash{}i\\textasciicircum{}j\\textasciitilde{}k");
  CHECK(latexText("[1]*") == "{[}1{]}{*}");
  EvalComparison equal = sample();
  for (ViewScore& view : equal.datasets[0].models[0].full) view.psnr = std::numeric_limits<double>::infinity();
  CHECK_THAT(formatLatex(equal), Contains("$\\infty$"));
  CHECK_THAT(formatCsv(equal), Contains(",inf,"));
  CHECK_THAT(text(reportFiles(equal), "index.html"), Contains("∞"));
  equal.lpips = "vgg, input in [-1,1]";
  for (ReportedModel& model : equal.datasets[0].models) {
    for (std::vector<ViewScore>* part : {&model.full, &model.base, &model.texture}) {
      for (ViewScore& view : *part) view.lpips = 0.25;
    }
  }
  CHECK_THAT(formatLatex(equal), Contains("LPIPS $\\downarrow$") && Contains("0.2500"));
}

TEST_CASE("names of files and folders are text in every format, whatever they hold") {
  CHECK(csvText("a,b\"c") == "\"a,b\"\"c\"");
  CHECK(htmlText("<b a='\"&") == "&lt;b a=&#39;&quot;&amp;");
  CHECK(displayText("a\nb\x01\xff") == "a b?\xEF\xBF\xBD");
  const std::vector<ReportFile> files = reportFiles(sample("<script>alert(1)</script>"));
  const std::string page = text(files, "index.html");
  CHECK_THAT(page, !Contains("<script") && Contains("&lt;script&gt;"));
  CHECK_THAT(text(files, "psnr-1.svg"), !Contains("<script"));
}

TEST_CASE("a page needs nothing but its folder") {
  const std::string page = text(reportFiles(sample()), "index.html");
  for (const char* elsewhere : {"http:", "https:", "src=\"/", "url(", "@import"}) {
    std::string rest = page;
    for (std::size_t at; (at = rest.find("http://www.w3.org/2000/svg")) != std::string::npos;) rest.erase(at, 26);
    INFO(elsewhere);
    CHECK(rest.find(elsewhere) == std::string::npos);
  }
  CHECK_THAT(page, Contains("prefers-color-scheme:dark") && Contains("width=device-width"));
}

TEST_CASE("a report's folder appears whole, and replaces reports alone") {
  const TemporaryFolder folder;
  const std::vector<ReportFile> files = reportFiles(sample());
  const auto problem = [&](const fs::path& path, bool overwrite) -> std::string {
    try {
      requireReportFolder(path, overwrite);
    } catch (const Error& error) {
      CHECK(error.kind == ErrorKind::cannotWrite);
      return error.what();
    }
    return "";
  };
  const auto entries = [&](const fs::path& path) {
    return std::distance(fs::directory_iterator(path), fs::directory_iterator());
  };
  CHECK(problem(folder / "new", false) == "");
  CHECK(entries(folder.path) == 0);
  writeReportFolder(folder / "new/", false, files);
  CHECK(entries(folder.path) == 1);
  CHECK(read(folder / "new/results.csv") == formatCsv(sample()));
  CHECK(readImage(folder / "new/crops/1-1-view.png").width == 4);
  CHECK_THAT(problem(folder / "new", false), Contains("exists already (--overwrite replaces it)"));
  CHECK(problem(folder / "new", true) == "");
  EvalComparison less = sample();
  less.datasets[0].crops.clear();
  writeReportFolder(folder / "new", true, reportFiles(less));
  CHECK_FALSE(fs::exists(folder / "new/crops"));
  CHECK(entries(folder.path) == 1);

  std::ofstream(folder / "new/thesis.txt") << "years of work";
  CHECK_THAT(problem(folder / "new", true), Contains("thesis.txt: is not of a report"));
  CHECK_THROWS_AS(writeReportFolder(folder / "new", true, files), Error);
  CHECK(read(folder / "new/thesis.txt") == "years of work");
  std::ofstream(folder / "file") << "x";
  CHECK_THAT(problem(folder / "file", true), Contains("is no folder"));
  CHECK_THAT(problem(folder / "no/such/place", true), Contains("cannot make a folder beside it"));
  fs::create_directory(folder / "empty");
  writeReportFolder(folder / "empty", false, files);
  CHECK(fs::exists(folder / "empty/index.html"));
  CHECK(entries(folder.path) == 3);
}
