// SPDX-License-Identifier: Apache-2.0
// Lets one text compile as GLSL 450, C++20 (GLM) and CUDA. The only file that knows which compiler reads it.
// Rules for every file in this folder: no swizzles, no `in`, no `static`, no `enum`, float literals with `f`.
#ifndef TG_LANG_H
#define TG_LANG_H
#ifdef __cplusplus
#include <cmath>
#include <cstdint>
#include <glm/glm.hpp>
#ifdef __CUDACC__
#define TG_FN __host__ __device__ inline
#else
#define TG_FN inline
#endif
#define TG_OUT(T) T&
#define TG_INOUT(T) T&
#define TG_PRECISE
#define TG_CHECK_SIZE(T, bytes) static_assert(sizeof(T) == (bytes), #T " must match its std430 size");
namespace tg {
using glm::ivec2;
using glm::mat3;
using glm::mat4;
using glm::uvec2;
using glm::uvec4;
using glm::vec2;
using glm::vec3;
using glm::vec4;
using uint = std::uint32_t;
using glm::clamp;
using std::exp;
using std::floor;
using std::log;
using std::max;
using std::min;
using std::sqrt;
}  // namespace tg
#define TG_NAMESPACE_BEGIN namespace tg {
#define TG_NAMESPACE_END }
#else
#define TG_FN
#define TG_OUT(T) out T
#define TG_INOUT(T) inout T
#define TG_PRECISE precise  // the same result in every shader
#define TG_CHECK_SIZE(T, bytes)
#define TG_NAMESPACE_BEGIN
#define TG_NAMESPACE_END
#endif
#endif
