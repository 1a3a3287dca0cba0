// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>

#include <revisit/core/pose.hpp>
#include <revisit/core/text.hpp>
#include <revisit/io/pose_file.hpp>
#include <revisit/simulation/internal/path.hpp>

namespace revisit::simulation_internal {
namespace {

constexpr double kLongestStep_m = 6.0;  // between rows without times: 60 m/s at 10 Hz
constexpr double kHighestSpeed_mps = 60.0;
constexpr double kLongestGap_s = 2.0;
constexpr double kLargestExtent_m = 8'000.0;

struct Stop {
  double time_s;
  Eigen::Vector3d position;
  Eigen::Vector3d forward;  // of the body, zero where unknown
};

Error problem(const std::filesystem::path& file, std::size_t pose, const std::string& what) {
  return {file.string() + ": pose " + std::to_string(pose + 1) + ": " + what};
}

// The axis of the body along which it travels: z for a camera, x or -x for a LiDAR.
Eigen::Vector3d travel_axis(const PoseFile& poses) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero(), sizes = sum;
  for (std::size_t i = 1; i < poses.rows.size(); ++i) {
    const Pose& T = poses.rows[i - 1].T_world_body;
    const Eigen::Vector3d step = T.linear().transpose() * (poses.rows[i].T_world_body.translation() - T.translation());
    sum += step;
    sizes += step.cwiseAbs();
  }
  Eigen::Index axis = 0;
  sizes.maxCoeff(&axis);
  return (sum[axis] < 0 ? -1.0 : 1.0) * Eigen::Vector3d::Unit(axis);
}

// Poses of a camera become a world whose z points up: x right, y down, z forward -> x forward, y left, z up.
std::vector<Stop> to_stops(const PoseFile& poses) {
  const Eigen::Vector3d axis = travel_axis(poses);
  const bool is_camera = poses.format == PoseFormat::kKitti && axis.z() != 0.0;
  Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
  if (is_camera) R << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  std::vector<Stop> stops;
  for (const PoseRow& row : poses.rows) {
    const double time_s = row.stamp_s ? *row.stamp_s : Path::kStep_s * static_cast<double>(row.frame->value);
    stops.push_back({time_s, R * row.T_world_body.translation(), R * (row.T_world_body.linear() * axis)});
  }
  return stops;
}

Status check(const std::filesystem::path& file, const std::vector<Stop>& stops, PoseFormat format) {
  if (stops.size() < 2) return Error{file.string() + ": holds 1 pose; a drive needs at least 2"};
  Eigen::Vector3d low = stops.front().position, high = low;
  for (std::size_t i = 1; i < stops.size(); ++i) {
    const double step_m = (stops[i].position - stops[i - 1].position).norm(),
                 gap_s = stops[i].time_s - stops[i - 1].time_s;
    if (!(gap_s > 0.0)) return problem(file, i, "its time does not increase");
    if (format == PoseFormat::kKitti && gap_s > 1.5 * Path::kStep_s)
      return problem(file, i, "frames before it have no pose (rows of NaN?); every frame needs one");
    if (gap_s > kLongestGap_s)
      return problem(file, i,
                     revisit::format("%.1f s after the one before; allowed: up to %.1f s", gap_s, kLongestGap_s));
    const double allowed_m =
        format == PoseFormat::kTum ? kHighestSpeed_mps * gap_s : kLongestStep_m * gap_s / Path::kStep_s;
    if (step_m > allowed_m)
      return problem(file, i,
                     revisit::format("a jump of %.1f m in %.2f s; allowed: up to %.1f m", step_m, gap_s, allowed_m));
    low = low.cwiseMin(stops[i].position);
    high = high.cwiseMax(stops[i].position);
  }
  if ((high - low).maxCoeff() > kLargestExtent_m)
    return Error{file.string() + ": the drive spans " + std::to_string((high - low).maxCoeff()) +
                 " m; allowed: up to " + std::to_string(kLargestExtent_m)};
  return ok();
}

// Headings of travel for stops that do not know theirs; one that stands keeps the last.
void add_headings(std::vector<Stop>& stops) {
  const std::size_t n = stops.size();
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t reach = 1; reach < 20; ++reach) {
      const Eigen::Vector3d way =
          stops[std::min(i + reach, n - 1)].position - stops[i >= reach ? i - reach : 0].position;
      if (way.head<2>().norm() < 0.3) continue;
      stops[i].forward = way;
      break;
    }
    if (stops[i].forward.isZero()) stops[i].forward = i > 0 ? stops[i - 1].forward : Eigen::Vector3d(1, 0, 0);
  }
}

Path resample(const std::vector<Stop>& stops) {
  std::vector<Knot> knots;
  const double begin_s = stops.front().time_s;
  const auto count = static_cast<std::size_t>(std::floor((stops.back().time_s - begin_s) / Path::kStep_s + 1e-6)) + 1;
  std::size_t i = 0;
  for (std::size_t k = 0; k < count; ++k) {
    const double time_s = begin_s + Path::kStep_s * static_cast<double>(k);
    while (i + 2 < stops.size() && stops[i + 1].time_s <= time_s + 1e-9) ++i;
    const Stop &a = stops[i], &b = stops[i + 1];
    const double t = std::clamp((time_s - a.time_s) / (b.time_s - a.time_s), 0.0, 1.0);
    const Eigen::Vector3d p = a.position + t * (b.position - a.position);
    const double yaw_a = std::atan2(a.forward.y(), a.forward.x()), yaw_b = std::atan2(b.forward.y(), b.forward.x());
    knots.push_back({p.x(), p.y(), wrap_angle(yaw_a + t * wrap_angle(yaw_b - yaw_a)), p.z()});
  }
  return Path(std::move(knots));
}

}  // namespace

Result<Path> read_path(const std::filesystem::path& file, const LogSink& log) {
  auto poses = read_poses(file);
  std::vector<Stop> stops;
  PoseFormat format = PoseFormat::kTum;
  if (poses) {
    if (poses->rows_without_pose > 0)
      return Error{file.string() + ": " + std::to_string(poses->rows_without_pose) +
                   " rows of NaN are frames without a pose; a drive needs a pose for every frame"};
    format = poses->format;
    stops = to_stops(*poses);
  } else {
    const auto positions = read_tum_positions(file);
    if (!positions) return poses.error();
    log_to(log, LogLevel::kWarning, poses.error().message + "; the heading is taken from the direction of travel");
    for (const auto& [time_s, position] : *positions) stops.push_back({time_s, position, Eigen::Vector3d::Zero()});
  }
  if (const Status status = check(file, stops, format); !status) return status.error();
  if (!poses) add_headings(stops);
  Path path = resample(stops);
  constexpr double kShortest_m = 1.0;
  if (path.length_m() < kShortest_m)
    return Error{file.string() + ": the drive is " + std::to_string(path.length_m()) + " m long; allowed: from " +
                 std::to_string(kShortest_m) + " m"};
  return path;
}

}  // namespace revisit::simulation_internal
