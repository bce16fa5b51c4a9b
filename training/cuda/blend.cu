// SPDX-License-Identifier: Apache-2.0
// A block a tile, a thread a pixel, a warp 8 x 4 of them. Batches of splats pass through shared memory; a warp visits
// those that may show in its pixels. Backward: each warp adds up its 32 pixels, the block its eight warps, in a fixed
// order, and writes a pair's sums once: no atomics but for texels, whose sums are integers. The same input gives the
// same bytes.
#include "training/cuda/blend.h"

#include "training/cuda/sample.h"

namespace tg::cuda {
namespace {

static_assert(kThreads == kTileSize * kTileSize);
constexpr unsigned kWarps = kThreads / kWarp;
constexpr float kInverseLn2 = 1.44269504f;

constexpr int kWarpWidth = 8, kWarpHeight = 4;  // [px]
static_assert(kWarpWidth * kWarpHeight == kWarp && kTileSize % kWarpWidth == 0 && kTileSize % kWarpHeight == 0);

struct Pixel {
  float x, y;  // its centre [px]
  bool inside;
  std::size_t index;
  PixelBlock block;  // its warp's
};
TG_DEVICE Pixel pixelOf(const View& view) {
  const int size = static_cast<int>(kTileSize);
  const int tile = static_cast<int>(blockIdx.x);
  const int warp = static_cast<int>(threadIdx.x / kWarp), lane = static_cast<int>(threadIdx.x % kWarp);
  const int left = tile % view.tiles_x * size + warp % (size / kWarpWidth) * kWarpWidth;
  const int top = tile / view.tiles_x * size + warp / (size / kWarpWidth) * kWarpHeight;
  const int x = left + lane % kWarpWidth, y = top + lane / kWarpWidth;
  Pixel p;
  p.x = static_cast<float>(x) + 0.5f;
  p.y = static_cast<float>(y) + 0.5f;
  p.inside = x < view.size.x && y < view.size.y;
  p.index = static_cast<std::size_t>(y) * view.size.x + x;
  p.block = {static_cast<float>(left) + 0.5f, static_cast<float>(top) + 0.5f,
             static_cast<float>(left + kWarpWidth) - 0.5f, static_cast<float>(top + kWarpHeight) - 0.5f};
  return p;
}

// The texture colour and alpha factor of a sample. Neutral texels give exactly 0 and 1 whatever the weights' rounding.
TG_DEVICE void sampleTexture(const View& view, const float* texels, std::uint32_t offset, const TexturePoint& at,
                             float* color, float& alpha_factor) {
  float deviation = 0.0f;
#pragma unroll
  for (int k = 0; k < 4; ++k) {
    const FourFloats texel = loadFour(texels + 4 * (std::size_t{offset} + at.corner(k)));
    const float weight = at.weight(k);
    for (int c = 0; c < 3; ++c) color[c] += weight * (view.texture_rgb ? texel.value[c] : 0.0f);
    deviation = ::fmaf(weight, texel.value[3] - 1.0f, deviation);
  }
  alpha_factor = view.texture_alpha ? 1.0f + deviation : 1.0f;
}

struct ForwardShared {
  BlendSplat splats[kThreads];
};

struct ForwardArguments {
  BlendInput in;
  PixelRecord record;
  float* picture;
};

template <bool kTexture>
TG_KERNEL forwardKernel(ForwardArguments a) {
  TG_BLOCK_SHARED(ForwardShared, shared);
  const View& view = a.in.view;
  const Pixel pixel = pixelOf(view);
  const unsigned lane = threadIdx.x % kWarp;
  const std::uint32_t begin = a.in.lists.tile_begin[blockIdx.x];
  const std::uint32_t end = a.in.lists.tile_begin[blockIdx.x + 1];
  float transmittance = 1.0f;
  float color[3] = {0.0f, 0.0f, 0.0f};
  std::uint32_t last = 0;
  bool done = !pixel.inside;
  for (std::uint32_t first = begin; first < end; first += kThreads) {
    if (__syncthreads_count(done) == static_cast<int>(kThreads)) break;
    if (first + threadIdx.x < end) {
      const std::uint32_t pair = a.in.lists.sorted_pairs[first + threadIdx.x];
      shared.splats[threadIdx.x] = a.in.splats[a.in.lists.gaussian[pair]];
    }
    __syncthreads();
    const std::uint32_t count = end - first < kThreads ? end - first : kThreads;
    for (std::uint32_t some = 0; some < count; some += kWarp) {
      unsigned left = __ballot_sync(
          kAllLanes, some + lane < count && mayShow(shared.splats[some + lane], pixel.block));
      for (; left != 0 && !done; left &= left - 1) {
        const std::uint32_t j = some + static_cast<unsigned>(__ffs(left)) - 1;
        const BlendSplat& s = shared.splats[j];
        Sample sample;
        if (!evaluate(s, pixel.x, pixel.y, sample)) continue;
        float value = sample.value;
        float texture[3] = {0.0f, 0.0f, 0.0f};
        if (kTexture && s.texture_size != 0) {
          const LocalRay ray = localRay(a.in.frames[s.gaussian], sample.x, sample.y);
          const TexturePoint at = locate(s, ray, sample.inverse_d2, view.outside);
          if (!at.inside && view.outside == kOutsideClip) continue;
          if (at.inside) {
            float alpha_factor;
            sampleTexture(view, a.in.texels, s.texel_offset, at, texture, alpha_factor);
            value *= alpha_factor;
            if (!(value >= kAlphaMin)) continue;
          }
        }
        const float blended = transmittance * (value < kAlphaMax ? value : kAlphaMax);
        const float next = transmittance - blended;
        if (next < kTransmittanceStop) {
          done = true;
          break;
        }
        for (int c = 0; c < 3; ++c) color[c] += blended * (s.base[c] + texture[c]);
        transmittance = next;
        last = first - begin + j + 1;
      }
    }
  }
  if (!pixel.inside) return;
  for (int c = 0; c < 3; ++c) a.picture[3 * pixel.index + c] = color[c] + transmittance * view.background[c];
  a.record.transmittance[pixel.index] = transmittance;
  a.record.end[pixel.index] = last;
}

// What a loss sees of a texture at a sample: "along" is v_color . texture colour.
struct TextureSlopes {
  float along, along_u, along_v;
  float alpha_factor, alpha_u, alpha_v;
};
TG_DEVICE TextureSlopes textureSlopes(const BlendInput& in, const BlendSplat& s, const TexturePoint& at,
                                      const float* v_color) {
  TextureSlopes t = {0.0f, 0.0f, 0.0f, 1.0f, 0.0f, 0.0f};
  if (!at.inside) return t;
  float along[4], alpha[4];
  float deviation = 0.0f;
#pragma unroll
  for (int k = 0; k < 4; ++k) {
    const FourFloats texel = loadFour(in.texels + 4 * (std::size_t{s.texel_offset} + at.corner(k)));
    const float* c = texel.value;
    along[k] = in.view.texture_rgb ? v_color[0] * c[0] + v_color[1] * c[1] + v_color[2] * c[2] : 0.0f;
    alpha[k] = in.view.texture_alpha ? c[3] : 1.0f;
    t.along += at.weight(k) * along[k];
    deviation = ::fmaf(at.weight(k), alpha[k] - 1.0f, deviation);
  }
  t.alpha_factor = 1.0f + deviation;
  const float scale_u = texelsPerSigma(s.texture_size & 0xffffu);
  const float scale_v = texelsPerSigma(s.texture_size >> 16);
  const auto slope_u = [&](const float* c) {
    return scale_u * ((1.0f - at.fraction_v) * (c[1] - c[0]) + at.fraction_v * (c[3] - c[2]));
  };
  const auto slope_v = [&](const float* c) {
    return scale_v * ((1.0f - at.fraction_u) * (c[2] - c[0]) + at.fraction_u * (c[3] - c[1]));
  };
  t.along_u = slope_u(along);
  t.along_v = slope_v(along);
  t.alpha_u = slope_u(alpha);
  t.alpha_v = slope_v(alpha);
  return t;
}

TG_DEVICE void addTexel(long long* at, float value) {
  atomicAdd(reinterpret_cast<unsigned long long*>(at), static_cast<unsigned long long>(::llrintf(value * kTexelUnits)));
}

// Adds v_color and v_alpha of each lane, times its corners' weights, to its four texels. Lanes that share a cell are
// added up first: small textures would otherwise have 32 atomics queue for one address.
TG_DEVICE void addTexels(long long* v_texels, const TexturePoint& at, bool contributes, const float* v_color,
                         float v_alpha) {
  constexpr int kWorthIt = 4;  // lanes
  const unsigned lane = threadIdx.x % kWarp;
  const int cell = contributes ? static_cast<int>(at.cell) : -1;
  const unsigned peers = __match_any_sync(kAllLanes, cell);
  const bool together = contributes && __popc(peers) >= kWorthIt;
  if (contributes && !together) {
    for (int k = 0; k < 4; ++k) {
      long long* texel = v_texels + 4 * static_cast<std::size_t>(at.corner(k));
      for (int c = 0; c < 3; ++c) addTexel(texel + c, at.weight(k) * v_color[c]);
      addTexel(texel + 3, at.weight(k) * v_alpha);
    }
  }
  for (unsigned left = __ballot_sync(kAllLanes, together); left != 0;) {
    const int leader = __ffs(left) - 1;
    const unsigned group = __shfl_sync(kAllLanes, peers, leader);
    const bool member = (group >> lane & 1u) != 0;
    float sums[16];
#pragma unroll
    for (int k = 0; k < 4; ++k) {
#pragma unroll
      for (int c = 0; c < 4; ++c) sums[4 * k + c] = member ? at.weight(k) * (c < 3 ? v_color[c] : v_alpha) : 0.0f;
    }
    const float sum = warpSums16(sums, lane);
    const std::uint32_t leader_cell = __shfl_sync(kAllLanes, at.cell, leader);
    const std::uint32_t step_u = __shfl_sync(kAllLanes, at.step_u, leader);
    const std::uint32_t step_v = __shfl_sync(kAllLanes, at.step_v, leader);
    if (lane % 2 == 0) {
      const unsigned k = lane / 8;
      const std::size_t texel = leader_cell + (k & 1u ? step_u : 0) + (k & 2u ? step_v : 0);
      addTexel(v_texels + 4 * texel + lane / 2 % 4, sum);
    }
    left &= ~group;
  }
}

// State of a pixel behind the splats not yet visited.
struct Behind {
  float transmittance;
  float along;  // v_color . colour that arrives from there
  float v_color[3];
};

// A sample's share in the gradients; zeros where the splat does not show.
struct Share {
  float weight;   // T alpha
  float v_power;  // alpha dL/d(alpha)
  float a;        // v_power / |D|^2
  float v_alpha;  // dL/d(alpha)
};
TG_DEVICE Share backwardColor(const BlendSplat& s, const Sample& sample, float alpha_raw, const TextureSlopes& texture,
                              bool texture_in_suffix, Behind& behind) {
  const float alpha = alpha_raw < kAlphaMax ? alpha_raw : kAlphaMax;
  const float inverse = reciprocal(1.0f - alpha);
  const float ratio = alpha * inverse;
  Share share;
  share.weight = behind.transmittance * ratio;
  const float base = behind.v_color[0] * s.base[0] + behind.v_color[1] * s.base[1] + behind.v_color[2] * s.base[2];
  const float along = base + texture.along;
  const float rise = behind.transmittance * along - behind.along;
  behind.along += share.weight * (texture_in_suffix ? along : base);
  behind.transmittance += share.weight;
  const bool free = alpha_raw < kAlphaMax;  // nothing flows through a clamped alpha
  share.v_power = free ? ratio * rise : 0.0f;
  share.v_alpha = free ? inverse * rise : 0.0f;
  share.a = share.v_power * sample.inverse_d2;
  return share;
}

template <bool kTexture, bool kStatistics>
struct Backward {
  static constexpr unsigned kStride = pairSums(kTexture, kStatistics);
  static constexpr unsigned kBatch = kTexture ? 16 : 32;  // splats between two barriers
  struct Shared {
    BlendSplat splats[kBatch];
    std::uint32_t pairs[kBatch];
    std::uint32_t texel_places[kBatch];
    std::uint32_t touched[kWarps];  // a bit a splat: the warp's sums hold
    std::uint32_t last;             // of all pixels
    float sums[kBatch][kWarps][kStride];
  };
};

struct BackwardArguments {
  BlendInput in;
  PixelRecord record;
  const float* v_picture;
  GradientOptions options;
  ListPart part;
  PairGradients out;
};

template <bool kTexture, bool kStatistics>
TG_DEVICE void backwardSplat(const BackwardArguments& a, const BlendSplat& s, std::uint32_t texel_place, bool shows,
                             const Sample& sample, const TexturePoint& at, const LocalRay& ray, Behind& behind,
                             float* warp_sums) {
  const View& view = a.in.view;
  const unsigned lane = threadIdx.x % kWarp;
  TextureSlopes texture = {0.0f, 0.0f, 0.0f, 1.0f, 0.0f, 0.0f};
  float alpha_raw = sample.value;
  const bool textured = kTexture && s.texture_size != 0;
  if (textured && shows) {
    texture = textureSlopes(a.in, s, at, behind.v_color);
    alpha_raw *= texture.alpha_factor;
    shows = alpha_raw >= kAlphaMin;
  }
  Share share = {0.0f, 0.0f, 0.0f, 0.0f};
  if (shows) share = backwardColor(s, sample, alpha_raw, texture, a.options.texture_in_suffix, behind);

  float b = share.a * sample.q;
  float v_u = 0.0f, v_v = 0.0f;  // dL/d(numerators of u and v)
  float e_x = 0.0f, e_y = 0.0f;
  const float x = sample.x, y = sample.y;
  if (kStatistics && shows) {
    const float w_kappa = s.kappa_second * y + s.kappa_first * sample.w;
    e_x = share.a * (w_kappa * y + s.w_xx * sample.w);
    e_y = share.a * (s.w_yy * s.w_yy * y + s.w_xy * sample.w - w_kappa * x);
  }
  if (textured && shows && at.inside) {
    const float v_factor = share.v_alpha * sample.value;  // dL/d(alpha factor)
    if (a.options.texture_to_geometry) {
      v_u = sample.inverse_d2 * (share.weight * texture.along_u + v_factor * texture.alpha_u);
      v_v = sample.inverse_d2 * (share.weight * texture.along_v + v_factor * texture.alpha_v);
      b -= kInverseLn2 * (v_u * at.u + v_v * at.v);
      if (kStatistics) {
        // Moving the projected mean changes the numerators by -D x (wx + kappa y) and -D x (wy - kappa x).
        const LocalFrame& f = a.in.frames[s.gaussian];
        float mx[3], my[3];
        for (int k = 0; k < 3; ++k) {
          mx[k] = f.wx[k] + f.kappa[k] * y;
          my[k] = f.wy[k] - f.kappa[k] * x;
        }
        const float* d = ray.d;
        e_x -= 0.5f * kInverseLn2 * (v_u * (d[1] * mx[2] - d[2] * mx[1]) + v_v * (d[2] * mx[0] - d[0] * mx[2]));
        e_y -= 0.5f * kInverseLn2 * (v_u * (d[1] * my[2] - d[2] * my[1]) + v_v * (d[2] * my[0] - d[0] * my[2]));
      }
    }
  }
  if (textured) {
    float v_color[3];
    for (int c = 0; c < 3; ++c) v_color[c] = view.texture_rgb ? share.weight * behind.v_color[c] : 0.0f;
    const float v_alpha = view.texture_alpha ? share.v_alpha * sample.value : 0.0f;
    addTexels(a.out.v_texels + 4 * static_cast<std::size_t>(texel_place), at, shows && at.inside, v_color, v_alpha);
  }

  const float aw = share.a * sample.w;
  float sums[16] = {share.weight * behind.v_color[0],
                    share.weight * behind.v_color[1],
                    share.weight * behind.v_color[2],
                    share.v_power,
                    aw,
                    aw * x,
                    aw * y,
                    share.a * y,
                    share.a * x * y,
                    share.a * y * y,
                    b,
                    b * x,
                    b * y,
                    b * x * x,
                    b * x * y,
                    b * y * y};
  const float sum = warpSums16(sums, lane);
  if (lane % 2 == 0) warp_sums[lane / 2] = sum;
  const float size_y = static_cast<float>(view.size.y);
  const float aspect = static_cast<float>(view.size.x) / size_y;
  const float magnitude = kStatistics ? size_y * ::sqrtf(e_x * e_x * aspect * aspect + e_y * e_y) : 0.0f;
  if constexpr (kTexture) {
    float more[16] = {v_u,     v_u * x,     v_u * y,     v_u * x * x, v_u * x * y, v_u * y * y, v_v,  v_v * x,
                      v_v * y, v_v * x * x, v_v * x * y, v_v * y * y, magnitude,   0.0f,        0.0f, 0.0f};
    const float second = warpSums16(more, lane);
    if (lane % 2 == 0 && lane / 2 < kTextureSums + kStatistics) warp_sums[kSums + lane / 2] = second;
  } else if constexpr (kStatistics) {
    const float total = warpSum(magnitude);
    if (lane == 0) warp_sums[kSums] = total;
  }
}

template <bool kTexture, bool kStatistics>
TG_KERNEL_BLOCKS(3)
backwardKernel(BackwardArguments a) {
  using Layout = Backward<kTexture, kStatistics>;
  TG_BLOCK_SHARED(typename Layout::Shared, shared);
  constexpr unsigned kBatch = Layout::kBatch;
  const View& view = a.in.view;
  const Pixel pixel = pixelOf(view);
  const unsigned warp = threadIdx.x / kWarp, lane = threadIdx.x % kWarp;
  const std::uint32_t begin = a.in.lists.tile_begin[blockIdx.x];
  const std::uint32_t part_begin = a.part.begin != nullptr ? a.part.begin[blockIdx.x] : 0;
  Behind behind = {0.0f, 0.0f, {0.0f, 0.0f, 0.0f}};
  std::uint32_t end = 0;
  if (pixel.inside) {
    end = a.record.end[pixel.index];
    behind.transmittance = a.record.transmittance[pixel.index];
    for (int c = 0; c < 3; ++c) {
      behind.v_color[c] = a.v_picture[3 * pixel.index + c];
      behind.along += behind.transmittance * behind.v_color[c] * view.background[c];
    }
    if (!a.part.farthest) behind.along = a.part.along[pixel.index];
  }
  if (threadIdx.x == 0) shared.last = 0;
  __syncthreads();
  atomicMax(&shared.last, end);
  __syncthreads();
  std::uint32_t warp_end = end;
  for (unsigned offset = kWarp / 2; offset > 0; offset /= 2) {
    warp_end = max(warp_end, __shfl_xor_sync(kAllLanes, warp_end, offset));
  }
  std::uint32_t high = shared.last;
  if (a.part.end != nullptr) high = min(high, a.part.end[blockIdx.x]);

  while (high > part_begin) {
    const std::uint32_t low = high - part_begin > kBatch ? high - kBatch : part_begin;
    const std::uint32_t count = high - low;
    if (threadIdx.x < count) {
      const std::uint32_t pair = a.in.lists.sorted_pairs[begin + low + threadIdx.x];
      shared.pairs[threadIdx.x] = pair;
      const std::uint32_t gaussian = a.in.lists.gaussian[pair];
      shared.splats[threadIdx.x] = a.in.splats[gaussian];
      if (kTexture) {
        shared.texel_places[threadIdx.x] =
            a.out.texel_places != nullptr ? a.out.texel_places[gaussian] : shared.splats[threadIdx.x].texel_offset;
      }
    }
    __syncthreads();
    unsigned visited = 0;
    unsigned left = __ballot_sync(
        kAllLanes, lane < count && low + lane < warp_end && mayShow(shared.splats[lane], pixel.block));
    while (left != 0) {
      const unsigned j = kWarp - 1 - static_cast<unsigned>(__clz(static_cast<int>(left)));
      left ^= 1u << j;
      const BlendSplat& s = shared.splats[j];
      Sample sample = {0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f};
      bool shows = low + j < end && evaluate(s, pixel.x, pixel.y, sample);
      if (!__any_sync(kAllLanes, shows)) continue;
      if (!shows) sample = {0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f};
      TexturePoint at = {false, 0.0f, 0.0f, 0.0f, 0.0f, 0, 0, 0};
      LocalRay ray = {};
      if (kTexture && s.texture_size != 0 && shows) {
        ray = localRay(a.in.frames[s.gaussian], sample.x, sample.y);
        at = locate(s, ray, sample.inverse_d2, view.outside);
        shows = at.inside || view.outside != kOutsideClip;
      }
      backwardSplat<kTexture, kStatistics>(a, s, shared.texel_places[j], shows, sample, at, ray, behind,
                                           shared.sums[j][warp]);
      visited |= 1u << j;
    }
    if (lane == 0) shared.touched[warp] = visited;
    __syncthreads();
    for (unsigned item = threadIdx.x; item < count * Layout::kStride; item += kThreads) {
      const unsigned j = item / Layout::kStride;
      const unsigned k = item % Layout::kStride;
      float sum = 0.0f;
      bool touched = false;
      for (unsigned w = 0; w < kWarps; ++w) {
        if ((shared.touched[w] >> j & 1u) == 0) continue;
        sum += shared.sums[j][w][k];
        touched = true;
      }
      if (!touched) continue;
      a.out.sums[static_cast<std::size_t>(shared.pairs[j]) * Layout::kStride + k] = sum;
      if (k == 0) a.out.shows[shared.pairs[j]] = 1;
    }
    __syncthreads();
    high = low;
  }
  if (a.part.along == nullptr || !pixel.inside) return;
  a.record.transmittance[pixel.index] = behind.transmittance;
  a.part.along[pixel.index] = behind.along;
}

std::size_t tileCount(const View& view) { return static_cast<std::size_t>(view.tiles_x) * view.tiles_y; }
bool textured(const View& view) { return view.texture_rgb || view.texture_alpha; }

}  // namespace

void blendForward(const BlendInput& input, const PixelRecord& record, float* picture) {
  const auto kernel = textured(input.view) ? forwardKernel<true> : forwardKernel<false>;
  launch("blend forward", kernel, tileCount(input.view), ForwardArguments{input, record, picture});
}

void blendBackward(const BlendInput& input, const PixelRecord& record, const float* v_picture,
                   const GradientOptions& options, const ListPart& part, const PairGradients& out) {
  const bool texture = textured(input.view);
  const auto kernel = texture ? (options.statistics ? backwardKernel<true, true> : backwardKernel<true, false>)
                              : (options.statistics ? backwardKernel<false, true> : backwardKernel<false, false>);
  launch("blend backward", kernel, tileCount(input.view),
         BackwardArguments{input, record, v_picture, options, part, out});
}

}  // namespace tg::cuda
