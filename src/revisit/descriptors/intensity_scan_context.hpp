// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <revisit/config/parameters.hpp>
#include <revisit/core/scan.hpp>

namespace revisit {

/// Intensity scan context Omega (paper, eqs. 2-5) and its binary image (eq. 6): a polar grid of `rings` x `sectors`
/// cells around the sensor. The image has a layer for each height level: in layer l, cells that hold a point higher
/// than the l-th level above the ground; with 0 levels it has one layer, of cells that hold any point, as in the paper.
/// Ring i holds rho in [i, i + 1) * L_max / N_r, sector j holds theta in [j, j + 1) * 2 pi / N_s - pi. Arrays are
/// sector-major: the column of sector j is contiguous.
struct IntensityScanContext {
  int rings = 0;    ///< N_r
  int sectors = 0;  ///< N_s
  int levels = 0;   ///< of height; 0 as in the paper
  std::vector<std::uint8_t>
      intensity;  ///< [sector * rings + ring]: largest intensity of the cell, 255 = 1.0; 0 if empty
  std::vector<std::uint64_t> occupancy;  ///< bit sector * rows() + layer * rings + ring, whatever the intensity

  /// Whether there are as many numbers as the grid has cells.
  bool is_consistent() const {
    return rings > 0 && sectors > 0 && levels >= 0 &&
           cells() == static_cast<std::size_t>(rings) * static_cast<std::size_t>(sectors) &&
           occupancy.size() == (image_cells() + 63) / 64;
  }
  void archive(auto& fields) {
    fields(rings, sectors, levels, intensity, occupancy);
    fields.require(is_consistent());
  }

  std::size_t cells() const { return intensity.size(); }
  int rows() const { return rings * std::max(1, levels); }  ///< of the image: rings of all layers
  bool occupied(int ring, int sector, int layer = 0) const {
    const auto bit = static_cast<std::size_t>(sector) * static_cast<std::size_t>(rows()) +
                     static_cast<std::size_t>(layer) * static_cast<std::size_t>(rings) + static_cast<std::size_t>(ring);
    return (occupancy[bit / 64] >> (bit % 64) & 1u) != 0;
  }
  int occupied_cells() const;  ///< of all layers, out of image_cells()
  std::size_t image_cells() const { return static_cast<std::size_t>(rows()) * static_cast<std::size_t>(sectors); }
};

/// A descriptor that lies elsewhere, in an index for instance.
struct DescriptorView {
  int rings = 0, sectors = 0, levels = 0;
  const std::uint8_t* intensity = nullptr;   ///< [sector * rings + ring]
  const std::uint64_t* occupancy = nullptr;  ///< as in IntensityScanContext

  DescriptorView(int n_r, int n_s, int n_levels, const std::uint8_t* intensities, const std::uint64_t* image)
      : rings(n_r), sectors(n_s), levels(n_levels), intensity(intensities), occupancy(image) {}
  DescriptorView(const IntensityScanContext& of)
      : DescriptorView(of.rings, of.sectors, of.levels, of.intensity.data(), of.occupancy.data()) {}
  int rows() const { return rings * std::max(1, levels); }
  std::size_t cells() const { return static_cast<std::size_t>(rings) * static_cast<std::size_t>(sectors); }
};

/// The share of the sectors in which anything was seen, [0, 1].
double seen_share(const DescriptorView& descriptor);

/// The layers of height (docs/method.md, section 4; chosen on simulated drives, seeds 23 and 24).
struct LayerConstants {
  static constexpr double kLowest_m = 0.5;  ///< of the first layer, above the ground
  static constexpr double kStep_m = 2.0;    ///< from layer to layer
  static constexpr int kFewestCells = 12;   ///< a scan with fewer occupied cells describes no place
};

/// The 8-bit form of an intensity in [0, 1]; values outside are cut, NaN is 0.
std::uint8_t quantise_intensity(float intensity);

/// Describes points with intensities in [0, 1]; points beyond options.max_range_m (in the x-y plane) are left out.
/// A pass over the points with SIMD chosen at run time; the cell of every point is that of exact arithmetic in double.
/// `ground_z_m`: where the ground below the sensor lies, in the sensor's frame; levels count from it.
/// Throws std::invalid_argument where the grid is outside the allowed range. Safe to call from several threads.
IntensityScanContext describe(std::span<const Point> points, const DescriptorOptions& options,
                              double ground_z_m = kGroundBelowCarSensor_m);

/// describe() into memory that is reused: allocates nothing from the second call on the same grid.
class Describer {
 public:
  explicit Describer(const DescriptorOptions& options);
  void describe(std::span<const Point> points, IntensityScanContext& result,
                double ground_z_m = kGroundBelowCarSensor_m);

 private:
  DescriptorOptions options_;
  std::vector<std::uint16_t>
      cells_;  ///< 0 = empty, 1 + quantised intensity otherwise; one more for points beyond the range
  std::vector<std::uint8_t> tops_;  ///< levels of the highest point of each cell
};

}  // namespace revisit
