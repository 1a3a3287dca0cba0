// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include <revisit/core/image.hpp>
#include <revisit/core/pose.hpp>
#include <revisit/simulation/internal/ray_scene.hpp>
#include <revisit/simulation/internal/world.hpp>
#include <revisit/simulation/simulated_recording.hpp>

namespace revisit::simulation_internal {

/// A pinhole camera that looks ahead from where the LiDAR is: 640 x 240 pixels, 90 degrees wide. Surfaces have a grain
/// of their own, the same at every visit; light does not: clouds come and go, the exposure follows, and at night there
/// is little but the vehicle's own lamp (inside, the lamps are off then).
class Camera {
 public:
  /// `world` must outlive the camera.
  explicit Camera(const World& world);

  /// `T_local_lidar`: in the world's own coordinates. Safe from several threads; the same for any number of them.
  Image picture(const Pose& T_local_lidar, double time_s, ImageLight light, std::uint64_t key) const;

 private:
  struct View;
  Met first_met(const View& view, const Ray& ray) const;
  void look(const View& view, std::size_t row, float* brightness) const;
  float brightness_at(const View& view, const Ray& ray, const Met& met) const;

  const World& world_;
  RayScene scene_;
};

}  // namespace revisit::simulation_internal
