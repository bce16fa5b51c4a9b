// SPDX-License-Identifier: Apache-2.0
// A texture at another size.
#include "core/model/texture_fit.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>

#include "core/system/assert.h"
#include "core/system/error.h"
#include "core/system/parallel.h"
#include "shared/texture.h"

namespace tg {
namespace {

// Keeps texels beyond the Gaussian's reach determined; 1e-3 of the weight at the centre.
constexpr double kFloorWeight = 1e-3;
// Samples in each cell of the finer grid: the integrands are products of three smooth factors there.
constexpr int kSamplesPerCell = 8;

// Solves the symmetric positive definite system A X = B by Cholesky; A is n x n, B is n x m, both row-major, B becomes
// X.
void solveSymmetric(std::vector<double>& a, std::vector<double>& b, int n, int m) {
  for (int j = 0; j < n; ++j) {
    for (int i = j; i < std::min(n, j + 2); ++i) {  // A is tridiagonal
      double sum = a[i * n + j];
      for (int k = std::max(0, j - 2); k < j; ++k) sum -= a[i * n + k] * a[j * n + k];
      a[i * n + j] = i == j ? std::sqrt(sum) : sum / a[j * n + j];
    }
  }
  for (int i = 0; i < n; ++i) {
    for (int c = 0; c < m; ++c) {
      if (i > 0) b[i * m + c] -= a[i * n + i - 1] * b[(i - 1) * m + c];
      b[i * m + c] /= a[i * n + i];
    }
  }
  for (int i = n - 1; i >= 0; --i) {
    for (int c = 0; c < m; ++c) {
      if (i + 1 < n) b[i * m + c] -= a[(i + 1) * n + i] * b[(i + 1) * m + c];
      b[i * m + c] /= a[i * n + i];
    }
  }
}

// The two nodes of a grid around u and their weights.
struct Nodes {
  int index[2];
  double weight[2];
};
Nodes nodesAt(double u, int size) {
  const TextureTap tap = textureTap(static_cast<float>(u), static_cast<unsigned>(size));
  if (size == 1) return {{0, 0}, {1.0, 0.0}};
  const double x = (u + kTextureExtent) * (size - 1) / (2.0 * kTextureExtent);
  const double fraction = x - tap.i0;
  return {{static_cast<int>(tap.i0), static_cast<int>(tap.i1)}, {1.0 - fraction, fraction}};
}

}  // namespace

AxisFit::AxisFit(int from, int to) : from_(from), to_(to), matrix_(static_cast<std::size_t>(from) * to, 0.0) {
  TG_ASSERT(from >= 1 && to >= 1, "a texture has a texel at least");
  if (from == to) {
    for (int k = 0; k < to; ++k) matrix_[k * from + k] = 1.0;
    return;
  }
  std::vector<double> normal(static_cast<std::size_t>(to) * to, 0.0);
  const int samples = kSamplesPerCell * (std::max(from, to) - 1) * std::max(1, std::min(from, to) - 1);
  const int count = std::clamp(samples, 64, 1 << 16);
  for (int s = 0; s < count; ++s) {
    const double u = kTextureExtent * ((2.0 * s + 1.0) / count - 1.0);
    const double weight = std::exp(-u * u) + kFloorWeight;
    const Nodes fine = nodesAt(u, from), coarse = nodesAt(u, to);
    for (int i = 0; i < 2; ++i) {
      for (int j = 0; j < 2; ++j) {
        normal[coarse.index[i] * to + coarse.index[j]] += weight * coarse.weight[i] * coarse.weight[j];
        matrix_[coarse.index[i] * from + fine.index[j]] += weight * coarse.weight[i] * fine.weight[j];
      }
    }
  }
  solveSymmetric(normal, matrix_, to, from);
}

const AxisFit& AxisFits::get(int from, int to) {
  std::unique_ptr<AxisFit>& fit = fits_[{from, to}];
  if (!fit) fit = std::make_unique<AxisFit>(from, to);
  return *fit;
}

std::vector<glm::vec4> fitTexture(std::span<const glm::vec4> texels, const AxisFit& u, const AxisFit& v) {
  std::vector<glm::dvec4> rows(static_cast<std::size_t>(u.to()) * v.from(), glm::dvec4(0.0));
  for (int j = 0; j < v.from(); ++j) {
    for (int i = 0; i < u.to(); ++i) {
      glm::dvec4& sum = rows[static_cast<std::size_t>(j) * u.to() + i];
      for (int k = 0; k < u.from(); ++k) {
        sum += u.at(i, k) * glm::dvec4(texels[static_cast<std::size_t>(j) * u.from() + k]);
      }
    }
  }
  std::vector<glm::vec4> out(static_cast<std::size_t>(u.to()) * v.to());
  for (int j = 0; j < v.to(); ++j) {
    for (int i = 0; i < u.to(); ++i) {
      glm::dvec4 sum(0.0);
      for (int k = 0; k < v.from(); ++k) sum += v.at(j, k) * rows[static_cast<std::size_t>(k) * u.to() + i];
      sum.a = std::clamp(sum.a, 0.0, 1.0);
      out[static_cast<std::size_t>(j) * u.to() + i] = glm::vec4(sum);
    }
  }
  return out;
}

TextureAtlas resizedAtlas(const TextureAtlas& atlas, std::span<const glm::ivec2> sizes) {
  TextureAtlas out;
  out.rects.resize(atlas.rects.size());
  AxisFits fits;
  std::vector<std::pair<const AxisFit*, const AxisFit*>> axes(atlas.rects.size());
  std::uint64_t texels = 0;
  for (std::size_t i = 0; i < atlas.rects.size(); ++i) {
    const TextureRect& rect = atlas.rects[i];
    if (rect.texelCount() == 0 || sizes[i].x == 0 || sizes[i].y == 0) continue;
    axes[i] = {&fits.get(rect.width, sizes[i].x), &fits.get(rect.height, sizes[i].y)};
    out.rects[i] = {static_cast<std::uint32_t>(texels), static_cast<std::uint16_t>(sizes[i].x),
                    static_cast<std::uint16_t>(sizes[i].y)};
    texels += out.rects[i].texelCount();
    if (texels > kMaxModelTexels) {
      throw Error(ErrorKind::badData, "too many texels (expected at most " + std::to_string(kMaxModelTexels) + ")");
    }
  }
  out.texels.resize(texels);
  parallelFor(static_cast<std::int64_t>(out.rects.size()), 64, [&](std::int64_t item) {
    const std::size_t i = static_cast<std::size_t>(item);
    const TextureRect& to = out.rects[i];
    if (to.texelCount() == 0) return;
    const TextureRect& from = atlas.rects[i];
    const std::span<const glm::vec4> before(atlas.texels.data() + from.offset, from.texelCount());
    if (from.width == to.width && from.height == to.height) {
      std::copy(before.begin(), before.end(), out.texels.begin() + to.offset);
      return;
    }
    const std::vector<glm::vec4> after = fitTexture(before, *axes[i].first, *axes[i].second);
    std::copy(after.begin(), after.end(), out.texels.begin() + to.offset);
  });
  return out;
}

}  // namespace tg
