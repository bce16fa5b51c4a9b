// SPDX-License-Identifier: Apache-2.0
// What a pass only reads: uniform texel buffers, or, with TG_STORAGE, storage buffers, for devices whose texel buffers
// hold little (render/vulkan). Elements are the same bytes; a buffer of four-vectors may be read by its numbers, too.
#ifdef TG_STORAGE
#define FETCHED_UINTS(slot, block, name) layout(std430, binding = slot) readonly buffer block { uint name[]; }
#define FETCHED_UVEC4S(slot, block, name) layout(std430, binding = slot) readonly buffer block { uvec4 name[]; }
#define FETCHED_VEC4S(slot, block, name) layout(std430, binding = slot) readonly buffer block { vec4 name[]; }
#define FETCH(name, i) name[i]
#define FETCH_UINT(name, i) name[i]
#else
#define FETCHED_UINTS(slot, block, name) layout(binding = slot) uniform usamplerBuffer name
#define FETCHED_UVEC4S(slot, block, name) layout(binding = slot) uniform usamplerBuffer name
#define FETCHED_VEC4S(slot, block, name) layout(binding = slot) uniform samplerBuffer name
#define FETCH(name, i) texelFetch(name, int(i))
#define FETCH_UINT(name, i) texelFetch(name, int(i)).x
#endif
