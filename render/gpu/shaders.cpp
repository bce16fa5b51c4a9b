// SPDX-License-Identifier: Apache-2.0
// The embedded modules.
#include "render/gpu/shaders.h"

#include <array>

#include "blend_comp.h"
#include "compact_comp.h"
#include "emit_keys_comp.h"
#include "output_range_comp.h"
#include "present_comp.h"
#include "project_comp.h"
#include "scan_apply_comp.h"
#include "scan_partitions_comp.h"
#include "scan_reduce_comp.h"
#include "solid_comp.h"
#include "sort_count_comp.h"
#include "sort_count_runs_comp.h"
#include "sort_scan_comp.h"
#include "sort_scatter_comp.h"
#include "sort_scatter_runs_comp.h"
#include "tile_ranges_comp.h"

namespace tg {
namespace {

// In the order of enum class Shader.
constexpr std::array<ShaderModule, 16> kModules = {{
    {project_comp, 5, 3},
    {scan_reduce_comp, 0, 4},
    {scan_partitions_comp, 0, 2},
    {scan_apply_comp, 0, 5},
    {compact_comp, 1, 5},
    {sort_count_comp, 0, 3},
    {sort_scan_comp, 0, 3},
    {sort_scatter_comp, 0, 7},
    {sort_count_runs_comp, 1, 2},
    {sort_scatter_runs_comp, 2, 5},
    {emit_keys_comp, 1, 6},
    {tile_ranges_comp, 1, 2},
    {blend_comp, 5, 6},
    {solid_comp, 6, 3},
    {output_range_comp, 0, 4},
    {present_comp, 0, 5, true},
}};

}  // namespace

const ShaderModule& moduleOf(Shader shader) { return kModules.at(static_cast<std::size_t>(shader)); }

}  // namespace tg
