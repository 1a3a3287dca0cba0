// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <random>
#include <vector>

#include <revisit/core/scan.hpp>

namespace revisit::testing_support {

/// Points scattered about the sensor (normal, sigma 20 m in x and y), intensities even in [0, 1].
inline std::vector<Point> random_points(std::size_t count, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<float> at(0.f, 20.f);
  std::uniform_real_distribution<float> reading(0.f, 1.f);
  std::vector<Point> points(count);
  for (Point& p : points) p = {at(random), at(random), 0.f, reading(random)};
  return points;
}

}  // namespace revisit::testing_support
