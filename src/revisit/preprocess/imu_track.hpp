// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <deque>
#include <optional>

#include <Eigen/Geometry>

#include <revisit/core/scan.hpp>

namespace revisit {

/// What the readings that come with scans say of the sensor: which way is up, and how it turns. Angular rates carry the
/// direction of up from reading to reading; accelerations, which are mostly gravity, pull it back slowly. Units of
/// acceleration do not matter. Scans come in the order of their stamps; those without readings are allowed. Belongs to
/// one thread at a time.
class ImuTrack {
 public:
  void add(const Scan& scan);
  void archive(auto& fields) {
    fields(recent_, last_scan_s_, up_now_, usual_acceleration_, followed_s_, up_, rate_in_sweep_, turn_since_last_);
  }

  /// Of the last scan, at its stamp, in its frame. Nothing where readings are missing around it.
  const std::optional<Eigen::Vector3f>& up() const { return up_; }
  /// Mean angular rate during its sweep.
  const std::optional<Eigen::Vector3d>& rate_in_sweep_radps() const { return rate_in_sweep_; }
  /// The rotation since the stamp of the scan before.
  const std::optional<Eigen::Matrix3d>& turn_since_last() const { return turn_since_last_; }

 private:
  struct Reading {
    double stamp_s = 0.0;
    Eigen::Vector3d angular_radps, acceleration;

    void archive(auto& fields) { fields(stamp_s, angular_radps, acceleration); }
  };
  void follow(const Reading& reading);
  bool covers(double from_s, double to_s) const;
  Eigen::Vector3d mean_rate(double from_s, double to_s) const;
  Eigen::Matrix3d turn(double from_s, double to_s) const;

  std::deque<Reading> recent_;
  std::optional<double> last_scan_s_;
  Eigen::Vector3d up_now_ = Eigen::Vector3d::Zero();  ///< at the last reading; zero where nothing is known
  double usual_acceleration_ = 0.0;                   ///< running mean of its length: gravity
  double followed_s_ = 0.0;                           ///< since readings began
  std::optional<Eigen::Vector3f> up_;
  std::optional<Eigen::Vector3d> rate_in_sweep_;
  std::optional<Eigen::Matrix3d> turn_since_last_;
};

}  // namespace revisit
