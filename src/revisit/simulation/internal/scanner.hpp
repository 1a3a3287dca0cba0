// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>

#include <revisit/core/pose.hpp>
#include <revisit/core/scan.hpp>
#include <revisit/simulation/internal/ray_scene.hpp>
#include <revisit/simulation/internal/world.hpp>
#include <revisit/simulation/sensor_model.hpp>

namespace revisit::simulation_internal {

/// A sensor on its vehicle in a world.
class Scanner {
 public:
  struct Options {
    double tilt_deg = 0.0, blind_deg = 0.0;
    bool motion_distortion = true;
    int threads = 0;  ///< 0: all
    std::string embree_options;
  };
  /// `world` must outlive the scanner.
  Scanner(const World& world, SensorModel sensor, const Options& options);

  /// Of the sensor, `time_s` after the start of the path, in the coordinates that the user knows.
  Pose T_world_lidar(double time_s) const;
  /// The sweep whose middle is at `time_s`. Safe from several threads; the same for any number of them.
  Scan sweep(std::int64_t frame, double time_s) const;

 private:
  struct Sweep;
  Pose T_local_lidar(double time_s) const;  ///< in the world's own coordinates, near its origin
  struct Return {
    Point point;
    bool is_there = false;
  };
  Eigen::Vector3f direction(const Sweep& sweep, std::size_t line, std::size_t column) const;
  void cast(const Sweep& sweep, std::size_t first, std::size_t count, Return* returns) const;
  Return measure(const Ray& ray, const Met& met, const Hit& hit, std::size_t line, float clear,
                 std::uint64_t key) const;
  void mix_at_edge(const Return& before, Return& here, std::uint64_t key) const;
  Hit look_at(const Sweep& sweep, const Ray& ray, const Met& met) const;
  bool is_hidden_by_carrier(const Eigen::Vector3f& direction) const;
  double falloff_at(double range_m) const;
  Met expect(const Ray& ray, const Met& neighbour) const;

  const World& world_;
  SensorModel sensor_;
  Options options_;
  RayScene scene_;
  std::vector<float> cos_elevation_, sin_elevation_, gain_, bias_m_;
  std::vector<double> falloff_;  ///< of readings with distance, a value each 0.25 m
};

}  // namespace revisit::simulation_internal
