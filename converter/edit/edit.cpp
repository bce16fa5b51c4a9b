// SPDX-License-Identifier: Apache-2.0
// The edits of tgconvert's command line.
#include "converter/edit/edit.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <initializer_list>
#include <optional>
#include <set>
#include <utility>

#include "converter/edit/merge.h"
#include "converter/edit/quality.h"
#include "converter/edit/select.h"
#include "converter/edit/transform.h"
#include "converter/edit/upright.h"
#include "converter/gltf/axes.h"
#include "converter/registry/file_format.h"
#include "core/bundle/training_json.h"
#include "core/merge/decimate.h"
#include "core/model/fallback.h"
#include "core/model/texture_budget.h"
#include "core/model/texture_dictionary.h"
#include "core/model/verbs.h"
#include "core/system/error.h"
#include "core/system/numbers.h"
#include "render/contribution.h"

namespace tg {
namespace {

// Comma-separated; `expected` names them for the message.
std::vector<double> numbersOf(const Edit& edit, std::initializer_list<std::size_t> counts, const char* expected) {
  for (const std::size_t count : counts) {
    std::vector<double> numbers(count);
    const bool all = parseList<double>(edit.value, numbers);
    if (all && std::ranges::all_of(numbers, [](double n) { return std::isfinite(n); })) return numbers;
  }
  throw Error(ErrorKind::usage, "wrong value (expected " + std::string(expected) + ")");
}

glm::dvec3 vectorAt(const std::vector<double>& n, std::size_t at = 0) { return {n[at], n[at + 1], n[at + 2]}; }

void transform(Bundle& loaded, const Similarity& similarity) {
  transformModel(loaded.model, similarity);
  transformCameras(loaded.cameras, similarity);
}

void translate(Bundle& loaded, const Edit& edit) {
  Similarity move;
  move.translation = vectorAt(numbersOf(edit, {3}, "x,y,z"));
  transform(loaded, move);
}

// Of length 1, however small or large the numbers are; all 0 where they are.
template <typename Vector>
Vector unit(Vector v) {
  double largest = 0;
  for (int k = 0; k < Vector::length(); ++k) largest = std::max(largest, std::abs(v[k]));
  if (largest == 0) return v;
  for (int k = 0; k < Vector::length(); ++k) v[k] /= largest;
  return v / glm::length(v);
}

void rotate(Bundle& loaded, const Edit& edit) {
  const std::vector<double> n = numbersOf(edit, {4}, "x,y,z,DEGREES");
  const glm::dvec3 direction = unit(vectorAt(n));
  if (direction == glm::dvec3(0.0)) throw Error(ErrorKind::usage, "the axis has no length");
  const double half = 0.5 * n[3] * M_PI / 180.0;
  const glm::dvec3 axis = std::sin(half) * direction;
  Similarity turn;
  turn.rotation = matrixFromQuaternion({std::cos(half), axis.x, axis.y, axis.z});
  transform(loaded, turn);
}

void rotateQuaternion(Bundle& loaded, const Edit& edit) {
  const std::vector<double> n = numbersOf(edit, {4}, "w,x,y,z");
  const glm::dvec4 q = unit(glm::dvec4(n[0], n[1], n[2], n[3]));
  if (q == glm::dvec4(0.0)) throw Error(ErrorKind::usage, "the quaternion has no length");
  Similarity turn;
  turn.rotation = matrixFromQuaternion(q);
  transform(loaded, turn);
}

Similarity uprightTurn(const Bundle& loaded) {
  const std::optional<glm::dvec3> up = upOf(loaded.cameras);
  if (!up) {
    throw Error(ErrorKind::usage, loaded.cameras.empty() ? "the model has no cameras that know (expected --rotate)"
                                                         : "the cameras contradict (expected --rotate)");
  }
  Similarity turn;
  turn.rotation = turnBetween(*up, {0.0, -1.0, 0.0});
  return turn;
}

void upright(Bundle& loaded, const Edit&) { transform(loaded, uprightTurn(loaded)); }

void scale(Bundle& loaded, const Edit& edit) {
  const std::vector<double> n = numbersOf(edit, {1, 3}, "one number");
  glm::dmat4 matrix(1.0);
  for (int k = 0; k < 3; ++k) matrix[k][k] = n[n.size() == 1 ? 0 : static_cast<std::size_t>(k)];
  transform(loaded, similarityFrom(matrix));
}

void applyMatrix(Bundle& loaded, const Edit& edit) {
  const std::vector<double> n = numbersOf(edit, {12, 16}, "12 or 16 numbers, row by row");
  glm::dmat4 matrix(1.0);
  for (std::size_t k = 0; k < n.size(); ++k) matrix[static_cast<int>(k % 4)][static_cast<int>(k / 4)] = n[k];
  transform(loaded, similarityFrom(matrix));
}

void cropBox(Bundle& loaded, const Edit& edit) {
  const std::vector<double> n = numbersOf(edit, {6}, "x0,y0,z0,x1,y1,z1");
  const glm::dvec3 a = vectorAt(n), b = vectorAt(n, 3);
  keepGaussians(loaded.model, insideBox(loaded.model, glm::min(a, b), glm::max(a, b)));
}

void cropSphere(Bundle& loaded, const Edit& edit) {
  const std::vector<double> n = numbersOf(edit, {4}, "x,y,z,RADIUS");
  if (!(n[3] > 0.0)) throw Error(ErrorKind::usage, "the radius is not positive");
  keepGaussians(loaded.model, insideSphere(loaded.model, vectorAt(n), n[3]));
}

void keepWhere(Bundle& loaded, const Edit& edit) { keepGaussians(loaded.model, whereValue(loaded.model, edit.value)); }

// Those of one data set are both models': they count once.
void addCameras(std::vector<Camera>& cameras, const std::vector<Camera>& added) {
  const auto key = [](const Camera& camera) {
    const Pinhole& p = camera;
    std::array<double, 18> numbers = {p.translation.x, p.translation.y, p.translation.z,  p.focal.x,       p.focal.y,
                                      p.center.x,      p.center.y,      double(p.size.x), double(p.size.y)};
    for (int k = 0; k < 9; ++k) numbers[9 + static_cast<std::size_t>(k)] = p.rotation[k / 3][k % 3];
    return std::pair(camera.name, numbers);
  };
  std::set<decltype(key(Camera{}))> known;
  for (const Camera& camera : cameras) known.insert(key(camera));
  for (const Camera& camera : added) {
    if (!known.contains(key(camera))) cameras.push_back(camera);
  }
}

// As checkModel, of an edit's result.
void checkCameras(const std::vector<Camera>& cameras, const std::string& place) {
  for (const Camera& camera : cameras) {
    const glm::dvec3 position = camera.position();
    for (int k = 0; k < 3; ++k) {
      // What is written of it are floats, too.
      if (std::isfinite(static_cast<float>(position[k])) && std::isfinite(static_cast<float>(camera.translation[k]))) {
        continue;
      }
      throw Error(ErrorKind::badData, place + ": a camera's position is not finite");
    }
  }
}

std::string spoken(glm::vec3 color) {
  return numberText(color.x) + ", " + numberText(color.y) + ", " + numberText(color.z);
}

void merge(Bundle& loaded, const Edit& edit) {
  const Bundle other = readModel(edit.value, edit.reading);
  mergeModel(loaded.model, other.model, edit.value);
  addCameras(loaded.cameras, other.cameras);
  if (!other.views.empty()) loaded.warnings.push_back(edit.value + ": its named views are left aside");
  if (!loaded.knows_background && other.knows_background) {
    loaded.background = other.background;
    loaded.knows_background = true;
  } else if (other.knows_background && other.background != loaded.background) {
    loaded.warnings.push_back(edit.value + ": another background, left aside (" + spoken(other.background) +
                              " beside " + spoken(loaded.background) + ")");
  }
  for (const std::string& warning : other.warnings) loaded.warnings.push_back(edit.value + ": " + warning);
  if (wasInterrupted(other.training_json)) loaded.warnings.push_back(edit.value + ": " + kInterruptedTraining);
  loaded.training_json.clear();  // it tells of one of them
}

std::size_t countOf(const Bundle& loaded, const Edit& edit) {
  Edit number = edit;
  const bool percent = !number.value.empty() && number.value.back() == '%';
  if (percent) number.value.pop_back();
  const double n = numbersOf(number, {1}, "N or P%")[0];
  if (n < 0.0 || (percent ? n > 100.0 : n != std::floor(n))) {
    throw Error(ErrorKind::usage, "wrong value (expected a count, or a percentage from 0 to 100)");
  }
  const double count = percent ? std::round(static_cast<double>(loaded.model.size()) * n / 100.0) : n;
  return static_cast<std::size_t>(std::min(count, 1e18));
}

// Whether weights have to be known for it; a count of 0 is refused whatever there is.
bool changesTo(const Bundle& loaded, std::size_t count) { return count == 0 || count < loaded.model.size(); }

// How much of its pictures each Gaussian is.
std::vector<double> shownWeights(const Bundle& loaded) {
  const std::vector<Camera> views = contributionViews(loaded.model, loaded.cameras);
  return blendWeights(loaded.model, views, nearOf(loaded.model, views));
}

void decimateTo(Bundle& loaded, const Edit& edit) {
  const std::size_t count = countOf(loaded, edit);
  if (changesTo(loaded, count)) decimate(loaded.model, count, shownWeights(loaded));
}

void mergeTo(Bundle& loaded, const Edit& edit) {
  const std::size_t count = countOf(loaded, edit);
  if (changesTo(loaded, count)) decimateByMerging(loaded.model, count, shownWeights(loaded));
}

void reduceSh(Bundle& loaded, const Edit& edit) {
  const double degree = numbersOf(edit, {1}, "0 to 3")[0];
  if (degree != std::floor(degree) || degree < 0.0 || degree > 3.0) {
    throw Error(ErrorKind::usage, "wrong value (expected 0 to 3)");
  }
  if (degree < loaded.model.sh_degree) setShDegree(loaded.model, static_cast<int>(degree));
}

void textureSize(Bundle& loaded, const Edit& edit) {
  Edit numbers = edit;
  if (const std::size_t x = numbers.value.find('x'); x != std::string::npos) numbers.value[x] = ',';
  const std::vector<double> n = numbersOf(numbers, {1, 2}, "WIDTHxHEIGHT or one number for both");
  for (const double side : n) {
    if (side != std::floor(side) || side < 1.0 || side > 65535.0) {
      throw Error(ErrorKind::usage, "wrong value (expected whole numbers from 1 on)");
    }
  }
  resizeTextures(loaded.model, static_cast<int>(n.front()), static_cast<int>(n.back()));
}

void textureError(Bundle& loaded, const Edit& edit) {
  fitTexturesToError(loaded.model, numbersOf(edit, {1}, "a number from 0 on")[0]);
}

void noTextures(Bundle& loaded, const Edit&) { loaded.model = bakeFallback(loaded.model, FallbackScale::fitted); }

void texelBudget(Bundle& loaded, const Edit& edit) {
  const double texels = numbersOf(edit, {1}, "a number of texels")[0];
  if (texels < 0.0 || texels != std::floor(texels) || texels > 1e18) {
    throw Error(ErrorKind::usage, "wrong value (expected a number of texels)");
  }
  if (texels == 0) return noTextures(loaded, edit);
  fitTexturesToBudget(loaded.model, static_cast<std::uint64_t>(texels), shownWeights(loaded));
}

void shareTextures(Bundle& loaded, const Edit& edit) {
  const double entries = numbersOf(edit, {1}, "a number of textures")[0];
  if (entries < 1.0 || entries != std::floor(entries) || entries > static_cast<double>(kMostSharedTextures)) {
    throw Error(ErrorKind::usage, "wrong value (expected 1 to " + std::to_string(kMostSharedTextures) + ")");
  }
  tg::shareTextures(loaded.model, static_cast<std::size_t>(entries), shownWeights(loaded), kBitCost, 0);
}

struct Command {
  EditOption option;
  void (*apply)(Bundle&, const Edit&);
  bool reduces;  // the same scene with less of it
};
constexpr std::array<Command, 18> kCommands = {{
    {{"--translate", "X,Y,Z", "move"}, translate, false},
    {{"--rotate", "X,Y,Z,DEG", "turn by an angle about an axis through the origin"}, rotate, false},
    {{"--rotate-quaternion", "W,X,Y,Z", "turn by a quaternion of any length"}, rotateQuaternion, false},
    {{"--upright", "", "turn what the cameras have at their top to -y, which is +y in glTF"}, upright, false},
    {{"--scale", "S", "scale about the origin"}, scale, false},
    {{"--matrix", "M", "12 or 16 numbers row by row: rotation, one scale, translation"}, applyMatrix, false},
    {{"--crop-box", "X0,Y0,Z0,X1,Y1,Z1", "keep what has its mean inside"}, cropBox, false},
    {{"--crop-sphere", "X,Y,Z,R", "keep what has its mean inside"}, cropSphere, false},
    {{"--keep", "EXPR", "keep by value: \"opacity > 0.1\", \"0.01 <= max_scale < 2\""}, keepWhere, false},
    {{"--merge", "FILE", "put another model beside it"}, merge, false},
    {{"--decimate", "N|P%", "leave the N Gaussians, or P % of them, that pictures show most"}, decimateTo, true},
    {{"--merge-pairs", "N|P%", "leave N Gaussians, or P %, by merging neighbours"}, mergeTo, true},
    {{"--sh-degree", "D", "leave SH degrees up to D"}, reduceSh, true},
    {{"--texture-size", "WxH", "give every texture this size [texels]"}, textureSize, true},
    {{"--texel-budget", "N", "at most N texels in all, where pictures show them most"}, texelBudget, true},
    {{"--texture-error", "E", "the smallest texture with an error of at most E (1 = white)"}, textureError, true},
    {{"--share-textures", "N", "leave N different textures, which Gaussians share"}, shareTextures, true},
    {{"--no-textures", "", "bake textures into colours and opacities"}, noTextures, true},
}};

const auto kOptions = [] {
  std::array<EditOption, kCommands.size()> options;
  for (std::size_t k = 0; k < options.size(); ++k) options[k] = kCommands[k].option;
  return options;
}();

}  // namespace

std::span<const EditOption> editOptions() { return kOptions; }

std::vector<EditReport> applyEdits(Bundle& loaded, std::span<const Edit> edits, bool measure) {
  std::vector<EditReport> reports;
  for (const Edit& edit : edits) {
    const Command* command = nullptr;
    for (const Command& c : kCommands) {
      if (c.option.name == edit.option) command = &c;
    }
    if (command == nullptr) throw Error(ErrorKind::usage, edit.option + ": no such edit");
    const std::string place = edit.option + (edit.value.empty() ? "" : " " + edit.value);
    EditReport report{edit, loaded.model.size(), 0, std::nullopt};
    const bool compares = measure && command->reduces;
    const GaussianModel before = compares ? loaded.model : GaussianModel();
    // Views are among the cameras while something may move them, but not where those say what is worth keeping, or
    // which way is up, or where others come to them that may be the same.
    std::vector<Camera>& cameras = loaded.cameras;
    std::vector<Camera>& views = loaded.views;
    const auto own = static_cast<std::ptrdiff_t>(cameras.size());
    const bool turns = command->apply == upright;
    const bool along = !command->reduces && !turns && command->apply != merge;
    if (along) cameras.insert(cameras.end(), views.begin(), views.end());
    try {
      if (turns) transformCameras(views, uprightTurn(loaded));
      command->apply(loaded, edit);
    } catch (const Error& error) {
      // A merged file's errors carry its name already.
      if (error.kind != ErrorKind::usage) throw;
      throw Error(ErrorKind::usage, place + ": " + error.what());
    }
    if (along) {
      const auto first = cameras.begin() + own, last = first + static_cast<std::ptrdiff_t>(views.size());
      views.assign(first, last);
      cameras.erase(first, last);
    }
    report.after = loaded.model.size();
    if (report.after == 0) throw Error(ErrorKind::badData, place + ": no Gaussian is left");
    checkModel(loaded.model, place);  // floats may not hold what was asked for
    checkCameras(loaded.cameras, place);
    checkCameras(views, place);
    if (compares) {
      report.psnr = renderedPsnr(before, loaded.model, qualityViews(before, loaded.cameras), loaded.background);
    }
    loaded.preview = {};
    noteEdited(loaded.training_json);
    reports.push_back(std::move(report));
  }
  return reports;
}

}  // namespace tg
