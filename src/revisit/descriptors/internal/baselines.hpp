// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <revisit/descriptors/baseline.hpp>

namespace revisit::descriptors_internal {

/// Of a query whose column j, of `sectors` all round, lies on column j + `columns` of the place.
inline Pose pose_of_turn(Eigen::Index columns, Eigen::Index sectors) {
  return planar_pose(0.0, 0.0, wrap_angle(2.0 * kPi * static_cast<double>(columns) / static_cast<double>(sectors)));
}

/// A method whose images have a column a sector, all round: a turned sensor shifts the columns.
class TurnMethod : public Baseline {
 public:
  Gives gives() const override { return Gives::kYaw; }
  double similarity(const Signature& query, const Signature& place) const override {
    return best_turn(query, place).similarity;
  }
  Pose T_place_query(const Signature& query, const Signature& place) const override {
    return pose_of_turn(best_turn(query, place).columns, sectors_);
  }

 protected:
  explicit TurnMethod(Eigen::Index sectors) : sectors_(sectors) {}
  /// How alike the two are where column j of the query lies on column j + `columns` of the place.
  struct Turn {
    double similarity = 0.0;
    Eigen::Index columns = 0;
  };
  virtual Turn best_turn(const Signature& query, const Signature& place) const = 0;

 private:
  Eigen::Index sectors_;
};

std::unique_ptr<Baseline> make_paper_isc();
std::unique_ptr<Baseline> make_published_isc();
std::unique_ptr<Baseline> make_scan_context(std::size_t nearest_ring_keys);  ///< 0: every place is compared
std::unique_ptr<Baseline> make_scan_context_pp();
std::unique_ptr<Baseline> make_m2dp();
std::unique_ptr<Baseline> make_glarot3d();
std::unique_ptr<Baseline> make_lidar_iris();
std::unique_ptr<Baseline> make_landmark_density();
std::unique_ptr<Baseline> make_ring();
std::unique_ptr<Baseline> make_ring_pp();
std::unique_ptr<Baseline> make_contour_context();
std::unique_ptr<Baseline> make_stable_triangle();
std::unique_ptr<Baseline> make_binary_triangle();
std::unique_ptr<Baseline> make_solid();

}  // namespace revisit::descriptors_internal
