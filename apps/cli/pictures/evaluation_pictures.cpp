// SPDX-License-Identifier: Apache-2.0
#include "pictures/evaluation_pictures.hpp"

#include <algorithm>

#include <revisit/core/text.hpp>

#include "pictures/chart.hpp"

namespace revisit::cli {
namespace {

constexpr Colour kAll{0.12, 0.35, 0.70}, kReverse{0.90, 0.45, 0.05}, kLoop{0.85, 0.05, 0.05}, kFalse{0.0, 0.0, 0.0};

void draw_curve(Canvas& canvas, const Chart& chart, const Curve& curve) {
  std::vector<Pixel> line;
  for (const PrecisionRecall& point : curve.table->curve) line.push_back(chart.at(point.recall, point.precision));
  canvas.line(line, curve.colour, 2.5, curve.is_dashed);
  constexpr std::size_t kFew = 60;  // single answers can be told apart
  if (line.size() <= kFew)
    for (const Pixel& point : line) canvas.dot(point, 3.5, curve.colour);
}

void draw_legend_entry(Canvas& canvas, Pixel at, const Curve& curve) {
  const RetrievalTable& table = *curve.table;
  const std::string text =
      format("%s: %zu revisits, R@1 %.3f, F1max %.3f, AP %.3f, R@P100 %.3f", curve.name.c_str(), table.revisits,
             table.recall_at_1, table.f1_max, table.average_precision, table.recall_at_p100);
  canvas.line({at, {at.x + 30, at.y}}, curve.colour, 3, curve.is_dashed);
  canvas.text({at.x + 40, at.y}, text, 14);
}

}  // namespace

Status draw_precision_recall(const std::filesystem::path& file, const RetrievalTable& all,
                             const RetrievalTable& reverse) {
  std::vector<Curve> curves{{"all", &all, kAll}};
  if (reverse.revisits > 0) curves.push_back({"reverse", &reverse, kReverse});
  return draw_precision_recall(file, curves);
}

Status draw_precision_recall(const std::filesystem::path& file, const std::vector<Curve>& curves) {
  Canvas canvas(900, 700 + 28 * static_cast<int>(curves.size()));
  Chart chart(canvas, {90, 60, 770, 560}, {0.0, 1.02}, {0.0, 1.02});
  chart.draw_axes("precision over recall, top-1 answers, same place within 4 m", "recall", "precision");
  Pixel legend{90, 692};
  for (const Curve& curve : curves) {
    draw_curve(canvas, chart, curve);
    draw_legend_entry(canvas, legend, curve);
    legend.y += 28;
  }
  const auto each_is = [&](auto what) { return std::all_of(curves.begin(), curves.end(), what); };
  if (each_is([](const Curve& curve) { return curve.table->revisits == 0; }))
    canvas.text({475, 340}, "no revisits in this recording", 18, Align::kCentre);
  else if (each_is([](const Curve& curve) { return curve.table->curve.empty(); }))
    canvas.text({475, 340}, "no answers", 18, Align::kCentre);
  return canvas.save_png(file);
}

Status draw_trajectory(const std::filesystem::path& file, const Reference& reference, const LoopTable& loops,
                       const std::string& what) {
  const auto& entries = reference.trajectory().entries;
  Chart::Range x{1e30, -1e30}, y{1e30, -1e30};
  for (const auto& [frame, entry] : entries) {
    const Eigen::Vector3d p = entry.T_world_lidar.translation();
    x = {std::min(x.min, p.x()), std::max(x.max, p.x())};
    y = {std::min(y.min, p.y()), std::max(y.max, p.y())};
  }
  const double margin = std::max({5.0, 0.05 * (x.max - x.min), 0.05 * (y.max - y.min)});
  Canvas canvas(1000, 1000);
  Chart chart(canvas, {90, 60, 870, 810}, {x.min - margin, x.max + margin}, {y.min - margin, y.max + margin}, true);
  chart.draw_axes("trajectory from above, light to dark as time goes", "x (m)", "y (m)");
  const auto at = [&](const Pose& T) { return chart.at(T.translation().x(), T.translation().y()); };

  // Right loops lie under the trajectory as a red band, false ones over it.
  const auto draw_loops = [&](bool right) {
    for (const JudgedLoop& loop : loops.loops) {
      if (loop.right != right) continue;
      const Pixel query = at(*reference.trajectory().at(loop.query)),
                  match = at(*reference.trajectory().at(loop.match));
      canvas.line({match, query}, right ? kLoop : kFalse, right ? 4.0 : 1.5);
      canvas.dot(query, right ? 6.0 : 4.0, right ? kLoop : kFalse);
    }
  };
  draw_loops(true);
  // Segments between frames that follow each other; a gap in the recording stays a gap.
  std::size_t index = 0;
  const Pose* before = nullptr;
  constexpr double kLongestStep_m = 20.0;
  for (const auto& [frame, entry] : entries) {
    const double t = static_cast<double>(index++) / static_cast<double>(std::max<std::size_t>(1, entries.size() - 1));
    const Colour colour{0.80 - 0.75 * t, 0.88 - 0.70 * t, 1.0 - 0.55 * t};
    if (before != nullptr && (before->translation() - entry.T_world_lidar.translation()).norm() < kLongestStep_m)
      canvas.line({at(*before), at(entry.T_world_lidar)}, colour, 3);
    canvas.dot(at(entry.T_world_lidar), 2.5, colour);
    before = &entry.T_world_lidar;
  }
  draw_loops(false);
  const std::string text = format("%zu frames, %zu revisits, %zu %s (red), %zu of them false (black)", entries.size(),
                                  loops.revisits, loops.accepted, what.c_str(), loops.false_loops);
  canvas.text({525, 950}, text, 15, Align::kCentre);
  return canvas.save_png(file);
}

}  // namespace revisit::cli
