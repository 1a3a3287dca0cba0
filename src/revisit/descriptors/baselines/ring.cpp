// SPDX-License-Identifier: Apache-2.0
// Lu, Xu, Chen, Xiong and Wang, "One RING to Rule Them All: Radon Sinogram for Place Recognition, Orientation and
// Translation Estimation", RA-L 2022, and Xu, Lu et al., "RING++: Roto-Translation Invariant Gram for Global
// Localization on a Sparse Scan Map", T-RO 2023. A place is seen from above (120 x 120 cells, 140 m across), by what is
// occupied or, in RING++, by channels of local features. The magnitudes of its Radon transform's Fourier transform
// along the offsets do not change where the sensor is moved; turned places are found by circular correlation along the
// angles, where half a turn holds all magnitudes. The place is turned by that or by half a turn more, and moved by how
// far its projections are shifted, angle by angle. RING++ leaves open which features: here the six that eigenvalues of
// the points in a cell and those beside it give. Each frequency counts the same here (without, the lowest ones decide,
// and fewer places are found again). Points from half a metre above the ground count.
#include <algorithm>
#include <cmath>

#include <Eigen/QR>

#include <revisit/descriptors/internal/baselines.hpp>
#include <revisit/descriptors/internal/circular_correlation.hpp>
#include <revisit/descriptors/internal/overhead_features.hpp>

namespace revisit::descriptors_internal {
namespace ring {
namespace {

constexpr int kAngles = 120, kOffsets = 120, kFrequencies = kOffsets / 2;
constexpr OverheadGrid kGrid{120, 70.f};
constexpr float kAboveGround_m = 0.5f;
constexpr float kOffset_m = 2.f * kGrid.reach_m / kOffsets;

float angle_of(Eigen::Index row) { return static_cast<float>(kPi) * static_cast<float>(row) / kAngles; }

// Angles x offsets, of half a turn.
Eigen::MatrixXf sinogram_of(const OverheadCells& cells, Eigen::Index channel) {
  Eigen::MatrixXf sums = Eigen::MatrixXf::Zero(kAngles, kOffsets);
  for (Eigen::Index angle = 0; angle < kAngles; ++angle) {
    const Eigen::Vector2f normal(std::cos(angle_of(angle)), std::sin(angle_of(angle)));
    for (Eigen::Index cell = 0; cell < cells.centres.cols(); ++cell) {
      const float place = std::floor((normal.dot(cells.centres.col(cell)) + kGrid.reach_m) / kOffset_m);
      if (place < 0.f || place >= kOffsets) continue;  // the corners
      sums(angle, static_cast<Eigen::Index>(place)) += cells.features(channel, cell);
    }
  }
  return sums;
}

// Of its spectra: frequencies x angles, but for the mean, which says only how much there is.
Eigen::MatrixXf magnitudes_of(const Eigen::MatrixXf& spectra) {
  const auto real = spectra.middleCols(1, kFrequencies).array();
  const auto imaginary = spectra.rightCols(kFrequencies).array();
  return (real.square() + imaginary.square()).sqrt().matrix().transpose();
}

class Ring final : public Baseline {
 public:
  explicit Ring(bool has_channels) : has_channels_(has_channels) {}
  std::string name() const override { return has_channels_ ? "ring++" : "ring"; }
  std::string source() const override { return has_channels_ ? "Xu et al., T-RO 2023" : "Lu et al., RA-L 2022"; }
  Gives gives() const override { return Gives::kPlanarPose; }

  // `values`: spectra along the angles of each channel's magnitudes, of which each frequency has mean 0 and the same
  // length; `more`: spectra along the offsets of what is occupied.
  Signature describe(std::span<const Point> points, double ground_z_m) const override {
    const float lowest_m = static_cast<float>(ground_z_m) + kAboveGround_m;
    const OverheadCells occupied = occupied_cells(points, kGrid, lowest_m);
    const OverheadCells cells = has_channels_ ? eigenvalue_features(points, kGrid, lowest_m) : occupied;
    const Eigen::Index channels = cells.features.rows();
    Signature signature;
    signature.more = spectra_of_rows(sinogram_of(occupied, 0));
    Eigen::MatrixXf magnitudes(channels * kFrequencies, kAngles);
    for (Eigen::Index channel = 0; channel < channels; ++channel)
      magnitudes.middleRows(channel * kFrequencies, kFrequencies) =
          magnitudes_of(has_channels_ ? spectra_of_rows(sinogram_of(cells, channel)) : signature.more);
    for (auto row : magnitudes.rowwise()) {
      row.array() -= row.mean();
      if (const float length = row.norm(); length > 0.f)
        row /= length * std::sqrt(static_cast<float>(magnitudes.rows()));
    }
    signature.values = spectra_of_rows(magnitudes);
    return signature;
  }

  double similarity(const Signature& query, const Signature& place) const override {
    return static_cast<double>(circular_correlation(query.values, place.values, kAngles).maxCoeff());
  }

  Pose T_place_query(const Signature& query, const Signature& place) const override {
    Eigen::Index turn = 0;
    circular_correlation(query.values, place.values, kAngles).maxCoeff(&turn);
    const Moved one = moved(query.more, place.more, turn), other = moved(query.more, place.more, turn + kAngles);
    return one.agreement >= other.agreement ? one.T_place_query : other.T_place_query;
  }

 private:
  struct Moved {
    Pose T_place_query = Pose::Identity();
    float agreement = 0.f;
  };

  // The query, turned by so many angles, is moved by t: its projections onto the normals n lie shifted by n . t.
  static Moved moved(const Eigen::MatrixXf& query, const Eigen::MatrixXf& place, Eigen::Index turn) {
    Eigen::Matrix<float, kAngles, 2> normals;
    Eigen::Matrix<float, kAngles, 1> shifts, weights;
    Moved result;
    for (Eigen::Index row = 0; row < kAngles; ++row) {
      const Eigen::Index turned = row + turn;  // the angle of the place
      // Beyond half a turn offsets run backwards: the spectrum is conjugated, and the last offset becomes the first.
      const bool is_backwards = turned / kAngles % 2 == 1;
      Eigen::MatrixXf of_place = place.row(turned % kAngles);
      if (is_backwards) of_place.rightCols(kFrequencies + 1) *= -1.f;
      Eigen::Index shift = 0;
      weights[row] = circular_correlation(query.row(row), of_place, kOffsets).maxCoeff(&shift);
      if (is_backwards) --shift;
      shifts[row] = static_cast<float>(shift < kOffsets / 2 ? shift : shift - kOffsets) * kOffset_m;
      normals.row(row) << std::cos(angle_of(turned)), std::sin(angle_of(turned));
    }
    // Projections that show something else than the others would pull it away: robust, by weights (Cauchy).
    Eigen::Vector2f t = Eigen::Vector2f::Zero();
    for (int step = 0; step < 10; ++step) {
      const Eigen::VectorXf residuals = shifts - normals * t;
      const Eigen::VectorXf robust =
          weights.cwiseMax(0.f).array() / (1.f + (residuals.array() / (2.f * kOffset_m)).square());
      t = (normals.transpose() * robust.asDiagonal() * normals + Eigen::Matrix2f::Identity() * 1e-6f)
              .ldlt()
              .solve(normals.transpose() * robust.asDiagonal() * shifts);
    }
    result.agreement = weights.sum();
    result.T_place_query = planar_pose(static_cast<double>(t.x()), static_cast<double>(t.y()),
                                       wrap_angle(kPi * static_cast<double>(turn) / kAngles));
    return result;
  }

  bool has_channels_;
};

}  // namespace
}  // namespace ring

std::unique_ptr<Baseline> make_ring() { return std::make_unique<ring::Ring>(false); }
std::unique_ptr<Baseline> make_ring_pp() { return std::make_unique<ring::Ring>(true); }

}  // namespace revisit::descriptors_internal
