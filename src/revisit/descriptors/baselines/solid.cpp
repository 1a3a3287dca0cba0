// SPDX-License-Identifier: Apache-2.0
// Kim, Choi, Sim, Kim and Cho, "Narrowing your FOV with SOLiD: Spatially Organized and Lightweight Global Descriptor
// for FOV-constrained LiDAR Place Recognition", RA-L 2024: points are counted by range and elevation (40 x 32, from 3
// to 80 m, one a voxel of 0.4 m); elevations are weighted by how many points they hold, from 0 to 1; the weighted
// counts of the ranges are the descriptor, compared by cosine; those of 60 azimuths tell how a place is turned (L1).
// Elevations reach from -25 to 15 degrees here, for all sensors (in the authors' program they are set to the sensor's).
#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include <revisit/core/pose.hpp>
#include <revisit/descriptors/internal/baselines.hpp>

namespace revisit::descriptors_internal {
namespace solid {
namespace {

constexpr int kRanges = 40, kElevations = 32, kAzimuths = 60;
constexpr float kNearest_m = 3.f, kFarthest_m = 80.f, kVoxel_m = 0.4f;
constexpr double kLowest_deg = -25.0, kHighest_deg = 15.0;

// Whether a voxel is met for the first time.
class Voxels {
 public:
  bool is_new(const Point& p) {
    const auto cell = [](float metres, int cells) {
      return static_cast<std::size_t>(std::clamp(std::floor(metres / kVoxel_m) + 0.5f * static_cast<float>(cells), 0.f,
                                                 static_cast<float>(cells - 1)));
    };
    auto&& bit = met_[(cell(p.x, kAcross) * kAcross + cell(p.y, kAcross)) * kUp + cell(p.z, kUp)];
    if (bit) return false;
    return bit = true;
  }

 private:
  static constexpr int kAcross = 400, kUp = 128;
  std::vector<bool> met_ = std::vector<bool>(std::size_t{kAcross} * kAcross * kUp);
};

class Solid final : public Baseline {
 public:
  std::string name() const override { return "solid"; }
  std::string source() const override { return "Kim et al., RA-L 2024"; }

  Gives gives() const override { return Gives::kYaw; }

  // `values`: by range; `more`: by azimuth.
  Signature describe(std::span<const Point> points, double) const override {
    Eigen::MatrixXf counts = Eigen::MatrixXf::Zero(kRanges, kElevations);
    Eigen::MatrixXf around = Eigen::MatrixXf::Zero(kAzimuths, kElevations);
    Voxels voxels;
    for (const Point& p : points) {
      const float range_m = std::hypot(p.x, p.y);
      if (!(range_m >= kNearest_m && range_m < kFarthest_m) || !std::isfinite(p.z) || !voxels.is_new(p)) continue;
      const double elevation_deg = std::atan2(p.z, range_m) * 180.0 / kPi;
      const auto elevation =
          static_cast<int>(std::floor((elevation_deg - kLowest_deg) / (kHighest_deg - kLowest_deg) * kElevations));
      const auto range = static_cast<int>(range_m / kFarthest_m * kRanges);
      if (elevation < 0 || elevation >= kElevations) continue;
      const auto azimuth = static_cast<int>((std::atan2(p.y, p.x) / static_cast<float>(kPi) + 1.f) * kAzimuths / 2);
      counts(range, elevation) += 1.f;
      around(std::min(azimuth, kAzimuths - 1), elevation) += 1.f;
    }
    Eigen::VectorXf weights = counts.colwise().sum();
    const float least = weights.minCoeff(), span = weights.maxCoeff() - least;
    if (span > 0.f) weights = (weights.array() - least) / span;
    return {counts * weights, {}, around * weights};
  }

  double similarity(const Signature& query, const Signature& place) const override {
    const auto lengths = static_cast<double>(query.values.norm() * place.values.norm());
    return lengths > 0.0 ? static_cast<double>(query.values.col(0).dot(place.values.col(0))) / lengths : 0.0;
  }

  Pose T_place_query(const Signature& query, const Signature& place) const override {
    Eigen::Index best = 0;
    float least = std::numeric_limits<float>::infinity();
    for (Eigen::Index shift = 0; shift < kAzimuths; ++shift) {
      const Eigen::Index rest = kAzimuths - shift;
      const float difference = (query.more.topRows(rest) - place.more.bottomRows(rest)).lpNorm<1>() +
                               (query.more.bottomRows(shift) - place.more.topRows(shift)).lpNorm<1>();
      if (difference < least) least = difference, best = shift;
    }
    return pose_of_turn(best, kAzimuths);
  }
};

}  // namespace
}  // namespace solid

std::unique_ptr<Baseline> make_solid() { return std::make_unique<solid::Solid>(); }

}  // namespace revisit::descriptors_internal
