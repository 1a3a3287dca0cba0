// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <limits>

#include <Eigen/Core>

#include <revisit/simulation/internal/material.hpp>

namespace revisit::simulation_internal {

/// A beam in world coordinates. `time_s` counts from the middle of the sweep; `key` is its own for each beam.
struct Ray {
  Eigen::Vector3f origin, direction;  ///< metres; unit length
  float time_s = 0.f;
  float season = 0.f;  ///< foliage grows and falls: what changes does so once a season
};

struct Hit {
  float range_m = std::numeric_limits<float>::infinity();
  Eigen::Vector3f normal = Eigen::Vector3f::UnitZ();
  Material material = Material::kAsphalt;
  std::uint32_t object = 0;  ///< surfaces of one object share their reflectance
};

enum class Shape : std::uint8_t {
  kBox,
  kWedge,     ///< a box whose two long sides lean in above `eaves`: gable roofs, car cabins
  kCylinder,  ///< upright, of radius half.x
  kEllipsoid,
  kFence,  ///< the plane y = 0 of the box, with gaps
  kCrown,  ///< an ellipsoid of leaves with air between
  kHedge,  ///< a box of leaves with air between
};

/// Windows and doors let into the walls of a box. Wall coordinates: along the wall from its corner, up from the ground.
struct Facade {
  float pitch_m, window_m, floor_m, sill_m, height_m, recess_m;
};
inline constexpr std::array<Facade, 7> kFacades = {{
    {1.f, 0.f, 3.f, 1.f, 1.f, 0.f},         // 0: a bare wall
    {2.6f, 1.2f, 2.9f, 0.9f, 1.4f, 0.18f},  // dwelling houses
    {3.4f, 1.1f, 2.8f, 0.8f, 1.5f, 0.22f},
    {2.1f, 1.3f, 3.1f, 0.7f, 1.8f, 0.12f},
    {3.0f, 2.4f, 3.6f, 0.8f, 2.2f, 0.10f},  // offices
    {6.0f, 4.0f, 5.5f, 0.0f, 3.8f, 0.35f},  // halls with gates
    {4.2f, 1.6f, 3.0f, 0.1f, 2.3f, 0.90f},  // balconies let in
}};

/// One simple shape standing upright, turned by a yaw. Its own frame: origin in the middle, z up.
struct Solid {
  Eigen::Vector3f centre = Eigen::Vector3f::Zero();    ///< world, at the middle of the sweep
  Eigen::Vector3f half = Eigen::Vector3f::Ones();      ///< half extents
  Eigen::Vector2f velocity = Eigen::Vector2f::Zero();  ///< world, m/s
  float cos_yaw = 1.f, sin_yaw = 0.f;
  float eaves = 0.f, rise = 0.f;  ///< wedge: z <= eaves + rise (1 - |y| / half.y)
  float ground = 0.f;             ///< height of the ground in the solid's own frame, where its facade starts
  std::uint32_t object = 0;
  Shape shape = Shape::kBox;
  Material material = Material::kPlaster, top_material = Material::kPlaster;
  std::uint8_t facade = 0;
  std::uint8_t filled = 64, changing = 0;  ///< of foliage, of 256 cells: those with leaves, those that seasons change
};

/// Where the ray meets the solid before `limit_m`, with `hit` filled in if it is given; infinity where it does not.
/// The same bits on every processor: plain float operations, no contraction (see the module's compile flags).
float intersect(const Solid& solid, const Ray& ray, float limit_m, Hit* hit = nullptr);

/// Half extents of the upright box around the solid, whatever its yaw.
Eigen::Vector3f bounding_half(const Solid& solid);

}  // namespace revisit::simulation_internal
