// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include <Eigen/Core>

#include <revisit/descriptors/baseline.hpp>
#include <revisit/descriptors/internal/surface_voxels.hpp>

namespace revisit::descriptors_internal {

/// A corner that others are sure to find again.
struct TriangleKeypoint {
  Eigen::Vector3f position;
  Eigen::Vector3f normal;  ///< of the surface it was seen against
  std::uint64_t code = 0;  ///< what stands there; 0: nothing is known of it
};

struct TriangleOptions {
  std::size_t neighbours;  ///< of a keypoint, that it makes triangles with
  float longest_m;         ///< side
};

/// What STD and BTC have in common: a place is known by triangles between its keypoints, whose sides are the same
/// wherever the sensor stands. A triangle of the query votes for each place that has one like it: sides within a
/// hundredth, corners with like normals and codes. The 50 places with the most votes are compared: each pair of like
/// triangles gives a pose; the pose under which most pairs coincide is refined, and its score is the share of the
/// query's upright flat pieces that then lie on upright flat pieces of the place.
/// Signature: `values`: a triangle a column, three sides, shortest first, the keypoints opposite of them, and the
/// cosines between the normals of these, in the order of the longest side; `more`: position and normal of the
/// keypoints, then of flat pieces; `bits`: the codes.
Baseline::Signature triangle_signature(const std::vector<TriangleKeypoint>& keypoints,
                                       std::span<const SurfaceVoxel> voxels, const TriangleOptions& options);

/// A method whose signatures these are, of the last ten scans; each fifth is a place (in the papers: each tenth).
class TriangleMethod : public Baseline {
 public:
  Gives gives() const override { return Gives::kPose; }
  std::size_t scans() const override { return 10; }
  std::size_t place_every() const override { return 5; }
  double least_similarity() const override { return 0.0; }
  double similarity(const Signature& query, const Signature& place) const override;
  Pose T_place_query(const Signature& query, const Signature& place) const override;
  std::unique_ptr<BaselineIndex> make_index() const override;
};

}  // namespace revisit::descriptors_internal
