// SPDX-License-Identifier: Apache-2.0
#include "pictures/scan_pictures.hpp"

#include <cmath>

#include <revisit/core/text.hpp>

#include "pictures/chart.hpp"

namespace revisit::cli {
namespace {

constexpr Colour kEmpty{0.93, 0.93, 0.95}, kGround{0.80, 0.80, 0.80}, kGrid{0.55, 0.55, 0.60, 0.45};

void draw_from_above(Canvas& canvas, const PreparedScan& prepared, const Parameters& parameters) {
  const DescriptorOptions& options = parameters.descriptor;
  const double reach_m = options.max_range_m;
  Chart chart(canvas, {90, 70, 720, 720}, {-reach_m, reach_m}, {-reach_m, reach_m}, true);
  chart.draw_axes(parameters.preprocess.remove_ground ? "the scan from above; grey: ground, left out of the descriptor"
                                                      : "the scan from above; grey: ground, kept in the descriptor",
                  "x, forward (m)", "y, left (m)");
  canvas.clip(chart.box());
  const auto& points = prepared.scan.points;
  for (const bool ground : {true, false})  // what stands up is drawn over the ground
    for (std::size_t i = 0; i < points.size(); ++i) {
      if ((prepared.ground.is_ground[i] != 0) != ground) continue;
      const Pixel p = chart.at(points[i].x, points[i].y);
      canvas.fill({p.x - 0.7, p.y - 0.7, 1.4, 1.4}, ground ? kGround : scale_colour(points[i].intensity));
    }
  // Every fifth ring and some sixteen rays: the whole grid would hide the scan.
  const int ray_step = std::max(1, options.sectors / 20);
  for (int ring = 5; ring <= options.rings; ring += 5)
    canvas.ring(chart.at(0, 0), chart.pixels_per_x() * ring * reach_m / options.rings, kGrid);
  for (int sector = 0; sector < options.sectors; sector += ray_step) {
    const double angle = sector * 2.0 * kPi / options.sectors - kPi;
    canvas.line({chart.at(0, 0), chart.at(reach_m * std::cos(angle), reach_m * std::sin(angle))}, kGrid, 1.0);
  }
  canvas.dot(chart.at(0, 0), 4, {0.85, 0.1, 0.1});
  canvas.text({100, 778}, "circles: every 5th ring of the grid", 12);
  canvas.unclip();
}

void draw_descriptor(Canvas& canvas, const IntensityScanContext& descriptor, const DescriptorOptions& options) {
  const Box box{930, 70, 760, 620};
  Chart chart(canvas, box, {-180.0, 180.0}, {0.0, options.max_range_m});
  const std::string title = format(
      "intensity scan context: %d rings x %d sectors x %d layers, %d of %zu cells occupied", descriptor.rings,
      descriptor.sectors, descriptor.rows() / descriptor.rings, descriptor.occupied_cells(), descriptor.image_cells());
  chart.draw_axes(title, "azimuth (degrees)", "range (m)");
  const double width = box.width / descriptor.sectors, height = box.height / descriptor.rings;
  for (int sector = 0; sector < descriptor.sectors; ++sector)
    for (int ring = 0; ring < descriptor.rings; ++ring) {
      const auto value =
          descriptor.intensity[static_cast<std::size_t>(sector) * static_cast<std::size_t>(descriptor.rings) +
                               static_cast<std::size_t>(ring)];
      const Box cell{box.x + sector * width, box.y + box.height - (ring + 1) * height, width + 0.5, height + 0.5};
      canvas.fill(cell, descriptor.occupied(ring, sector) ? scale_colour(value / 255.0) : kEmpty);
    }
  canvas.frame(box, {0.3, 0.3, 0.3});
}

// What is nearer to the viewer, who stands on the right, hides nothing: all points are drawn.
void draw_from_the_side(Canvas& canvas, const PreparedScan& prepared, const DescriptorOptions& options) {
  const double reach_m = options.max_range_m;
  constexpr double kBelow_m = 4.0;
  const Box box{90, 880, 1600, 290};
  const double shown_m = 2.0 * reach_m * box.height / box.width;
  Chart chart(canvas, box, {-reach_m, reach_m}, {-kBelow_m, shown_m - kBelow_m});
  chart.draw_axes("the scan from its right side", "x, forward (m)", "z, up (m)");
  canvas.clip(box);
  const auto& points = prepared.scan.points;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (std::abs(static_cast<double>(points[i].y)) > reach_m) continue;
    const Pixel p = chart.at(points[i].x, points[i].z);
    canvas.fill({p.x - 0.6, p.y - 0.6, 1.2, 1.2},
                prepared.ground.is_ground[i] != 0 ? kGround : scale_colour(points[i].intensity));
  }
  canvas.dot(chart.at(0, 0), 4, {0.85, 0.1, 0.1});
  canvas.unclip();
}

void draw_legend(Canvas& canvas) {
  const Box bar{930, 760, 380, 18};
  for (int i = 0; i < 190; ++i) canvas.fill({bar.x + i * 2.0, bar.y, 2.5, bar.height}, scale_colour(i / 189.0));
  canvas.text({bar.x, bar.y + 32}, "0", 14);
  canvas.text({bar.x + bar.width, bar.y + 32}, "1", 14, Align::kRight);
  canvas.text({bar.x + bar.width / 2, bar.y + 32}, "intensity: of a point (left), largest of a cell (right)", 14,
              Align::kCentre);
  canvas.fill({1360, bar.y, 18, 18}, kEmpty);
  canvas.text({1388, bar.y + 9}, "empty cell", 14);
  canvas.fill({1510, bar.y, 18, 18}, kGround);
  canvas.text({1538, bar.y + 9}, "ground", 14);
}

}  // namespace

Status draw_description(const std::filesystem::path& file, const PreparedScan& prepared, const Parameters& parameters,
                        const std::string& title) {
  Canvas canvas(1730, 1230);
  canvas.text({865, 20}, title, 16, Align::kCentre);
  draw_from_above(canvas, prepared, parameters);
  draw_descriptor(canvas, prepared.descriptor, parameters.descriptor);
  draw_legend(canvas);
  draw_from_the_side(canvas, prepared, parameters.descriptor);
  return canvas.save_png(file);
}

}  // namespace revisit::cli
