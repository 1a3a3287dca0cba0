// SPDX-License-Identifier: Apache-2.0
// Intensity Scan Context with the paper's grid and scores (eqs. 2-10) and none of its thresholds: what the descriptor
// alone can tell. The ground is left out by its height.
#include <algorithm>
#include <iterator>
#include <utility>
#include <vector>

#include <revisit/descriptors/intensity_scan_context.hpp>
#include <revisit/descriptors/internal/baselines.hpp>
#include <revisit/descriptors/similarity.hpp>

namespace revisit::descriptors_internal {
namespace paper_isc {
namespace {

constexpr int kRings = 60, kSectors = 20;
constexpr float kAboveGround_m = 0.3f, kEmpty = -1.f;

IntensityScanContext to_context(const Eigen::MatrixXf& image) {
  IntensityScanContext context;
  context.rings = kRings;
  context.sectors = kSectors;
  context.intensity.resize(std::size_t{kRings} * kSectors);
  context.occupancy.resize((context.intensity.size() + 63) / 64);
  for (std::size_t cell = 0; cell < context.intensity.size(); ++cell) {
    const float value = image.data()[cell];
    if (value == kEmpty) continue;
    context.intensity[cell] = static_cast<std::uint8_t>(value);
    context.occupancy[cell / 64] |= std::uint64_t{1} << (cell % 64);
  }
  return context;
}

class PaperIsc final : public Baseline {
 public:
  std::string name() const override { return "isc-paper-scores"; }
  std::string source() const override { return "Wang et al., ICRA 2020, the paper's scores without its thresholds"; }

  Signature describe(std::span<const Point> points, double ground_z_m) const override {
    std::vector<Point> above;
    const float lowest = static_cast<float>(ground_z_m) + kAboveGround_m;
    std::copy_if(points.begin(), points.end(), std::back_inserter(above), [&](const Point& p) { return p.z > lowest; });
    DescriptorOptions options;
    options.rings = kRings;
    options.sectors = kSectors;
    options.levels = 0;
    options.max_range_m = 50.0;
    const IntensityScanContext context = revisit::describe(above, options);
    Eigen::MatrixXf image(kRings, kSectors);  // column by column, as the context's cells
    for (std::size_t cell = 0; cell < context.cells(); ++cell) {
      const bool is_occupied = (context.occupancy[cell / 64] >> (cell % 64) & 1u) != 0;
      image.data()[cell] = is_occupied ? static_cast<float>(context.intensity[cell]) : kEmpty;
    }
    return {std::move(image), {}};
  }

  Gives gives() const override { return Gives::kYaw; }
  double similarity(const Signature& query, const Signature& place) const override {
    return match(query, place).score();
  }
  Pose T_place_query(const Signature& query, const Signature& place) const override {
    return planar_pose(0.0, 0.0, match(query, place).yaw_rad);
  }

 private:
  static LoopCandidate match(const Signature& query, const Signature& place) {
    return match_descriptors(to_context(query.values), to_context(place.values));
  }
};

}  // namespace
}  // namespace paper_isc

std::unique_ptr<Baseline> make_paper_isc() { return std::make_unique<paper_isc::PaperIsc>(); }

}  // namespace revisit::descriptors_internal
