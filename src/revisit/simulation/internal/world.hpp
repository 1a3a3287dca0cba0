// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <revisit/config/parameters.hpp>
#include <revisit/core/log.hpp>
#include <revisit/core/result.hpp>
#include <revisit/simulation/internal/movers.hpp>
#include <revisit/simulation/internal/path.hpp>
#include <revisit/simulation/internal/roads.hpp>
#include <revisit/simulation/internal/terrain.hpp>

namespace revisit::simulation_internal {

/// What a place on the ground is made of, and how far it stands above the terrain (pavements).
struct Ground {
  Material material = Material::kFloor;
  float lift_m = 0.f;
};

/// What carries the sensor: a mast in the middle of a flat roof, which hides the ground beside the vehicle.
struct Vehicle {
  double roof_m = 1.43;  ///< above the ground
  double half_length_m = 0.95, half_width_m = 0.45;
};

/// Everything there is, and the way through it.
struct World {
  Path path;
  Terrain terrain;
  Roads roads;    ///< none in a warehouse
  Solids solids;  ///< what never moves
  Movers movers;
  std::vector<Eigen::Vector2d> featureless;  ///< middles of stretches without features
  std::uint64_t seed = 0;
  double difficulty = 0.0;  ///< docs/simulation.md
  Vehicle vehicle;
  /// What is added to give the coordinates that the user knows: inside, the drive starts near (0, 0, 0), so that floats
  /// hold every place to a tenth of a millimetre.
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();
  int day = 0;  ///< the world is the same on another day, but for what comes and goes

  /// Of what differs from day to day.
  std::uint64_t seed_of_day() const { return day == 0 ? seed : mix(seed, 211, static_cast<std::uint64_t>(day)); }

  /// In which foliage changes: longer than a place is in sight, and many between two days that are simulated.
  float season(double time_s) const {
    constexpr double kSeason_s = 100.0, kSeasonsADay = 37.3;
    return static_cast<float>(time_s / kSeason_s + kSeasonsADay * day);
  }

  Ground ground_at(float x, float y) const;
  /// Height of what stands at a place.
  double stand_z(double x, double y) const {
    return terrain.height(x, y) + static_cast<double>(ground_at(static_cast<float>(x), static_cast<float>(y)).lift_m);
  }
};

/// Kinds of neighbourhood in a town.
enum class District : std::uint8_t { kRows, kDetached, kCommercial, kPark, kFeatureless };
District district_at(const World& world, double x, double y);

/// A town along the path of options.trajectory, or along a drive through its own streets.
Result<World> build_town(const SimulationOptions& options, const LogSink& log);
/// A hall with a robot that leaves its dock and comes back the same way.
Result<World> build_warehouse(const SimulationOptions& options);

/// Storeys that look alike, walked through with a sensor in the hands.
Result<World> build_building(const SimulationOptions& options);

/// A drive of `length_m` through a network of streets: blocks around which it goes twice, the same way and the other
/// way, on either of two lanes. `streets` are all streets of the network near the drive.
struct StreetDrive {
  Path path;
  std::vector<std::vector<Knot>> streets;
};
StreetDrive drive_through_streets(double length_m, std::uint64_t seed);

/// From here on the world's path is the part that is driven, in the direction and as far beside it as the options say,
/// on their day. An error where nothing is left of it.
Status choose_drive(World& world, const SimulationOptions& options);

/// Who moves through the town while the sensor drives: none through walls, none in the sensor's way.
void plan_traffic(World& world, double traffic);

/// Fills the town along its roads, then chooses the drive, and lets traffic and people meet it.
Status populate_town(World& world, const SimulationOptions& options);

}  // namespace revisit::simulation_internal
