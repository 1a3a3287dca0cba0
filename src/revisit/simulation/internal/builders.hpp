// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include <revisit/simulation/internal/random.hpp>
#include <revisit/simulation/internal/solid.hpp>

namespace revisit::simulation_internal {

/// Where a thing stands: the middle of its foot, its x axis turned by yaw.
struct Stand {
  double x = 0.0, y = 0.0, z = 0.0, yaw_rad = 0.0;
};

using Solids = std::vector<Solid>;

// Each appends the solids of one thing to `out`. `seed` decides its looks: the same seed, the same thing.
struct House {
  double width_m = 9.0, depth_m = 10.0, eaves_m = 6.0, roof_m = 3.0;  ///< width along x; roof_m = 0: a flat roof
  int facade = 1;
  Material walls = Material::kPlaster;
};
void add_house(Solids& out, const Stand& at, const House& house, std::uint64_t seed);
void add_tree(Solids& out, const Stand& at, double height_m, std::uint64_t seed);
void add_conifer(Solids& out, const Stand& at, double height_m, std::uint64_t seed);
void add_bush(Solids& out, const Stand& at, double size_m, std::uint64_t seed);
void add_hedge(Solids& out, const Stand& at, double length_m, double height_m, std::uint64_t seed);
void add_fence(Solids& out, const Stand& at, double length_m, double height_m, std::uint64_t seed);
void add_lamp(Solids& out, const Stand& at, std::uint64_t seed);
void add_sign(Solids& out, const Stand& at, std::uint64_t seed);
void add_post(Solids& out, const Stand& at, double height_m, double radius_m, Material material, std::uint64_t seed);
void add_box(Solids& out, const Stand& at, double length_m, double width_m, double bottom_m, double top_m,
             Material material, std::uint64_t seed);

enum class VehicleKind : std::uint8_t { kCar, kVan, kTruck, kLorry, kForklift };
void add_vehicle(Solids& out, const Stand& at, VehicleKind kind, std::uint64_t seed);
/// What is put beside a road for some days: bins, a skip, a heap, a scaffold, a stack; within 2.4 x 1 m.
void add_clutter(Solids& out, const Stand& at, std::uint64_t seed);
/// What stands about in a building: a box, a plant, a chair, a bin; within 1 x 0.7 m.
void add_furniture(Solids& out, const Stand& at, std::uint64_t seed);
void add_person(Solids& out, const Stand& at, std::uint64_t seed);

}  // namespace revisit::simulation_internal
