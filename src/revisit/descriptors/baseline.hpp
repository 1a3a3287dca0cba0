// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>

#include <revisit/core/pose.hpp>
#include <revisit/core/scan.hpp>

namespace revisit {

class BaselineIndex;

/// A published place descriptor to compare with, written from its paper. A new one is one file in baselines/ that
/// implements this and a line in make_baselines(). Stateless: safe to share between threads.
class Baseline {
 public:
  /// What the method keeps of a scan, in shapes of its own.
  struct Signature {
    Eigen::MatrixXf values{};
    std::vector<std::uint64_t> bits{};
    Eigen::MatrixXf more{};
    std::size_t bytes() const {
      return static_cast<std::size_t>(values.size() + more.size()) * sizeof(float) +
             bits.size() * sizeof(std::uint64_t);
    }
  };

  /// What a method says of how the query lies to the place: nothing, its heading, also where it is in the plane, or the
  /// whole pose.
  enum class Gives : std::uint8_t { kPlace, kYaw, kPlanarPose, kPose };

  Baseline() = default;
  Baseline(const Baseline&) = delete;
  Baseline& operator=(const Baseline&) = delete;
  virtual ~Baseline() = default;

  virtual std::string name() const = 0;    ///< as the command line and the tables say it
  virtual std::string source() const = 0;  ///< the paper

  virtual Gives gives() const { return Gives::kPlace; }
  /// How many scans are described together, in the frame of the last one; more than one are laid together by odometry.
  virtual std::size_t scans() const { return 1; }
  /// Only each how-many-th scan is a place that can be the answer: where many scans are described together, those that
  /// follow each other hardly differ.
  virtual std::size_t place_every() const { return 1; }

  /// `points`: of that many scans, finite, metres, LiDAR frame, intensity in [0, 1]; `ground_z_m`: where the ground
  /// lies in that frame.
  virtual Signature describe(std::span<const Point> points, double ground_z_m) const = 0;

  /// What of a signature is kept once the scan is a place.
  virtual Signature kept(Signature signature) const { return signature; }

  /// How alike two places are; larger is more alike, the scale is the method's own.
  virtual double similarity(const Signature& query, const Signature& place) const = 0;
  /// What similarity() is where two places have nothing in common; such a place is no answer.
  virtual double least_similarity() const { return -std::numeric_limits<double>::infinity(); }

  /// Where the query stands in the frame of the place, as far as gives() says; what is not given is 0.
  virtual Pose T_place_query(const Signature& /*query*/, const Signature& /*place*/) const { return Pose::Identity(); }

  /// Where the method compares only the places whose keys are nearest (Euclidean): the key, and how many.
  virtual Eigen::VectorXf key(const Signature&) const { return {}; }
  virtual std::size_t nearest_keys() const { return 0; }  ///< 0: every place is compared

  /// Where a method finds the places to compare by an index of its own, instead of by keys.
  virtual std::unique_ptr<BaselineIndex> make_index() const;
};

/// What a method looks places up in. Belongs to one thread at a time.
class BaselineIndex {
 public:
  BaselineIndex() = default;
  BaselineIndex(const BaselineIndex&) = delete;
  BaselineIndex& operator=(const BaselineIndex&) = delete;
  virtual ~BaselineIndex() = default;

  /// Places are numbered as they are added, and stay where they are in memory as long as the index lives.
  virtual void add(const Baseline::Signature& place) = 0;
  /// Which of the first `searchable` places to compare with.
  virtual std::vector<std::size_t> look_up(const Baseline::Signature& query, std::size_t searchable) const = 0;
  virtual std::size_t bytes() const = 0;
};

/// All of them, in the order of the tables.
std::vector<std::unique_ptr<Baseline>> make_baselines();

}  // namespace revisit
