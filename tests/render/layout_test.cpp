// SPDX-License-Identifier: Apache-2.0
// GLSL and C++ place every member of the shared structs at the same byte.
#include <cstddef>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <string>

#include "shared/layout.h"
#include "support/catch.h"

using namespace tg;

namespace {

// Member offsets of the struct called `name` in what spirv-cross says of layout.comp.
std::map<std::string, std::size_t> reflectedOffsets(const nlohmann::json& reflection, const std::string& name) {
  std::map<std::string, std::size_t> offsets;
  for (const auto& type : reflection.at("types")) {
    if (type.at("name") != name) continue;
    for (const auto& member : type.at("members")) offsets[member.at("name")] = member.at("offset");
  }
  return offsets;
}

}  // namespace

TEST_CASE("the structs that cross host and device have one layout") {
  const std::string path = TG_LAYOUT_REFLECTION;
  TG_SKIP_IF(path.empty() ? "spirv-cross or glslangValidator was not found when the build was configured" : "");
  std::ifstream file(path);
  REQUIRE(file);
  const auto reflection = nlohmann::json::parse(file);
#define TG_OFFSET(S, M) {#M, offsetof(S, M)}
  const std::map<std::string, std::size_t> splat = {TG_OFFSET(Splat, center_depth_opacity),
                                                    TG_OFFSET(Splat, wx_r),
                                                    TG_OFFSET(Splat, wy_g),
                                                    TG_OFFSET(Splat, dx_b),
                                                    TG_OFFSET(Splat, dy_offset),
                                                    TG_OFFSET(Splat, d0_size)};
  const std::map<std::string, std::size_t> view = {TG_OFFSET(ViewUniforms, camera_from_world),
                                                   TG_OFFSET(ViewUniforms, camera_position),
                                                   TG_OFFSET(ViewUniforms, focal_center),
                                                   TG_OFFSET(ViewUniforms, background),
                                                   TG_OFFSET(ViewUniforms, width),
                                                   TG_OFFSET(ViewUniforms, height),
                                                   TG_OFFSET(ViewUniforms, tiles_x),
                                                   TG_OFFSET(ViewUniforms, tiles_y),
                                                   TG_OFFSET(ViewUniforms, gaussian_count),
                                                   TG_OFFSET(ViewUniforms, sh_degree),
                                                   TG_OFFSET(ViewUniforms, texture_mode),
                                                   TG_OFFSET(ViewUniforms, intersection),
                                                   TG_OFFSET(ViewUniforms, crop_min),
                                                   TG_OFFSET(ViewUniforms, crop_max),
                                                   TG_OFFSET(ViewUniforms, opacity_scale),
                                                   TG_OFFSET(ViewUniforms, splat_scale),
                                                   TG_OFFSET(ViewUniforms, near),
                                                   TG_OFFSET(ViewUniforms, exposure),
                                                   TG_OFFSET(ViewUniforms, sh_used),
                                                   TG_OFFSET(ViewUniforms, antialiasing),
                                                   TG_OFFSET(ViewUniforms, range_least),
                                                   TG_OFFSET(ViewUniforms, range_most),
                                                   TG_OFFSET(ViewUniforms, position_rest),
                                                   TG_OFFSET(ViewUniforms, forward_rest)};
  const std::map<std::string, std::size_t> record = {TG_OFFSET(SplatRecord, center_depth_opacity),
                                                     TG_OFFSET(SplatRecord, w_r),
                                                     TG_OFFSET(SplatRecord, d_g),
                                                     TG_OFFSET(SplatRecord, e_b),
                                                     TG_OFFSET(SplatRecord, u_offset),
                                                     TG_OFFSET(SplatRecord, v_size),
                                                     TG_OFFSET(SplatRecord, normal),
                                                     TG_OFFSET(SplatRecord, outline)};
#undef TG_OFFSET
  CHECK(reflectedOffsets(reflection, "Splat") == splat);
  CHECK(reflectedOffsets(reflection, "ViewUniforms") == view);
  CHECK(reflectedOffsets(reflection, "SplatRecord") == record);
  for (const auto& type : reflection.at("types")) {
    if (type.at("name") == "Splats") CHECK(type.at("members").at(0).at("array_stride") == sizeof(Splat));
    if (type.at("name") == "Records") CHECK(type.at("members").at(0).at("array_stride") == sizeof(SplatRecord));
  }
}
