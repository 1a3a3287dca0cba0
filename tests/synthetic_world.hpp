// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <limits>
#include <ostream>
#include <random>
#include <vector>

#include <revisit/core/pose.hpp>
#include <revisit/core/scan.hpp>

namespace revisit::testing_support {

/// A flat world of boxes and poles with an exact ray caster: small scans with known truth for tests and benchmarks.
class SyntheticWorld {
 public:
  explicit SyntheticWorld(unsigned seed, double half_size_m = 60.0, int boxes = 40) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> place(-half_size_m, half_size_m), size(1.0, 8.0), height(1.5, 9.0),
        reflectance(0.05, 0.9);
    while (static_cast<int>(boxes_.size()) < boxes) {
      const double x = place(random), y = place(random), w = size(random), d = size(random);
      const bool pole = boxes_.size() % 4 == 3;
      const Box box{{x, y, 0.0}, {x + (pole ? 0.3 : w), y + (pole ? 0.3 : d), height(random)}, reflectance(random)};
      // The sensor drives along x; nothing may stand on its way.
      if (box.low.y() < 3.0 && box.high.y() > -3.0) continue;
      boxes_.push_back(box);
    }
  }

  struct Sensor {
    int rings = 64, columns = 1800;
    double lowest_deg = -24.8, highest_deg = 2.0, height_m = 1.73, max_range_m = 80.0, noise_m = 0.01;
    bool with_rings = false;
  };

  friend void PrintTo(const Sensor& sensor, std::ostream* out) { *out << sensor.rings << " lines"; }

  /// A scan from T_world_lidar (z of the ground is 0), points ring after ring from straight ahead, as KITTI stores
  /// them.
  Scan scan(const Pose& T_world_lidar, const Sensor& sensor, unsigned seed = 1) const {
    Scan result;
    std::mt19937 random(seed);
    std::normal_distribution<double> noise(0.0, sensor.noise_m > 0.0 ? sensor.noise_m : 1.0);
    for (int ring = 0; ring < sensor.rings; ++ring) {
      const double elevation = to_radians(sensor.highest_deg + (sensor.lowest_deg - sensor.highest_deg) * ring /
                                                                   std::max(1, sensor.rings - 1));
      for (int column = 0; column < sensor.columns; ++column) {
        const double azimuth = (column + 0.5) * 2.0 * kPi / sensor.columns;
        const Eigen::Vector3d direction(std::cos(elevation) * std::cos(azimuth),
                                        std::cos(elevation) * std::sin(azimuth), std::sin(elevation));
        double reflectance = 0.0;
        double range = cast(T_world_lidar.translation(), T_world_lidar.linear() * direction, reflectance);
        if (!(range < sensor.max_range_m)) continue;
        if (sensor.noise_m > 0.0) range += noise(random);
        const Eigen::Vector3d p = range * direction;
        result.points.push_back({static_cast<float>(p.x()), static_cast<float>(p.y()), static_cast<float>(p.z()),
                                 static_cast<float>(reflectance)});
        if (sensor.with_rings) result.rings.push_back(static_cast<std::uint16_t>(ring));
      }
    }
    return result;
  }

  /// The pose of a vehicle's sensor at (x, y) with the given heading.
  static Pose at(double x, double y, double yaw_rad, double height_m = 1.73) {
    Pose T = Pose::Identity();
    T.linear() = Eigen::AngleAxisd(yaw_rad, Eigen::Vector3d::UnitZ()).toRotationMatrix();
    T.translation() << x, y, height_m;
    return T;
  }

 private:
  struct Box {
    Eigen::Vector3d low, high;
    double reflectance;
  };

  double cast(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction, double& reflectance) const {
    double nearest = std::numeric_limits<double>::infinity();
    if (direction.z() < -1e-9) {
      nearest = -origin.z() / direction.z();
      const Eigen::Vector3d p = origin + nearest * direction;
      reflectance = (static_cast<long>(std::floor(p.x() / 4.0)) + static_cast<long>(std::floor(p.y() / 4.0))) % 2 == 0
                        ? 0.2
                        : 0.3;
    }
    for (const Box& box : boxes_) {
      const Eigen::Array3d a = (box.low - origin).array() / direction.array();
      const Eigen::Array3d b = (box.high - origin).array() / direction.array();
      const double enter = a.min(b).maxCoeff(), leave = a.max(b).minCoeff();
      if (enter > 0.0 && enter < leave && enter < nearest) {
        nearest = enter;
        reflectance = box.reflectance;
      }
    }
    return nearest;
  }

  std::vector<Box> boxes_;
};

}  // namespace revisit::testing_support
