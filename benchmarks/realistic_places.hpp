// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include <revisit/pipeline/prepare.hpp>
#include <revisit/pipeline/recording_scale.hpp>
#include <revisit/preprocess/range_filter.hpp>
#include <revisit/retrieval/internal/place_store.hpp>
#include <revisit/simulation/simulated_recording.hpp>

namespace revisit::bench {

using retrieval_internal::PlaceStore;

/// Descriptors of simulated drives through towns (HDL-64E), and as many more places as are wanted, made of them.
class RealisticPlaces {
 public:
  explicit RealisticPlaces(const DescriptorOptions& grid) {
    for (const int seed : {101, 102, 103, 104}) {
      auto drive = describe_drive(grid, seed);
      for (std::size_t i = 0; i < drive.size(); ++i)
        (i % 50 == 25 ? seen_again_ : drives_).push_back(std::move(drive[i]));
    }
    elsewhere_ = describe_drive(grid, 105);
  }

  std::size_t drive_size() const { return drives_.size(); }

  /// Place `i`: of the drives; beyond them, of streets that are made of two others each: for 100 scans on end some
  /// sectors come from one drive, the rest from another, turned by one angle, 2 % of the cells changed from scan to
  /// scan. The same for the same i.
  IntensityScanContext place(std::size_t i) const {
    if (i < drives_.size()) return drives_[i];
    constexpr std::size_t kStreet = 100;
    std::mt19937_64 of_street(i / kStreet), of_scan(i);
    const IntensityScanContext& a = drives_[(of_street() + i % kStreet) % drives_.size()];
    const IntensityScanContext& b = drives_[(of_street() + i % kStreet) % drives_.size()];
    const auto sectors = static_cast<std::size_t>(a.sectors), rings = static_cast<std::size_t>(a.rings);
    const std::size_t from_a = 1 + of_street() % (sectors - 1), shift = of_street() % sectors;
    IntensityScanContext result = a;
    std::fill(result.occupancy.begin(), result.occupancy.end(), 0);
    for (std::size_t sector = 0; sector < sectors; ++sector)
      for (std::size_t ring = 0; ring < rings; ++ring) {
        const IntensityScanContext& source = sector < from_a ? a : b;
        const bool occupied =
            source.occupied(static_cast<int>(ring), static_cast<int>(sector)) != (of_scan() % 50 == 0);
        const std::size_t cell = (sector + shift) % sectors * rings + ring;
        const std::uint8_t reading = source.intensity[sector * rings + ring];
        result.intensity[cell] = occupied ? reading : 0;
        if (occupied) result.occupancy[cell / 64] |= std::uint64_t{1} << (cell % 64);
      }
    return result;
  }

  /// Scans of the drives that are not among the places, though their neighbours are.
  const std::vector<IntensityScanContext>& seen_again() const { return seen_again_; }
  /// Scans of a town that none of the places is in.
  const std::vector<IntensityScanContext>& elsewhere() const { return elsewhere_; }

 private:
  // Kept in a saved index: simulating takes a minute, reading it nothing.
  static std::vector<IntensityScanContext> describe_drive(const DescriptorOptions& grid, int seed) {
    const std::string folder = "out/bench";
    const std::string path = folder + "/drive_" + std::to_string(seed) + "_" + std::to_string(grid.rings) + "x" +
                             std::to_string(grid.sectors) + ".places";
    auto saved = PlaceStore::open(path);
    if (!saved) {
      std::fprintf(stderr, "describing a simulated drive: %s\n", path.c_str());
      std::filesystem::create_directories(folder);
      simulate_drive(grid, seed, path);
      saved = PlaceStore::open(path);
      if (!saved) throw std::runtime_error(saved.error().message);
    }
    const PlaceStore& store = **saved;
    std::vector<IntensityScanContext> result(store.size());
    for (std::size_t i = 0; i < result.size(); ++i) {
      const auto view = store.descriptor(i);
      if (!view) throw std::runtime_error(store.damage(i).message);
      result[i] = {view->rings,
                   view->sectors,
                   view->levels,
                   {view->intensity, view->intensity + view->cells()},
                   {view->occupancy,
                    view->occupancy + revisit_bits_words(static_cast<std::uint32_t>(view->rows() * view->sectors))}};
    }
    return result;
  }

  static void simulate_drive(const DescriptorOptions& grid, int seed, const std::string& path) {
    SimulationOptions options;
    options.seed = seed;
    const auto drive = simulate(options);
    if (!drive) throw std::runtime_error(drive.error().message);
    const auto scale = intensity_scale_of(**drive, {});
    if (!scale) throw std::runtime_error(scale.error().message);
    PlaceStore store;
    for (std::size_t i = 0; i < (*drive)->size(); ++i) {
      auto scan = (*drive)->read(i);
      if (!scan) throw std::runtime_error(scan.error().message);
      filter_range(*scan, PreprocessOptions{});
      normalise_intensity(*scan, *scale);
      store.add(scan->frame, scan->stamp_s, describe(scan->points, grid));
    }
    if (const Status written = store.save(path); !written) throw std::runtime_error(written.error().message);
  }

  std::vector<IntensityScanContext> drives_, seen_again_, elsewhere_;
};

}  // namespace revisit::bench
