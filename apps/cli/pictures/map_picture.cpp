// SPDX-License-Identifier: Apache-2.0
#include "pictures/map_picture.hpp"

#include <algorithm>
#include <iterator>
#include <span>

#include <revisit/mapping/cloud_file.hpp>

namespace revisit::cli {
namespace {

constexpr int kSide = 1200;
constexpr double kMargin = 70.0;

// How many points stand over each pixel of the chart.
class Overview {
 public:
  explicit Overview(const Chart& chart)
      : chart_(chart),
        width_(static_cast<std::size_t>(chart.box().width)),
        counts_(width_ * static_cast<std::size_t>(chart.box().height)) {}

  void add(std::span<const Point> points, const Pose& T_chart_map) {
    for (const Point& p : points) {
      const Eigen::Vector3d q = T_chart_map * Eigen::Vector3d(p.x, p.y, p.z);
      const Pixel at = chart_.at(q.x(), q.y());
      const double x = at.x - chart_.box().x, y = at.y - chart_.box().y;
      if (x >= 0.0 && y >= 0.0 && x < static_cast<double>(width_))
        if (const auto index = static_cast<std::size_t>(y) * width_ + static_cast<std::size_t>(x);
            index < counts_.size())
          ++counts_[index];
    }
  }

  // As dark as the count, up to one that few pixels pass.
  void draw(Canvas& canvas) const {
    std::vector<int> sorted;
    std::copy_if(counts_.begin(), counts_.end(), std::back_inserter(sorted), [](int count) { return count > 0; });
    if (sorted.empty()) return;
    constexpr double kFew = 0.98;
    const auto high = sorted.begin() + static_cast<std::ptrdiff_t>(kFew * static_cast<double>(sorted.size()));
    std::nth_element(sorted.begin(), high, sorted.end());
    for (std::size_t i = 0; i < counts_.size(); ++i) {
      if (counts_[i] == 0) continue;
      const double grey = 0.9 - 0.8 * std::min(1.0, static_cast<double>(counts_[i]) / *high);
      const std::size_t row = i / width_, column = i % width_;
      canvas.fill({chart_.box().x + static_cast<double>(column), chart_.box().y + static_cast<double>(row), 1.0, 1.0},
                  {grey, grey, grey});
    }
  }

 private:
  const Chart& chart_;
  std::size_t width_;
  std::vector<int> counts_;
};

}  // namespace

Status draw_overview(Canvas& canvas, const Chart& chart, const std::filesystem::path& cloud, const Pose& T_chart_map) {
  std::error_code failure;
  if (!std::filesystem::exists(cloud, failure)) return ok();
  Overview overview(chart);
  const Status status = read_back(cloud, [&](std::span<const Point> points) { overview.add(points, T_chart_map); });
  overview.draw(canvas);
  return status;
}

Status draw_map(const std::filesystem::path& file, const std::filesystem::path& cloud,
                const std::vector<Pose>& T_world_keyframes) {
  if (T_world_keyframes.empty()) return ok();
  Chart::Range x{1e9, -1e9}, y{1e9, -1e9};
  for (const Pose& T : T_world_keyframes) {
    x = {std::min(x.min, T.translation().x()), std::max(x.max, T.translation().x())};
    y = {std::min(y.min, T.translation().y()), std::max(y.max, T.translation().y())};
  }
  const double border_m = std::max(15.0, 0.05 * std::max(x.max - x.min, y.max - y.min));
  Canvas canvas(kSide, kSide);
  Chart chart(canvas, {kMargin, 40.0, kSide - kMargin - 20.0, kSide - kMargin - 40.0},
              {x.min - border_m, x.max + border_m}, {y.min - border_m, y.max + border_m}, true);
  canvas.clip(chart.box());
  if (const Status status = draw_overview(canvas, chart, cloud, Pose::Identity()); !status) return status;
  std::vector<Pixel> line;
  line.reserve(T_world_keyframes.size());
  for (const Pose& T : T_world_keyframes) line.push_back(chart.at(T.translation().x(), T.translation().y()));
  canvas.line(line, {0.85, 0.2, 0.1, 0.9}, 1.5);
  canvas.unclip();
  chart.draw_axes("Map from above; the trajectory in red", "x, m", "y, m");
  return canvas.save_png(file);
}

}  // namespace revisit::cli
