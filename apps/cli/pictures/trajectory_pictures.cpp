// SPDX-License-Identifier: Apache-2.0
#include "pictures/trajectory_pictures.hpp"

#include <algorithm>

#include <revisit/core/text.hpp>

#include "pictures/chart.hpp"
#include "pictures/map_picture.hpp"
#include "reports/table.hpp"

namespace revisit::cli {
namespace {

constexpr Colour kReference{0.15, 0.45, 0.15}, kBefore{0.85, 0.2, 0.1}, kAfter{0.1, 0.3, 0.8};
constexpr int kPanel = 900, kHeight = 980;

// From the first frame that both have.
Pose from_the_start(const Trajectory& reference, const Trajectory& estimate) {
  for (const auto& [frame, entry] : estimate.entries)
    if (const auto pose = reference.at(frame)) return *pose * entry.T_world_lidar.inverse();
  return Pose::Identity();
}

void draw_line(Canvas& canvas, const Chart& chart, const Trajectory& trajectory, const Pose& T_reference_estimate,
               const Colour& colour, double width) {
  std::vector<Pixel> line;
  line.reserve(trajectory.entries.size());
  for (const auto& [frame, entry] : trajectory.entries) {
    const Eigen::Vector3d p = T_reference_estimate * entry.T_world_lidar.translation();
    line.push_back(chart.at(p.x(), p.y()));
  }
  canvas.line(line, colour, width);
}

}  // namespace

Status draw_trajectories(const std::filesystem::path& file, const Trajectory& reference, const JudgedTrajectory& before,
                         const JudgedTrajectory& after, const std::filesystem::path& cloud) {
  Chart::Range x{1e30, -1e30}, y{1e30, -1e30};
  const auto cover = [&](const Trajectory& trajectory, const Pose& T_reference_estimate) {
    for (const auto& [frame, entry] : trajectory.entries) {
      const Eigen::Vector3d p = T_reference_estimate * entry.T_world_lidar.translation();
      x = {std::min(x.min, p.x()), std::max(x.max, p.x())};
      y = {std::min(y.min, p.y()), std::max(y.max, p.y())};
    }
  };
  const Pose T_before = from_the_start(reference, before.trajectory), T_after = after.table.T_reference_estimate;
  cover(reference, Pose::Identity());
  cover(before.trajectory, T_before);
  const double margin_m = std::max({5.0, 0.05 * (x.max - x.min), 0.05 * (y.max - y.min)});
  Canvas canvas(2 * kPanel, kHeight);
  double left = 0.0;
  for (const bool is_after : {false, true}) {
    const JudgedTrajectory& judged = is_after ? after : before;
    Chart chart(canvas, {left + 80, 60, kPanel - 110, kHeight - 190}, {x.min - margin_m, x.max + margin_m},
                {y.min - margin_m, y.max + margin_m}, true);
    canvas.clip(chart.box());
    if (const Status status = draw_overview(canvas, chart, cloud, T_after); !status) return status;
    draw_line(canvas, chart, reference, Pose::Identity(), kReference, 4.0);
    draw_line(canvas, chart, judged.trajectory, is_after ? T_after : T_before, is_after ? kAfter : kBefore, 1.8);
    canvas.unclip();
    chart.draw_axes(is_after ? "with loop closing" : "odometry alone", "x (m)", "y (m)");
    canvas.text({left + kPanel / 2.0, kHeight - 60.0},
                format("absolute error after alignment %.3f m, at most %.3f m; %.0f m driven", judged.table.ate_m,
                       judged.table.worst_m, judged.table.length_m),
                15, Align::kCentre);
    left += kPanel;
  }
  canvas.text(
      {kPanel, kHeight - 25.0},
      "green: where it was. Odometry is laid on its first pose, so that drift shows; the corrected one as a whole.", 14,
      Align::kCentre);
  return canvas.save_png(file);
}

}  // namespace revisit::cli
