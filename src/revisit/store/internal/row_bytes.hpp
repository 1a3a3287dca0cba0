// SPDX-License-Identifier: Apache-2.0
// How poses and matrices lie in a map's rows.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <optional>
#include <span>

#include <revisit/core/pose.hpp>

namespace revisit::store_internal {

using store_internal::Statement;

inline std::span<const std::byte> bytes_of(const Matrix6& matrix) {
  return std::as_bytes(std::span(matrix.data(), 36));
}

// x y z, then the quaternion x y z w.
inline std::array<double, 7> numbers_of(const Pose& T) {
  const Eigen::Quaterniond q(T.rotation());
  return {T.translation().x(), T.translation().y(), T.translation().z(), q.x(), q.y(), q.z(), q.w()};
}

// What is not finite or no rotation is none of ours.
inline std::optional<Pose> to_pose(std::span<const std::byte> bytes) {
  std::array<double, 7> v{};
  if (bytes.size() != sizeof v) return std::nullopt;
  std::memcpy(v.data(), bytes.data(), sizeof v);
  const Eigen::Quaterniond q(v[6], v[3], v[4], v[5]);
  constexpr double kFarthest_m = 1e7;
  const auto is_near = [](double metres) { return std::abs(metres) < kFarthest_m; };
  if (!(std::abs(q.norm() - 1.0) < 1e-3) || !is_near(v[0]) || !is_near(v[1]) || !is_near(v[2])) return std::nullopt;
  Pose T = Pose::Identity();
  T.linear() = q.normalized().toRotationMatrix();
  T.translation() << v[0], v[1], v[2];
  return T;
}

inline std::optional<Matrix6> to_matrix(std::span<const std::byte> bytes) {
  Matrix6 matrix;
  if (bytes.size() != 36 * sizeof(double)) return std::nullopt;
  std::memcpy(matrix.data(), bytes.data(), bytes.size());
  if (!matrix.allFinite() || !matrix.isApprox(matrix.transpose(), 1e-6)) return std::nullopt;
  return matrix;
}

/// Of a place, beside the index.
struct PoseRow {
  std::int64_t keyframe = 0, part = 0;
  std::array<double, 7> T_map_lidar{};
};
static_assert(sizeof(PoseRow) == 72);

}  // namespace revisit::store_internal
