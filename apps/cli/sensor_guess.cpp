// SPDX-License-Identifier: Apache-2.0
#include "sensor_guess.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include <revisit/core/pose.hpp>

namespace revisit::cli {
namespace {

struct KnownSensor {
  std::size_t rings;
  double lowest_deg, highest_deg;
  const char* name;
};

// From the makers' data sheets; the nearest vertical field of view among those with as many rings wins.
constexpr std::array kKnown = {
    KnownSensor{16, -15.0, 15.0, "VLP-16"},          KnownSensor{32, -30.67, 10.67, "HDL-32E"},
    KnownSensor{32, -25.0, 15.0, "VLP-32C"},         KnownSensor{40, -16.0, 7.0, "Pandar40"},
    KnownSensor{64, -24.8, 2.0, "HDL-64E"},          KnownSensor{64, -25.0, 15.0, "Pandar64"},
    KnownSensor{64, -16.6, 16.6, "OS1-64"},          KnownSensor{64, -45.0, 45.0, "OS0-64"},
    KnownSensor{64, -22.5, 22.5, "OS1-64 (rev. C)"}, KnownSensor{128, -25.0, 15.0, "VLS-128"},
    KnownSensor{128, -45.0, 45.0, "OS0-128"},        KnownSensor{128, -22.5, 22.5, "OS1-128"},
};

}  // namespace

SensorGuess guess_sensor(const Scan& scan, const Rings& rings) {
  SensorGuess guess;
  if (scan.points.empty()) return guess;
  std::array<bool, 360> seen{};
  std::vector<double> elevations;
  for (const Point& p : scan.points) {
    elevations.push_back(to_degrees(std::atan2(p.z, std::hypot(p.x, p.y))));
    const double azimuth = to_degrees(std::atan2(p.y, p.x)) + 180.0;
    seen[static_cast<std::size_t>(azimuth) % seen.size()] = true;
  }
  std::sort(elevations.begin(), elevations.end());
  guess.lowest_deg = elevations.front();
  guess.highest_deg = elevations.back();
  guess.horizontal_deg = static_cast<double>(std::count(seen.begin(), seen.end(), true));
  if (guess.horizontal_deg < 200.0) {
    guess.name = rings.source == RingSource::kNone ? "forward-looking, non-repetitive" : "forward-looking";
    return guess;
  }
  if (rings.source == RingSource::kNone) {
    const bool is_dome = std::abs(guess.lowest_deg + 7.0) < 3.0 && std::abs(guess.highest_deg - 52.0) < 3.0;
    guess.name = is_dome ? "Mid-360 or alike: all round, non-repetitive"
                         : "unknown: turns about, but no rings were found (a merged or thinned scan?)";
    return guess;
  }
  // The outermost rings, not points: vehicles that tilt and corrected scans smear the extremes.
  const double lowest = to_degrees(rings.elevations_rad.front()), highest = to_degrees(rings.elevations_rad.back());
  const auto misfit = [&](const KnownSensor& s) {
    return std::abs(s.lowest_deg - lowest) + std::abs(s.highest_deg - highest) +
           10.0 * std::abs(std::log2(static_cast<double>(rings.count()) / static_cast<double>(s.rings)));
  };
  const auto best = std::min_element(kKnown.begin(), kKnown.end(),
                                     [&](const auto& a, const auto& b) { return misfit(a) < misfit(b); });
  constexpr double kLargestMisfit = 6.0;
  guess.name = misfit(*best) < kLargestMisfit ? std::string(best->name) + " or alike"
                                              : "a rotating sensor of " + std::to_string(rings.count()) + " rings";
  return guess;
}

}  // namespace revisit::cli
