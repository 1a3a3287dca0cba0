// SPDX-License-Identifier: Apache-2.0
#include <revisit/io/pose_file.hpp>

#include <algorithm>
#include <cmath>
#include <iomanip>
#include <limits>

#include <revisit/io/internal/bytes.hpp>
#include <revisit/io/internal/text_writer.hpp>

namespace revisit {
namespace {

using io_internal::NumberRow;
using io_internal::TextWriter;

bool is_rotation(const Eigen::Matrix3d& R) {
  return R.allFinite() && (R * R.transpose() - Eigen::Matrix3d::Identity()).norm() < 1e-2 && R.determinant() > 0.0;
}

// Published poses are rounded to few digits: the nearest rotation makes products stay rigid.
Pose orthonormal(const Eigen::Matrix3d& R, const Eigen::Vector3d& t) {
  Pose T = Pose::Identity();
  T.linear() = Eigen::Quaterniond(R).normalized().toRotationMatrix();
  T.translation() = t;
  return T;
}

std::optional<Pose> from_matrix_row(const double* v) {
  Eigen::Matrix3d R;
  R << v[0], v[1], v[2], v[4], v[5], v[6], v[8], v[9], v[10];
  const Eigen::Vector3d t(v[3], v[7], v[11]);
  if (!is_rotation(R) || !t.allFinite()) return std::nullopt;
  return orthonormal(R, t);
}

std::optional<Pose> from_quaternion(const double* v) {  // x y z qx qy qz qw
  const Eigen::Quaterniond q(v[6], v[3], v[4], v[5]);
  const Eigen::Vector3d t(v[0], v[1], v[2]);
  if (!t.allFinite() || !(std::abs(q.norm() - 1.0) < 1e-2)) return std::nullopt;
  return orthonormal(q.normalized().toRotationMatrix(), t);
}

// What is wrong with a pose of seven numbers, for the message.
std::string quaternion_fault(const double* v) {
  const double norm = std::sqrt(v[3] * v[3] + v[4] * v[4] + v[5] * v[5] + v[6] * v[6]);
  return "not a rigid transform: a quaternion of norm " + std::to_string(norm) +
         "; allowed: 1 (does the row hold roll, pitch, yaw instead?)";
}

Error bad_row(const std::filesystem::path& file, std::size_t line, const std::string& what) {
  return {file.string() + ":" + std::to_string(line) + ": " + what};
}

Result<PoseFile> from_rows(const std::filesystem::path& file, const std::vector<NumberRow>& rows) {
  const std::size_t width = rows.front().values.size();
  if (width != 12 && width != 13 && width != 8)
    return bad_row(file, rows.front().line,
                   std::to_string(width) + " numbers; allowed: 12 (KITTI), 13 (frame and KITTI), 8 (TUM)");
  PoseFile poses;
  poses.format = width == 8 ? PoseFormat::kTum : PoseFormat::kKitti;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const auto& v = rows[i].values;
    if (v.size() != width)
      return bad_row(file, rows[i].line,
                     std::to_string(v.size()) + " numbers; allowed: " + std::to_string(width) + " as in the first row");
    PoseRow row;
    std::optional<Pose> pose;
    if (width == 8) {
      row.stamp_s = v[0];
      pose = std::isfinite(v[0]) ? from_quaternion(v.data() + 1) : std::nullopt;
    } else {
      if (std::all_of(v.end() - 12, v.end(), [](double x) { return std::isnan(x); })) {
        ++poses.rows_without_pose;
        continue;
      }
      const double frame = width == 13 ? v[0] : static_cast<double>(i);
      if (!(frame >= 0.0 && frame < 1e15) || frame != std::floor(frame))
        return bad_row(file, rows[i].line, std::to_string(frame) + " is no frame number");
      row.frame = FrameId{static_cast<std::int64_t>(frame)};
      pose = from_matrix_row(v.data() + (width - 12));
    }
    if (!pose)
      return bad_row(file, rows[i].line, width == 8 ? quaternion_fault(v.data() + 1) : "not a rigid transform");
    row.T_world_body = *pose;
    poses.rows.push_back(row);
  }
  return poses;
}

Result<PoseFile> from_g2o(const std::filesystem::path& file, const std::string& text) {
  PoseFile poses;
  poses.format = PoseFormat::kG2o;
  std::size_t line_number = 0;
  for (std::string_view line : io_internal::split_lines(text)) {
    ++line_number;
    constexpr std::string_view kVertex = "VERTEX_SE3:QUAT";
    if (line.substr(0, kVertex.size()) != kVertex) continue;
    const auto values = io_internal::parse_numbers(line.substr(kVertex.size()));
    if (!values || values->size() != 8)
      return bad_row(file, line_number, "a vertex needs 8 numbers: id x y z qx qy qz qw");
    const double id = (*values)[0];
    if (!(id >= 0.0 && id < 1e15)) return bad_row(file, line_number, std::to_string(id) + " is no vertex number");
    const auto pose = from_quaternion(values->data() + 1);
    if (!pose) return bad_row(file, line_number, quaternion_fault(values->data() + 1));
    poses.rows.push_back({FrameId{static_cast<std::int64_t>((*values)[0])}, std::nullopt, *pose});
  }
  return poses;
}

// Between two rows that are at most twice `max_gap_s` apart, interpolated; otherwise the nearer row within `max_gap_s`.
std::optional<Pose> pose_at(const std::map<double, Pose>& by_time, double stamp_s, double max_gap_s) {
  const auto after = by_time.lower_bound(stamp_s);
  if (after != by_time.end() && after->first - stamp_s < 1e-6) return after->second;
  const auto before = after == by_time.begin() ? by_time.end() : std::prev(after);
  if (before != by_time.end() && after != by_time.end() && after->first - before->first <= 2.0 * max_gap_s) {
    const double t = (stamp_s - before->first) / (after->first - before->first);
    const Eigen::Quaterniond q(before->second.linear());
    return orthonormal(q.slerp(t, Eigen::Quaterniond(after->second.linear())).toRotationMatrix(),
                       (1.0 - t) * before->second.translation() + t * after->second.translation());
  }
  if (before != by_time.end() && stamp_s - before->first <= max_gap_s) return before->second;
  if (after != by_time.end() && after->first - stamp_s <= max_gap_s) return after->second;
  return std::nullopt;
}

void write_quaternion(TextWriter& writer, const Pose& T) {
  const Eigen::Quaterniond q(T.rotation());
  for (const double value : {T.translation().x(), T.translation().y(), T.translation().z(), q.x(), q.y(), q.z(), q.w()})
    writer.stream() << ' ' << value;
}

}  // namespace

Result<PoseFile> read_poses(const std::filesystem::path& file) {
  const auto text = io_internal::read_bytes(file);
  if (!text) return text.error();
  Result<PoseFile> poses = Error{};
  if (text->find("VERTEX_") != std::string::npos) {
    poses = from_g2o(file, *text);
  } else {
    const auto rows = io_internal::read_number_rows(file);
    if (!rows) return rows.error();
    if (rows->empty()) return Error{file.string() + ": holds no poses"};
    poses = from_rows(file, *rows);
  }
  if (poses && poses->rows.empty()) return Error{file.string() + ": holds no poses"};
  return poses;
}

Result<std::vector<TimedPosition>> read_tum_positions(const std::filesystem::path& file) {
  const auto rows = io_internal::read_number_rows(file);
  if (!rows) return rows.error();
  std::vector<TimedPosition> positions;
  for (const NumberRow& row : *rows) {
    if (row.values.size() != 8)
      return bad_row(file, row.line, std::to_string(row.values.size()) + " numbers; allowed: 8 (TUM)");
    const Eigen::Vector3d position(row.values[1], row.values[2], row.values[3]);
    if (!std::isfinite(row.values[0]) || !position.allFinite())
      return bad_row(file, row.line, "a time or position is not finite");
    positions.push_back({row.values[0], position});
  }
  if (positions.empty()) return Error{file.string() + ": holds no poses"};
  return positions;
}

Status write_kitti_poses(const std::filesystem::path& file, const Trajectory& trajectory,
                         const std::optional<Pose>& T_camera_lidar) {
  constexpr std::int64_t kMostRows = 10'000'000;
  if (!trajectory.empty() && trajectory.entries.rbegin()->first.value >= kMostRows)
    return Error{file.string() + ": frame " + std::to_string(trajectory.entries.rbegin()->first.value) +
                 " needs a row of its own number; allowed: below " + std::to_string(kMostRows)};
  TextWriter writer(file);
  writer.stream() << std::setprecision(10);
  std::int64_t next = 0;
  const Pose Tr = T_camera_lidar.value_or(Pose::Identity());
  for (const auto& [frame, entry] : trajectory.entries) {
    for (; next < frame.value; ++next)
      for (int i = 0; i < 12; ++i) writer.stream() << "nan" << (i < 11 ? ' ' : '\n');
    const Pose T = Tr * entry.T_world_lidar * Tr.inverse();
    for (int i = 0; i < 12; ++i) writer.stream() << T.matrix()(i / 4, i % 4) << (i < 11 ? ' ' : '\n');
    ++next;
  }
  return writer.finish();
}

Status write_tum_poses(const std::filesystem::path& file, const Trajectory& trajectory) {
  TextWriter writer(file);
  for (const auto& [frame, entry] : trajectory.entries) {
    writer.stream() << std::fixed << std::setprecision(6) << entry.stamp_s << std::defaultfloat
                    << std::setprecision(10);
    write_quaternion(writer, entry.T_world_lidar);
    writer.stream() << '\n';
  }
  return writer.finish();
}

Status write_g2o_poses(const std::filesystem::path& file, const Trajectory& trajectory) {
  TextWriter writer(file);
  writer.stream() << std::setprecision(10);
  for (const auto& [frame, entry] : trajectory.entries) {
    writer.stream() << "VERTEX_SE3:QUAT " << frame.value;
    write_quaternion(writer, entry.T_world_lidar);
    writer.stream() << '\n';
  }
  return writer.finish();
}

Trajectory to_trajectory(const PoseFile& poses, const std::optional<Pose>& T_camera_lidar,
                         const std::vector<FrameTime>& stamps, double max_gap_s) {
  Trajectory trajectory;
  const Pose Tr = poses.format == PoseFormat::kKitti ? T_camera_lidar.value_or(Pose::Identity()) : Pose::Identity();
  std::map<FrameId, double> stamp_of;
  for (const FrameTime& each : stamps) stamp_of.emplace(each.frame, each.stamp_s);
  if (poses.format == PoseFormat::kTum) {
    std::map<double, Pose> by_time;
    for (const PoseRow& row : poses.rows) by_time.emplace(*row.stamp_s, row.T_world_body);
    for (const auto& [frame, stamp_s] : stamps) {
      if (const auto T = pose_at(by_time, stamp_s, max_gap_s)) trajectory.entries[frame] = {stamp_s, *T};
    }
    return trajectory;
  }
  for (const PoseRow& row : poses.rows) {
    const auto known = stamp_of.find(*row.frame);
    const double stamp_s = known != stamp_of.end() ? known->second : 0.1 * static_cast<double>(row.frame->value);
    trajectory.entries[*row.frame] = {stamp_s, Tr.inverse() * row.T_world_body * Tr};
  }
  return trajectory;
}

}  // namespace revisit
