// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include <revisit/core/intensity_calibration.hpp>
#include <revisit/core/pose.hpp>
#include <revisit/core/result.hpp>
#include <revisit/core/scan.hpp>

namespace revisit {

struct CalibrationReport {
  IntensityCalibration calibration;
  std::size_t patches = 0;       ///< surface patches seen from at least two distances
  std::size_t observations = 0;  ///< (patch, frame, ring) triples
  /// Spread of a patch's readings around their mean over the spread of all readings, on patches that were not learnt
  /// from: 0 = every patch always reads the same, near 1 = readings say nothing about the surface.
  double disagreement_before = 0.0, disagreement_after = 0.0;
};

/// Learns phi(eta, d) of eq. 1 from surfaces that were seen from several distances: patches (voxels of 0.3 m) of the
/// world should read the same from everywhere. Least squares in log intensity over one gain a distance knot and one a
/// ring, the patches' own brightness eliminated; an idea of Levinson and Thrun's unsupervised calibration.
class CalibrationLearner {
 public:
  /// Adds one scan, its intensities normalised with the identity calibration, and its pose. `rings` may be empty.
  /// Scans must overlap; every scan after the 200th is ignored.
  void add(const Scan& scan, const std::vector<std::uint16_t>& rings, const Pose& T_world_lidar);

  /// An error says what the recording lacks.
  Result<CalibrationReport> solve() const;

 private:
  struct Observation {
    std::uint64_t patch;
    float log_intensity, distance_m;
    std::uint16_t ring;
  };
  std::vector<Observation> observations_;
  std::size_t frames_ = 0, ring_count_ = 0;
  Eigen::Vector3d origin_ = Eigen::Vector3d::Zero();
};

}  // namespace revisit
