// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <span>

#include <Eigen/Core>

#include <revisit/core/result.hpp>
#include <revisit/mapping/map_point.hpp>

namespace revisit::mapping_internal {

/// Writes points as glTF 2.0 (.glb) with 12 bytes each: positions as 16-bit numbers (KHR_mesh_quantization) of
/// `edge_m` / 65535 from `low`, `_INTENSITY` in 8 bits, and `_LABELS`: four bytes, intensity, session, and the time in
/// two, the lower first. The points, not empty, lie in the cube of `edge_m` at `low`. glTF's y points up: a node turns
/// the axes.
Status write_glb(const std::filesystem::path& file, std::span<const MapPoint> points, const Eigen::Vector3d& low,
                 double edge_m);

}  // namespace revisit::mapping_internal
