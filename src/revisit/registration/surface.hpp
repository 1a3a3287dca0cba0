// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

namespace revisit {

/// What scans are registered onto: points with normals, found by nearness. Safe to read from several threads.
class Surface {
 public:
  struct Patch {
    Eigen::Vector3f point = Eigen::Vector3f::Zero();
    Eigen::Vector3f normal = Eigen::Vector3f::Zero();  ///< of unit length, sign arbitrary; zero where it is not known
    float variance_m2 = 0.f;  ///< of how far surfaces there lie from its plane; 0 where it is not known

    void archive(auto& fields) { fields(point, normal, variance_m2); }
  };

  Surface() = default;
  Surface(const Surface&) = default;
  Surface(Surface&&) = default;
  Surface& operator=(const Surface&) = default;
  Surface& operator=(Surface&&) = default;
  virtual ~Surface() = default;

  /// The nearest patch, metres in the surface's frame; false where none is nearer than the reach.
  virtual bool nearest_patch(const Eigen::Vector3f& query, float squared_reach_m2, Patch& patch) const = 0;
};

}  // namespace revisit
