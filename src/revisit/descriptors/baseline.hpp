// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>

#include <revisit/core/scan.hpp>

namespace revisit {

/// A published place descriptor to compare with, written from its paper. A new one is one file in baselines/ that
/// implements this and a line in make_baselines(). Stateless: safe to share between threads.
class Baseline {
 public:
  /// What the method keeps of a scan, in shapes of its own.
  struct Signature {
    Eigen::MatrixXf values;
    std::vector<std::uint64_t> bits;
    std::size_t bytes() const {
      return static_cast<std::size_t>(values.size()) * sizeof(float) + bits.size() * sizeof(std::uint64_t);
    }
  };

  Baseline() = default;
  Baseline(const Baseline&) = delete;
  Baseline& operator=(const Baseline&) = delete;
  virtual ~Baseline() = default;

  virtual std::string name() const = 0;    ///< as the command line and the tables say it
  virtual std::string source() const = 0;  ///< the paper

  /// `points`: one scan, finite, metres, LiDAR frame, intensity in [0, 1]; `ground_z_m`: where the ground lies in that
  /// frame.
  virtual Signature describe(std::span<const Point> points, double ground_z_m) const = 0;

  /// What of a signature is kept once the scan is a place.
  virtual Signature kept(Signature signature) const { return signature; }

  /// How alike two places are; larger is more alike, the scale is the method's own.
  virtual double similarity(const Signature& query, const Signature& place) const = 0;

  /// Where the method compares only the places whose keys are nearest (Euclidean): the key, and how many.
  virtual Eigen::VectorXf key(const Signature&) const { return {}; }
  virtual std::size_t nearest_keys() const { return 0; }  ///< 0: every place is compared
};

/// All of them, in the order of the tables.
std::vector<std::unique_ptr<Baseline>> make_baselines();

}  // namespace revisit
