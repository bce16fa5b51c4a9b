// SPDX-License-Identifier: Apache-2.0
// Keeps some of a model's Gaussians.
#include "converter/edit/select.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <optional>
#include <string>
#include <vector>

#include "core/model/effective_rank.h"
#include "core/model/verbs.h"
#include "core/system/assert.h"
#include "core/system/error.h"
#include "core/system/median.h"
#include "core/system/nearest_name.h"
#include "core/system/numbers.h"
#include "core/system/parallel.h"
#include "shared/limits.h"

namespace tg {
namespace {

using Value = double (*)(const GaussianModel&, std::size_t);

constexpr std::int64_t kValueGrain = 4096;  // Gaussians a thread takes at once

double shEnergy(const GaussianModel& model, std::size_t i) {
  const std::size_t count = model.shCount();
  double sum = 0.0;
  for (std::size_t k = 1; k < count; ++k) {
    const glm::dvec3 c(model.sh[i * count + k]);
    sum += glm::dot(c, c);
  }
  return sum;
}

double baseColor(const GaussianModel& model, std::size_t i, int channel) {
  return 0.5 + double{kShC0} * model.sh[i * model.shCount()][channel];
}

// Along every axis.
glm::dvec3 medianMean(const GaussianModel& model) {
  glm::dvec3 median(0.0);
  if (model.size() == 0) return median;
  std::vector<float> values(model.size());
  for (int axis = 0; axis < 3; ++axis) {
    std::ranges::transform(model.mean, values.begin(), [axis](glm::vec3 mean) { return mean[axis]; });
    median[axis] = medianOf(values);
  }
  return median;
}

struct Property {
  std::string_view name;
  Value value;  // null: distance, which is of all of them
};
constexpr std::array<Property, 15> kProperties = {{
    {"x", [](const GaussianModel& m, std::size_t i) -> double { return m.mean[i].x; }},
    {"y", [](const GaussianModel& m, std::size_t i) -> double { return m.mean[i].y; }},
    {"z", [](const GaussianModel& m, std::size_t i) -> double { return m.mean[i].z; }},
    {"opacity", opacityOf},
    {"min_scale",
     [](const GaussianModel& m, std::size_t i) {
       const glm::dvec3 s = sigmaOf(m, i);
       return std::min({s.x, s.y, s.z});
     }},
    {"max_scale",
     [](const GaussianModel& m, std::size_t i) {
       const glm::dvec3 s = sigmaOf(m, i);
       return std::max({s.x, s.y, s.z});
     }},
    {"volume",
     [](const GaussianModel& m, std::size_t i) {
       const glm::dvec3 s = sigmaOf(m, i);
       return s.x * s.y * s.z;
     }},
    {"rank", [](const GaussianModel& m, std::size_t i) { return effectiveRank(m.log_scale[i]); }},
    {"distance", nullptr},
    {"index", [](const GaussianModel&, std::size_t i) { return static_cast<double>(i); }},
    {"sh_energy", shEnergy},
    {"texels", [](const GaussianModel& m, std::size_t i) -> double { return rectOf(m, i).texelCount(); }},
    {"red", [](const GaussianModel& m, std::size_t i) { return baseColor(m, i, 0); }},
    {"green", [](const GaussianModel& m, std::size_t i) { return baseColor(m, i, 1); }},
    {"blue", [](const GaussianModel& m, std::size_t i) { return baseColor(m, i, 2); }},
}};

struct Relation {
  std::string_view text;
  bool (*holds)(double a, double b);
};
// Longer ones first: "<" is the start of "<=".
constexpr std::array<Relation, 6> kRelations = {{{"<=", [](double a, double b) { return a <= b; }},
                                                 {">=", [](double a, double b) { return a >= b; }},
                                                 {"==", [](double a, double b) { return a == b; }},
                                                 {"!=", [](double a, double b) { return a != b; }},
                                                 {"<", [](double a, double b) { return a < b; }},
                                                 {">", [](double a, double b) { return a > b; }}}};

// A term of "a < b < c": a number or a property.
struct Term {
  const Property* property = nullptr;
  double number = 0.0;
};

struct Expression {
  std::vector<Term> terms;  // one more than relations
  std::vector<Relation> relations;
};

[[noreturn]] void refuse(std::string_view expression, const std::string& what) {
  std::string text = "\"";
  text += expression;
  text += "\": " + what + " (expected NAME < NUMBER or NUMBER <= NAME < NUMBER, with < <= > >= == !=; NAME is one of";
  for (const Property& property : kProperties) {
    text += ' ';
    text += property.name;
  }
  throw Error(ErrorKind::usage, text + ")");
}

Term parseTerm(std::string_view text, std::string_view expression) {
  const auto found = std::ranges::find(kProperties, text, &Property::name);
  if (found != kProperties.end()) return {&*found, 0.0};
  const std::optional<double> number = parseWhole<double>(text);
  if (!number || !std::isfinite(*number)) {
    std::vector<std::string> names;
    for (const Property& property : kProperties) names.emplace_back(property.name);
    const std::string near = nearestName(text, names);
    refuse(expression, text.empty() ? std::string("a value is missing")
                                    : "unknown value " + std::string(text) +
                                          (near.empty() ? "" : ", did you mean " + near + "?"));
  }
  return {nullptr, *number};
}

Expression parse(std::string_view expression) {
  std::string text;  // without blanks
  std::copy_if(expression.begin(), expression.end(), std::back_inserter(text), [](char c) { return c != ' '; });
  Expression result;
  std::size_t begin = 0;
  for (std::size_t at = 0; at < text.size();) {
    const auto relation = std::find_if(kRelations.begin(), kRelations.end(),
                                       [&](const Relation& r) { return text.compare(at, r.text.size(), r.text) == 0; });
    if (relation == kRelations.end()) {
      ++at;
      continue;
    }
    result.terms.push_back(parseTerm(std::string_view(text).substr(begin, at - begin), expression));
    result.relations.push_back(*relation);
    at += relation->text.size();
    begin = at;
  }
  result.terms.push_back(parseTerm(std::string_view(text).substr(begin), expression));
  const auto properties =
      std::ranges::count_if(result.terms, [](const Term& term) { return term.property != nullptr; });
  if (result.relations.empty() || result.relations.size() > 2 || properties != 1) {
    refuse(expression, "is no comparison of one value with one or two numbers");
  }
  return result;
}

}  // namespace

void keepGaussians(GaussianModel& model, std::span<const std::uint8_t> keep) {
  TG_ASSERT(keep.size() == model.size(), "a choice a Gaussian");
  TG_ASSERT(lengthsAgree(model), "the model's arrays have their lengths");
  std::vector<std::uint32_t> kept;
  for (std::size_t i = 0; i < model.size(); ++i) {
    if (keep[i] != 0) kept.push_back(static_cast<std::uint32_t>(i));
  }
  if (kept.size() < model.size()) model = select(model, kept);
}

std::vector<std::uint8_t> insideBox(const GaussianModel& model, glm::dvec3 low, glm::dvec3 high) {
  TG_ASSERT(low.x <= high.x && low.y <= high.y && low.z <= high.z, "a box has its lower corner first");
  std::vector<std::uint8_t> keep(model.size());
  for (std::size_t i = 0; i < model.size(); ++i) {
    const glm::dvec3 p(model.mean[i]);
    keep[i] = glm::all(glm::greaterThanEqual(p, low)) && glm::all(glm::lessThanEqual(p, high));
  }
  return keep;
}

std::vector<std::uint8_t> insideSphere(const GaussianModel& model, glm::dvec3 center, double radius) {
  TG_ASSERT(radius >= 0.0, "a radius from 0 on");
  std::vector<std::uint8_t> keep(model.size());
  for (std::size_t i = 0; i < model.size(); ++i) {
    keep[i] = glm::distance(glm::dvec3(model.mean[i]), center) <= radius;
  }
  return keep;
}

std::vector<double> valuesOf(const GaussianModel& model, std::string_view name) {
  const auto property = std::ranges::find(kProperties, name, &Property::name);
  TG_ASSERT(property != kProperties.end(), "a number that there is");
  const glm::dvec3 center = property->value ? glm::dvec3(0.0) : medianMean(model);
  std::vector<double> values(model.size());
  parallelFor(static_cast<std::int64_t>(values.size()), kValueGrain, [&](std::int64_t item) {
    const auto i = static_cast<std::size_t>(item);
    values[i] = property->value ? property->value(model, i) : glm::distance(glm::dvec3(model.mean[i]), center);
  });
  return values;
}

std::vector<std::uint8_t> whereValue(const GaussianModel& model, std::string_view text) {
  const Expression expression = parse(text);
  const auto named = std::ranges::find_if(expression.terms, [](const Term& term) { return term.property != nullptr; });
  const std::vector<double> values = valuesOf(model, named->property->name);
  std::vector<std::uint8_t> keep(model.size());
  for (std::size_t i = 0; i < model.size(); ++i) {
    const auto of = [&](const Term& term) { return term.property ? values[i] : term.number; };
    bool ok = true;
    for (std::size_t r = 0; r < expression.relations.size(); ++r) {
      ok = ok && expression.relations[r].holds(of(expression.terms[r]), of(expression.terms[r + 1]));
    }
    keep[i] = ok;
  }
  return keep;
}

}  // namespace tg
