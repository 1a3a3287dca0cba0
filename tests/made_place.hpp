// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <random>
#include <vector>

#include <revisit/core/scan.hpp>

namespace revisit::testing_support {

// Walls on flat ground around a sensor 1.7 m above the ground, other ones for another seed.
inline std::vector<Point> made_place(unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> turn(-3.14159f, 3.14159f), range(5.f, 35.f), top(0.f, 8.f), shine(0.f, 1.f),
      length(0.5f, 9.f);
  std::vector<Point> points;
  for (int thing = 0; thing < 60; ++thing) {
    const float azimuth = turn(random), r = range(random), height = top(random), intensity = shine(random);
    const float heading = turn(random), half_m = length(random) / 2.f;
    for (float along = -half_m; along <= half_m; along += 0.2f)
      for (float z = -0.8f; z < height; z += 0.25f)
        points.push_back({r * std::cos(azimuth) + along * std::cos(heading),
                          r * std::sin(azimuth) + along * std::sin(heading), z, intensity});
  }
  for (float x = -40.f; x < 40.f; x += 0.6f)
    for (float y = -40.f; y < 40.f; y += 0.6f) points.push_back({x, y, -1.7f, 0.3f});
  return points;
}

// As seen from a sensor that is turned by -yaw.
inline std::vector<Point> turned(std::vector<Point> points, double yaw_rad) {
  const auto c = static_cast<float>(std::cos(yaw_rad)), s = static_cast<float>(std::sin(yaw_rad));
  for (Point& p : points) p = {c * p.x - s * p.y, s * p.x + c * p.y, p.z, p.intensity};
  return points;
}

// As seen from a sensor that stands elsewhere.
inline std::vector<Point> moved(std::vector<Point> points, float x_m, float y_m) {
  for (Point& p : points) p.x -= x_m, p.y -= y_m;
  return points;
}

}  // namespace revisit::testing_support
