// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <memory>
#include <span>

#include <Eigen/Core>

#include <revisit/core/state_archive.hpp>
#include <revisit/registration/surface.hpp>

namespace revisit {

/// The surroundings that were seen lately, as voxels of a grid: in each, the mean and the spread of the points that
/// fell into it, which give a patch of surface. Memory is bounded by what lies within reach, however long the drive.
/// Reading is safe from several threads while nothing is added.
class LocalMap final : public Surface {
 public:
  /// Throws std::invalid_argument for voxels or a reach that are not above 0.
  LocalMap(double voxel_m, double reach_m);
  ~LocalMap() override;
  LocalMap(LocalMap&&) noexcept;
  LocalMap& operator=(LocalMap&&) noexcept;

  /// Adds points in the map's frame, metres, finite.
  void add(std::span<const Eigen::Vector3f> points);
  /// Forgets what lies farther than the reach from `centre`, in the map's frame.
  void forget_far_from(const Eigen::Vector3f& centre);

  /// The nearest mean among the eight voxels around, if these know a surface there.
  bool nearest_patch(const Eigen::Vector3f& query, float squared_reach_m2, Patch& patch) const override;

  void archive(StateWriter& fields);
  void archive(StateReader& fields);

  std::size_t voxels() const;
  double voxel_m() const { return static_cast<double>(voxel_m_); }

 private:
  struct Voxels;
  float voxel_m_, reach_m_;
  std::unique_ptr<Voxels> voxels_;
};

}  // namespace revisit
