// SPDX-License-Identifier: Apache-2.0
#include <revisit/pose_graph/internal/gravity_terms.hpp>

#include <algorithm>
#include <cmath>

namespace revisit::pose_graph_internal {
namespace {

struct Gravity {
  static constexpr double kOff_deg = 1.0;  ///< of accelerometers: data sheets say 20 to 150 mg/9.8, mounting as much
};

// What a reading says against a pose, an up and an error of the accelerometer.
struct UpError {
  Eigen::Vector3d up;
  double root;  ///< of weight and information
  template <typename T>
  bool operator()(const T* q_world_node, const T* up_world, const T* off, T* residual) const {
    using Vector = Eigen::Matrix<T, 3, 1>;
    const Eigen::Map<const Eigen::Quaternion<T>> q(q_world_node);
    const Vector here = up.cast<T>() - Eigen::Map<const Vector>(off);
    Eigen::Map<Vector> r(residual);
    r = T(root) * (q * here - Eigen::Map<const Vector>(up_world));
    return true;
  }
};

struct OffError {
  template <typename T>
  bool operator()(const T* off, T* residual) const {
    using Vector = Eigen::Matrix<T, 3, 1>;
    Eigen::Map<Vector> r(residual);
    r = Eigen::Map<const Vector>(off) / T(to_radians(Gravity::kOff_deg));
    return true;
  }
};

std::size_t at(int number) { return static_cast<std::size_t>(number); }

}  // namespace

// Up begins at the mean of what the readings say.
GravityTerms::GravityTerms(std::span<const UpReading> readings, const std::vector<Pose>& nodes) : readings_(readings) {
  for (const UpReading& each : readings) {
    up_.resize(std::max(up_.size(), at(each.part) + 1), Eigen::Vector3d::Zero());
    off_.resize(std::max(off_.size(), at(each.sensor) + 1), Eigen::Vector3d::Zero());
    up_[at(each.part)] += nodes[each.node].linear() * each.up;
  }
  for (Eigen::Vector3d& up : up_) up = up.isZero() ? Eigen::Vector3d::UnitZ() : up.normalized();
}

void GravityTerms::add_to(ceres::Problem& problem, const std::function<double*(std::size_t)>& rotation_of) {
  // NOLINTBEGIN(cppcoreguidelines-owning-memory): the problem's
  for (const UpReading& each : readings_) {
    if (each.weight <= 0.0) continue;
    double* const up = up_[at(each.part)].data();
    double* const off = off_[at(each.sensor)].data();
    const double root = std::sqrt(each.weight) / each.deviation_rad;
    problem.AddResidualBlock(new ceres::AutoDiffCostFunction<UpError, 3, 4, 3, 3>(new UpError{each.up, root}), nullptr,
                             rotation_of(each.node), up, off);
  }
  for (Eigen::Vector3d& up : up_)
    if (problem.HasParameterBlock(up.data())) problem.SetManifold(up.data(), new ceres::SphereManifold<3>);
  for (Eigen::Vector3d& off : off_)
    if (problem.HasParameterBlock(off.data()))
      problem.AddResidualBlock(new ceres::AutoDiffCostFunction<OffError, 3, 3>(new OffError), nullptr, off.data());
  // NOLINTEND(cppcoreguidelines-owning-memory)
}

double GravityTerms::squared_error(const UpReading& reading, const Eigen::Quaterniond& q_world_node) const {
  const Eigen::Vector3d off = q_world_node * (reading.up - off_[at(reading.sensor)]) - up_[at(reading.part)];
  return off.squaredNorm() / std::pow(reading.deviation_rad, 2);
}

}  // namespace revisit::pose_graph_internal
