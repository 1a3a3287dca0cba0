// SPDX-License-Identifier: Apache-2.0
#include <revisit/preprocess/calibration_learning.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <span>

#include <Eigen/Cholesky>

namespace revisit {
namespace {

constexpr double kPatch_m = 0.3;
constexpr std::size_t kMostFrames = 200;
constexpr float kDarkest = 0.02f;  // the logarithm of less is noise of quantisation
constexpr std::size_t kFewestPatches = 500;
constexpr std::size_t kMostObservationsOfPatch = 64;
constexpr std::array kKnots_m = {2.0, 4.0, 6.0, 8.0, 10.0, 13.0, 16.0, 20.0, 25.0, 30.0, 40.0, 50.0, 65.0, 80.0};

std::uint64_t patch_key(const Eigen::Vector3d& p) {
  constexpr std::int64_t kOffset = 1 << 20;
  const auto index = [](double metres) {
    const auto cell = static_cast<std::int64_t>(std::floor(metres / kPatch_m)) + kOffset;
    return static_cast<std::uint64_t>(std::clamp<std::int64_t>(cell, 0, 2 * kOffset - 1));
  };
  return index(p.x()) << 42 | index(p.y()) << 21 | index(p.z());
}

// Which patches are learnt from and which are kept for the report: neighbours differ, and no run decides it.
bool is_held_out(std::uint64_t patch) { return (patch * 0x9E3779B97F4A7C15ull >> 63) != 0; }

// Non-zero entries of an observation's row: two distance knots (linear interpolation) and its ring.
struct Row {
  std::array<std::pair<int, double>, 3> entries;
};

Row design_row(double distance_m, std::uint16_t ring) {
  const auto upper = std::upper_bound(kKnots_m.begin(), kKnots_m.end(), distance_m);
  const auto hi = std::clamp<std::ptrdiff_t>(upper - kKnots_m.begin(), 1, kKnots_m.size() - 1);
  const auto i = static_cast<std::size_t>(hi);
  const double t = std::clamp((distance_m - kKnots_m[i - 1]) / (kKnots_m[i] - kKnots_m[i - 1]), 0.0, 1.0);
  return {{{{static_cast<int>(hi) - 1, 1.0 - t},
            {static_cast<int>(hi), t},
            {static_cast<int>(kKnots_m.size()) + ring, 1.0}}}};
}

// Spread within patches over spread of everything, in calibrated intensity.
template <typename Groups, typename Intensity>
double disagreement(const Groups& groups, Intensity intensity) {
  double within = 0.0, sum = 0.0, sum2 = 0.0;
  std::size_t count = 0;
  for (const auto& group : groups) {
    double group_sum = 0.0, group_sum2 = 0.0;
    for (const auto& each : group) {
      const double value = intensity(each);
      group_sum += value;
      group_sum2 += value * value;
    }
    within += group_sum2 - group_sum * group_sum / static_cast<double>(group.size());
    sum += group_sum;
    sum2 += group_sum2;
    count += group.size();
  }
  const double total = sum2 - sum * sum / static_cast<double>(std::max<std::size_t>(count, 1));
  return total > 0.0 ? std::sqrt(within / total) : 0.0;
}

}  // namespace

void CalibrationLearner::add(const Scan& scan, const std::vector<std::uint16_t>& rings, const Pose& T_world_lidar) {
  if (frames_++ >= kMostFrames) return;
  if (frames_ == 1) origin_ = T_world_lidar.translation();  // maps count from far away; patches from here
  // One observation a patch and ring: the mean of its points, so that dense near patches do not outvote the rest.
  struct Sample {
    std::uint64_t patch;
    std::uint16_t ring;
    float intensity, distance_m;
  };
  std::vector<Sample> samples;
  samples.reserve(scan.points.size());
  for (std::size_t i = 0; i < scan.points.size(); ++i) {
    const Point& p = scan.points[i];
    const Eigen::Vector3d at(p.x, p.y, p.z);
    const std::uint16_t ring = rings.empty() ? std::uint16_t{0} : rings[i];
    ring_count_ = std::max<std::size_t>(ring_count_, rings.empty() ? 0 : ring + 1u);
    samples.push_back({patch_key(T_world_lidar * at - origin_), ring, p.intensity, static_cast<float>(at.norm())});
  }
  std::stable_sort(samples.begin(), samples.end(), [](const Sample& a, const Sample& b) {
    return a.patch != b.patch ? a.patch < b.patch : a.ring < b.ring;
  });
  for (std::size_t begin = 0, end = 0; begin < samples.size(); begin = end) {
    float intensity = 0.f, distance_m = 0.f;
    for (end = begin;
         end < samples.size() && samples[end].patch == samples[begin].patch && samples[end].ring == samples[begin].ring;
         ++end) {
      intensity += samples[end].intensity;
      distance_m += samples[end].distance_m;
    }
    const auto n = static_cast<float>(end - begin);
    if (intensity / n >= kDarkest)
      observations_.push_back({samples[begin].patch, std::log(intensity / n), distance_m / n, samples[begin].ring});
  }
}

Result<CalibrationReport> CalibrationLearner::solve() const {
  std::vector<Observation> sorted = observations_;
  std::stable_sort(sorted.begin(), sorted.end(),
                   [](const Observation& a, const Observation& b) { return a.patch < b.patch; });
  const int unknowns = static_cast<int>(kKnots_m.size() + std::max<std::size_t>(ring_count_, 1));
  Eigen::MatrixXd A = Eigen::MatrixXd::Zero(unknowns, unknowns);
  Eigen::VectorXd b = Eigen::VectorXd::Zero(unknowns), weight = Eigen::VectorXd::Zero(unknowns);
  CalibrationReport report;
  std::vector<std::span<const Observation>> held_out;
  for (std::size_t begin = 0, end = 0; begin < sorted.size(); begin = end) {
    for (end = begin; end < sorted.size() && sorted[end].patch == sorted[begin].patch;) ++end;
    const std::span<const Observation> group(sorted.data() + begin, std::min(end - begin, kMostObservationsOfPatch));
    constexpr float kLeastChange_m = 1.f;
    const auto [near, far] = std::minmax_element(
        group.begin(), group.end(), [](const auto& x, const auto& y) { return x.distance_m < y.distance_m; });
    if (group.size() < 2 || far->distance_m - near->distance_m < kLeastChange_m) continue;
    ++report.patches;
    report.observations += group.size();
    if (is_held_out(group.front().patch)) {
      held_out.push_back(group);
      continue;
    }
    // sum over i of |x_i . g + l_i - m|^2 with the patch's brightness m at its best value, the mean.
    Eigen::VectorXd sum = Eigen::VectorXd::Zero(unknowns);
    double sum_log = 0.0;
    for (const Observation& each : group) {
      const Row row = design_row(each.distance_m, each.ring);
      for (const auto& [i, xi] : row.entries) {
        for (const auto& [j, xj] : row.entries) A(i, j) += xi * xj;
        b(i) -= xi * each.log_intensity;
        sum(i) += xi;
        weight(i) += xi;
      }
      sum_log += each.log_intensity;
    }
    const auto n = static_cast<double>(group.size());
    A.selfadjointView<Eigen::Lower>().rankUpdate(sum, -1.0 / n);
    b += sum * (sum_log / n);
  }
  if (report.patches < kFewestPatches)
    return Error{std::to_string(report.patches) + " surface patches were seen from distances at least 1 m apart; " +
                 std::to_string(kFewestPatches) + " are needed: a longer recording, or one that moves, will do"};
  A.triangularView<Eigen::StrictlyUpper>() = A.transpose();
  // Brightness as a whole is free, and so are knots and rings that nothing has seen: the ridge settles both at gain 1.
  A.diagonal().array() += 1e-3 * A.diagonal().mean() + 1e-9;
  Eigen::VectorXd gains = A.ldlt().solve(b);
  const auto knots = static_cast<int>(kKnots_m.size());
  const auto centre = [&](auto block, const auto& weights) {
    const double total = weights.sum();
    if (total > 0.0) block.array() -= block.dot(weights) / total;
  };
  centre(gains.head(knots), weight.head(knots));
  centre(gains.tail(unknowns - knots), weight.tail(unknowns - knots));

  report.calibration.distance_knots_m.assign(kKnots_m.begin(), kKnots_m.end());
  for (int i = 0; i < knots; ++i) report.calibration.distance_gains.push_back(std::exp(gains(i)));
  if (ring_count_ > 0)
    for (int i = knots; i < unknowns; ++i) report.calibration.ring_gains.push_back(std::exp(gains(i)));
  report.disagreement_before =
      disagreement(held_out, [](const Observation& each) { return std::exp(static_cast<double>(each.log_intensity)); });
  report.disagreement_after = disagreement(held_out, [&](const Observation& each) {
    return std::exp(static_cast<double>(each.log_intensity)) * report.calibration.distance_gain(each.distance_m) *
           report.calibration.ring_gain(each.ring);
  });
  return report;
}

}  // namespace revisit
