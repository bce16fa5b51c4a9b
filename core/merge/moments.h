// SPDX-License-Identifier: Apache-2.0
// Gaussians as mass, mean and covariance, by which several become one.
#pragma once
#include <cstddef>
#include <glm/glm.hpp>

#include "core/model/model.h"

namespace tg {

constexpr double kMostMergedOpacity = 0.999;
constexpr double kLeastVariance = 1e-20;  // [world units^2] where Gaussians lie on one spot
constexpr double kLeastMass = 1e-200;     // [world units^2]

struct GaussianMoments {
  double mass = 0.0;           // [world units^2] opacity times the area of the two longer axes
  glm::dvec3 mean{0.0};        // [world units]
  glm::dmat3 covariance{0.0};  // [world units^2]
};

// Sigmas [world units] whose squares, and products of these, are finite.
glm::dvec3 boundedSigma(const GaussianModel& model, std::size_t i);
// Of the two longer axes [world units^2], as sigmas.
double areaOf(glm::dvec3 sigma);
double areaOf(const GaussianMoments& moments);
// `alpha`: its texture's mean factor.
GaussianMoments momentsOf(const GaussianModel& model, std::size_t i, double alpha);
// Those of the two densities together, each with its mass.
GaussianMoments merged(const GaussianMoments& a, const GaussianMoments& b);
// Sigmas [world units], and their directions as columns.
glm::dvec3 sigmaOf(const GaussianMoments& moments, glm::dmat3& axes);
// Shape, place and opacity of Gaussian i.
void setMoments(GaussianModel& model, std::size_t i, const GaussianMoments& moments);

}  // namespace tg
