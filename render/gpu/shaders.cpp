// SPDX-License-Identifier: Apache-2.0
// The embedded modules.
#include "render/gpu/shaders.h"

#include <array>

#include "blend_comp.h"
#include "blend_storage.h"
#include "blend_text.h"
#include "compact_comp.h"
#include "compact_storage.h"
#include "compact_text.h"
#include "emit_keys_comp.h"
#include "emit_keys_storage.h"
#include "emit_keys_text.h"
#include "output_range_comp.h"
#include "output_range_text.h"
#include "present_comp.h"
#include "present_text.h"
#include "project_comp.h"
#include "project_storage.h"
#include "project_text.h"
#include "scan_apply_comp.h"
#include "scan_apply_runs_comp.h"
#include "scan_apply_runs_storage.h"
#include "scan_apply_runs_text.h"
#include "scan_apply_text.h"
#include "scan_partitions_comp.h"
#include "scan_partitions_text.h"
#include "scan_reduce_comp.h"
#include "scan_reduce_runs_comp.h"
#include "scan_reduce_runs_storage.h"
#include "scan_reduce_runs_text.h"
#include "scan_reduce_text.h"
#include "solid_comp.h"
#include "solid_storage.h"
#include "solid_text.h"
#include "sort_count_comp.h"
#include "sort_count_runs_comp.h"
#include "sort_count_runs_storage.h"
#include "sort_count_runs_text.h"
#include "sort_count_text.h"
#include "sort_scan_comp.h"
#include "sort_scan_text.h"
#include "sort_scatter_comp.h"
#include "sort_scatter_runs_comp.h"
#include "sort_scatter_runs_storage.h"
#include "sort_scatter_runs_text.h"
#include "sort_scatter_text.h"
#include "tile_ranges_comp.h"
#include "tile_ranges_storage.h"
#include "tile_ranges_text.h"

namespace tg {
namespace {

// In the order of enum class Shader.
constexpr std::array<ShaderModule, 18> kModules = {{
    {"project", project_comp, project_text, 5, 3, false, project_storage},
    {"scan_reduce", scan_reduce_comp, scan_reduce_text, 0, 4},
    {"scan_partitions", scan_partitions_comp, scan_partitions_text, 0, 2},
    {"scan_apply", scan_apply_comp, scan_apply_text, 0, 5},
    {"scan_reduce_runs", scan_reduce_runs_comp, scan_reduce_runs_text, 2, 2, false, scan_reduce_runs_storage},
    {"scan_apply_runs", scan_apply_runs_comp, scan_apply_runs_text, 2, 3, false, scan_apply_runs_storage},
    {"compact", compact_comp, compact_text, 1, 5, false, compact_storage},
    {"sort_count", sort_count_comp, sort_count_text, 0, 3},
    {"sort_scan", sort_scan_comp, sort_scan_text, 0, 3},
    {"sort_scatter", sort_scatter_comp, sort_scatter_text, 0, 7},
    {"sort_count_runs", sort_count_runs_comp, sort_count_runs_text, 1, 2, false, sort_count_runs_storage},
    {"sort_scatter_runs", sort_scatter_runs_comp, sort_scatter_runs_text, 2, 5, false, sort_scatter_runs_storage},
    {"emit_keys", emit_keys_comp, emit_keys_text, 1, 6, false, emit_keys_storage},
    {"tile_ranges", tile_ranges_comp, tile_ranges_text, 1, 2, false, tile_ranges_storage},
    {"blend", blend_comp, blend_text, 5, 6, false, blend_storage},
    {"solid", solid_comp, solid_text, 6, 3, false, solid_storage},
    {"output_range", output_range_comp, output_range_text, 0, 4},
    {"present", present_comp, present_text, 0, 5, true},
}};

}  // namespace

const ShaderModule& moduleOf(Shader shader) { return kModules.at(static_cast<std::size_t>(shader)); }

std::span<const ShaderModule> shaderModules() { return kModules; }

}  // namespace tg
