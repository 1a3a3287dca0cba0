// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <cstdio>
#include <random>
#include <stdexcept>
#include <vector>

#include <revisit/pipeline/prepare.hpp>
#include <revisit/preprocess/range_filter.hpp>
#include <revisit/simulation/simulated_recording.hpp>

namespace revisit::bench {

/// Descriptors of simulated drives through towns, and as many more places as are wanted, made of them.
class RealisticPlaces {
 public:
  /// Two drives of 1 km, HDL-64E: some 2,500 scans, which take a minute.
  explicit RealisticPlaces(const DescriptorOptions& grid) {
    for (const int seed : {101, 102}) {
      std::fprintf(stderr, "describing a simulated drive, seed %d\n", seed);
      SimulationOptions options;
      options.seed = seed;
      const auto drive = simulate(options);
      if (!drive) throw std::runtime_error(drive.error().message);
      const auto scale = estimate_intensity_scale(**drive, Parameters{});
      if (!scale) throw std::runtime_error(scale.error().message);
      for (std::size_t i = 0; i < (*drive)->size(); ++i) {
        auto scan = (*drive)->read(i);
        filter_range(*scan, PreprocessOptions{});
        normalise_intensity(*scan, *scale);
        drive_.push_back(describe(scan->points, grid));
      }
    }
  }

  std::size_t drive_size() const { return drive_.size(); }

  /// Place `i`: of the drives, and beyond them a place whose sectors come in part from one, in part from another scan,
  /// with 2 % of its cells changed, turned by any angle. The same for the same i.
  IntensityScanContext place(std::size_t i) const {
    if (i < drive_.size()) return drive_[i];
    std::mt19937_64 random(i);
    const IntensityScanContext &a = drive_[i % drive_.size()], &b = drive_[random() % drive_.size()];
    const auto sectors = static_cast<std::size_t>(a.sectors), rings = static_cast<std::size_t>(a.rings);
    const std::size_t from_a = 1 + random() % (sectors - 1), shift = random() % sectors;
    IntensityScanContext result = a;
    std::fill(result.occupancy.begin(), result.occupancy.end(), 0);
    for (std::size_t sector = 0; sector < sectors; ++sector)
      for (std::size_t ring = 0; ring < rings; ++ring) {
        const IntensityScanContext& source = sector < from_a ? a : b;
        const bool occupied = source.occupied(static_cast<int>(ring), static_cast<int>(sector)) != (random() % 50 == 0);
        const std::size_t cell = (sector + shift) % sectors * rings + ring;
        const std::uint8_t reading = source.intensity[sector * rings + ring];
        result.intensity[cell] = occupied ? reading : 0;
        if (occupied) result.occupancy[cell / 64] |= std::uint64_t{1} << (cell % 64);
      }
    return result;
  }

  /// A scan of the drives seen again: 5 % of its cells changed.
  IntensityScanContext query(std::size_t i) const {
    std::mt19937_64 random(7 * i + 1);
    IntensityScanContext result = drive_[i * 131 % drive_.size()];
    for (std::size_t flips = 0; flips < result.cells() / 20; ++flips) {
      const std::size_t cell = random() % result.cells();
      result.occupancy[cell / 64] ^= std::uint64_t{1} << (cell % 64);
    }
    return result;
  }

 private:
  std::vector<IntensityScanContext> drive_;
};

}  // namespace revisit::bench
