// SPDX-License-Identifier: Apache-2.0
#include <revisit/verification/typical_agreement.hpp>

#include <algorithm>
#include <cmath>

#include <revisit/registration/agreement.hpp>
#include <revisit/registration/icp.hpp>
#include <revisit/verification/geometric.hpp>

namespace revisit {
namespace {

struct Typical {
  static constexpr double kCoarse_m = 0.5, kSettled_m = 5e-3;  ///< of the registration of two scans in a row
  static constexpr double kStill_m = 0.05;                     ///< from the same spot, intensities would agree too well
  static constexpr double kNewShare = 0.3;  ///< of the newest pair in the running mean of inlier ratios and residuals
  static constexpr double kFewestInliers = 0.4;     ///< of a worse pair, odometry was wrong
  static constexpr std::size_t kFewestPairs = 10;   ///< before, the defaults are better
  static constexpr double kLeastCorrelation = 0.1;  ///< intensities that agree worse even here tell nothing elsewhere
  static constexpr double kLeastResidual = 0.02;    ///< of a sensor without noise
};

double running_mean(std::optional<double> mean, double newest) {
  return mean ? *mean + Typical::kNewShare * (newest - *mean) : newest;
}

}  // namespace

bool TypicalAgreementEstimate::add(const ScanGeometry& previous, const ScanGeometry& current,
                                   const Pose& T_previous_current) {
  // As well as they can agree: where odometry is off by a little, as in a turn on the spot, that is not the sensor's.
  const IcpResult icp = align_icp(previous.surface(), current.surface().points(), T_previous_current,
                                  {.coarse_m = Typical::kCoarse_m, .settled_m = Typical::kSettled_m});
  const PairScale scale(previous.surface(), current.surface());
  const Agreement agreement =
      measure_agreement(previous.surface(), current.surface(), icp.T_target_source, scale.inlier_distance_m());
  const double ratio = agreement.in_sight_ratio;
  if (ratio < Typical::kFewestInliers) return false;
  if (agreement.intensity_correlation && T_previous_current.translation().norm() > Typical::kStill_m)
    add_correlation(*agreement.intensity_correlation, 1);
  const double residual = agreement.rmse_m / scale.voxel_m;
  recent_ratio_ = running_mean(recent_ratio_, ratio);
  recent_residual_ = running_mean(recent_residual_, residual);
  ratio_sum_ += ratio;
  residual_sum_ += residual;
  ++ratio_pairs_;
  return true;
}

void TypicalAgreementEstimate::restore(const TypicalAgreement& typical, std::size_t pairs) {
  ratio_sum_ += static_cast<double>(pairs) * typical.in_sight_ratio;
  residual_sum_ += static_cast<double>(pairs) * typical.residual;
  ratio_pairs_ += pairs;
  add_correlation(typical.intensity_correlation, static_cast<std::uint32_t>(pairs));
}

void TypicalAgreementEstimate::add_correlation(double correlation, std::uint32_t times) {
  correlations_[static_cast<std::size_t>(std::lround(std::clamp(correlation, 0.0, 1.0) * kLastBin))] += times;
  correlation_pairs_ += times;
}

TypicalAgreement TypicalAgreementEstimate::overall() const {
  TypicalAgreement typical;
  if (ratio_pairs_ >= Typical::kFewestPairs) {
    typical.in_sight_ratio = ratio_sum_ / static_cast<double>(ratio_pairs_);
    typical.residual = std::max(Typical::kLeastResidual, residual_sum_ / static_cast<double>(ratio_pairs_));
  }
  if (correlation_pairs_ < Typical::kFewestPairs) return typical;
  std::size_t bin = 0, below = correlations_[0];
  while (2 * below < correlation_pairs_) below += correlations_[++bin];
  typical.intensity_correlation = std::max(Typical::kLeastCorrelation, static_cast<double>(bin) / kLastBin);
  return typical;
}

TypicalAgreement TypicalAgreementEstimate::recent() const {
  TypicalAgreement typical = overall();
  typical.in_sight_ratio = recent_ratio_.value_or(typical.in_sight_ratio);
  typical.residual = std::max(typical.residual, recent_residual_.value_or(0.0));
  return typical;
}

}  // namespace revisit
