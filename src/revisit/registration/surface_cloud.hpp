// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include <revisit/core/scan.hpp>
#include <revisit/registration/seen_space.hpp>
#include <revisit/registration/surface.hpp>

namespace revisit {

/// A scan thinned to one point a voxel: small enough to keep for every place.
struct ThinCloud {
  std::vector<Eigen::Vector3f> points;  ///< centroids of the voxels, metres, LiDAR frame; in an order that depends on
                                        ///< the points alone
  std::vector<std::uint8_t> is_ground;  ///< one a point: most of its voxel lay on the ground
  std::vector<float> intensity;         ///< one a point: mean of its voxel, as far as the scan has been normalised
  float voxel_m = 1.f;
  Eigen::Vector3f up = Eigen::Vector3f::UnitZ();  ///< from the ground: another than z where the sensor is tilted
  SeenSpace seen;                                 ///< of the scan it was thinned from
  /// What scans shortly before saw and this one did not, in its frame; null where nobody asked (pipeline/narrow_view).
  std::shared_ptr<const ThinCloud> before;

  void archive(auto& fields) {
    fields(points, is_ground, intensity, voxel_m, up, seen);
    fields.require(is_ground.size() == points.size() && intensity.size() == points.size() && voxel_m > 0.f);
  }
};

/// A cloud and what was seen before it, as one.
ThinCloud with_before(ThinCloud cloud);

/// Thins `points`, which are finite, with cubic voxels of `voxel_m`; points more than 1,024 voxels out are taken
/// together. `is_ground` has one entry a point or is empty (nothing is ground). Throws std::invalid_argument for no
/// voxel size.
ThinCloud thin(std::span<const Point> points, std::span<const std::uint8_t> is_ground, double voxel_m);
/// Thins with the voxels that registration works on: 1 m, or half of it where a scan fills so few of them, as indoors,
/// that they show little of the place.
ThinCloud thin_for_registration(std::span<const Point> points, std::span<const std::uint8_t> is_ground);
/// The same as thin() without the space that was seen.
ThinCloud thin_surfaces(std::span<const Point> points, std::span<const std::uint8_t> is_ground, double voxel_m);

/// What a scan could see, as its points show it: without the few that lie farthest out.
struct SensorView {
  float farthest_m = 0.f;                         ///< of the points above ground
  float least_slope = 0.f, greatest_slope = 0.f;  ///< height over horizontal range, in the LiDAR's frame
  SeenSpace::Sector sector;
  bool is_roofed = false;             ///< SeenSpace::is_roofed()
  bool is_open_to_the_sides = false;  ///< SeenSpace::is_open_to_the_sides()

  bool holds(const Eigen::Vector3f& p) const {
    const float across_m = p.head<2>().norm();
    return p.squaredNorm() <= farthest_m * farthest_m && p.z() >= least_slope * across_m &&
           p.z() <= greatest_slope * across_m && sector.holds(p.head<2>());
  }
};

/// A thin cloud with what registration needs of it: normals and neighbours. Safe to share between threads.
class SurfaceCloud final : public Surface {
 public:
  explicit SurfaceCloud(ThinCloud cloud);
  ~SurfaceCloud() override;
  SurfaceCloud(SurfaceCloud&&) noexcept;
  SurfaceCloud& operator=(SurfaceCloud&&) noexcept;

  const ThinCloud& cloud() const { return cloud_; }
  std::size_t size() const { return cloud_.points.size(); }
  std::span<const Eigen::Vector3f> points() const { return cloud_.points; }
  std::span<const Eigen::Vector3f> normals() const { return normals_; }
  const Eigen::Vector3f& point(std::size_t i) const { return cloud_.points[i]; }
  /// Unit normal, sign arbitrary; zero where the neighbours are fewer than five or on one line.
  const Eigen::Vector3f& normal(std::size_t i) const { return normals_[i]; }
  bool is_ground(std::size_t i) const { return cloud_.is_ground[i] != 0; }
  /// Unit vector from the ground, LiDAR frame (ThinCloud::up).
  const Eigen::Vector3f& up() const { return cloud_.up; }
  /// Edge of the voxels that the cloud was thinned with.
  double voxel_m() const { return static_cast<double>(cloud_.voxel_m); }
  /// No room, as far as one scan shows: it fills many voxels, or sees farther than rooms reach, or sees all round and
  /// is not closed in; and has no roof. Beams that hardly look up meet crowns and houses for a roof: it counts where
  /// they see no farther than halls reach. A narrow sensor fills few voxels anywhere.
  bool is_in_the_open() const;
  float intensity(std::size_t i) const { return cloud_.intensity[i]; }
  const SeenSpace& seen() const { return cloud_.seen; }
  const SensorView& view() const { return view_; }

  struct Neighbour {
    std::size_t index = 0;
    float squared_distance_m2 = 0.f;
  };
  /// The nearest point; none where no point is nearer than the reach.
  std::optional<Neighbour> nearest(const Eigen::Vector3f& query,
                                   float squared_reach_m2 = std::numeric_limits<float>::infinity()) const;
  bool nearest_patch(const Eigen::Vector3f& query, float squared_reach_m2, Patch& patch) const override;

 private:
  struct Grid;
  ThinCloud cloud_;
  SensorView view_;
  std::vector<Eigen::Vector3f> normals_;
  std::unique_ptr<Grid> grid_;
};

}  // namespace revisit
