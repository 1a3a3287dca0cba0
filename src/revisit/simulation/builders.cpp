// SPDX-License-Identifier: Apache-2.0
#include <revisit/simulation/internal/builders.hpp>

#include <algorithm>
#include <cmath>

namespace revisit::simulation_internal {
namespace {

constexpr double kFoundation_m = 3.0;  // houses reach below the ground, which may slope

// A solid whose middle lies at (x, y, z) in the stand's frame, z above its foot.
Solid& add(Solids& out, const Stand& at, Shape shape, const Eigen::Vector3d& middle, const Eigen::Vector3d& half,
           Material material, std::uint64_t seed, double turn_rad = 0.0) {
  const double c = std::cos(at.yaw_rad), s = std::sin(at.yaw_rad), yaw = at.yaw_rad + turn_rad;
  Solid solid;
  solid.shape = shape;
  solid.centre =
      Eigen::Vector3d(at.x + c * middle.x() - s * middle.y(), at.y + s * middle.x() + c * middle.y(), at.z + middle.z())
          .cast<float>();
  solid.half = half.cast<float>();
  solid.cos_yaw = static_cast<float>(std::cos(yaw));
  solid.sin_yaw = static_cast<float>(std::sin(yaw));
  solid.material = solid.top_material = material;
  solid.object = static_cast<std::uint32_t>(mix(seed) >> 32);
  out.push_back(solid);
  return out.back();
}

}  // namespace

void add_house(Solids& out, const Stand& at, const House& house, std::uint64_t seed) {
  Random random(seed);
  const double height = house.eaves_m + house.roof_m + kFoundation_m, middle = 0.5 * height - kFoundation_m;
  Solid& walls = add(out, at, house.roof_m > 0.0 ? Shape::kWedge : Shape::kBox, {0, 0, middle},
                     {0.5 * house.width_m, 0.5 * house.depth_m, 0.5 * height}, house.walls, seed);
  walls.facade = static_cast<std::uint8_t>(house.facade);
  walls.ground = static_cast<float>(-middle);
  walls.eaves = static_cast<float>(house.eaves_m - middle);
  walls.rise = static_cast<float>(house.roof_m);
  walls.top_material = Material::kRoof;
  if (house.roof_m > 0.0)  // a chimney
    add(out, at, Shape::kBox, {random.uniform(-0.3, 0.3) * house.width_m, 0.6, house.eaves_m + house.roof_m},
        {0.35, 0.35, 1.0}, Material::kBrick, random.next());
  // What sticks out of the front: a porch, balconies, or an oriel.
  const double front = -0.5 * house.depth_m;
  switch (random.whole(0, 4)) {
    case 0:
      add(out, at, Shape::kBox, {random.uniform(-0.25, 0.25) * house.width_m, front - 0.6, 2.4}, {1.2, 0.6, 0.12},
          Material::kRoof, random.next());
      break;
    case 1:
      for (double z = 3.2; z + 1.5 < house.eaves_m; z += 2.9)
        add(out, at, Shape::kBox, {0.2 * house.width_m, front - 0.55, z}, {1.5, 0.55, 0.5}, Material::kConcrete,
            random.next());
      break;
    case 2:
      add(out, at, Shape::kBox, {random.uniform(-0.2, 0.2) * house.width_m, front - 0.3, 0.5 * house.eaves_m},
          {0.18 * house.width_m, 0.3, 0.5 * house.eaves_m}, house.walls, seed);
      break;
    default:
      break;
  }
  if (random.chance(0.6))  // a drain pipe
    add(out, at, Shape::kCylinder, {0.5 * house.width_m - 0.2, front - 0.06, 0.5 * house.eaves_m},
        {0.06, 0.06, 0.5 * house.eaves_m}, Material::kMetal, random.next());
}

void add_tree(Solids& out, const Stand& at, double height_m, std::uint64_t seed) {
  Random random(seed);
  const double trunk_m = height_m * random.uniform(0.28, 0.4), radius_m = height_m * random.uniform(0.22, 0.32);
  const double thickness_m = 0.02 * height_m + 0.04;
  const double crown_z = 0.5 * (trunk_m + height_m);
  add(out, at, Shape::kCylinder, {0, 0, 0.5 * crown_z - 0.25}, {thickness_m, thickness_m, 0.5 * crown_z + 0.25},
      Material::kBark, random.next());
  const int lobes = random.whole(2, 3);
  for (int i = 0; i < lobes; ++i) {
    const double angle = random.uniform(0.0, 6.283), off = 0.35 * radius_m;
    add(out, at, Shape::kCrown,
        {off * std::cos(angle), off * std::sin(angle), crown_z + random.uniform(-0.08, 0.08) * height_m},
        {radius_m * random.uniform(0.7, 1.0), radius_m * random.uniform(0.7, 1.0), 0.5 * (height_m - trunk_m)},
        Material::kLeaf, random.next());
  }
}

void add_conifer(Solids& out, const Stand& at, double height_m, std::uint64_t seed) {
  Random random(seed);
  add(out, at, Shape::kCylinder, {0, 0, 0.4 * height_m - 0.25}, {0.15, 0.15, 0.4 * height_m + 0.25}, Material::kBark,
      random.next());
  for (int i = 0; i < 3; ++i) {  // ever smaller storeys of branches
    const double radius_m = height_m * (0.19 - 0.05 * i);
    add(out, at, Shape::kCrown, {0, 0, height_m * (0.30 + 0.24 * i)}, {radius_m, radius_m, 0.2 * height_m},
        Material::kLeaf, random.next());
  }
}

void add_bush(Solids& out, const Stand& at, double size_m, std::uint64_t seed) {
  Random random(seed);
  add(out, at, Shape::kCrown, {0, 0, 0.4 * size_m},
      {0.5 * size_m * random.uniform(0.8, 1.3), 0.5 * size_m * random.uniform(0.8, 1.3), 0.55 * size_m},
      Material::kLeaf, random.next());
}

void add_hedge(Solids& out, const Stand& at, double length_m, double height_m, std::uint64_t seed) {
  add(out, at, Shape::kHedge, {0, 0, 0.5 * height_m - 0.2}, {0.5 * length_m, 0.35, 0.5 * height_m + 0.2},
      Material::kLeaf, seed);
}

void add_fence(Solids& out, const Stand& at, double length_m, double height_m, std::uint64_t seed) {
  add(out, at, Shape::kFence, {0, 0, 0.5 * height_m}, {0.5 * length_m, 0.02, 0.5 * height_m},
      (seed & 1) != 0 ? Material::kWood : Material::kMetal, seed);
}

void add_post(Solids& out, const Stand& at, double height_m, double radius_m, Material material, std::uint64_t seed) {
  add(out, at, Shape::kCylinder, {0, 0, 0.5 * height_m - 0.25}, {radius_m, radius_m, 0.5 * height_m + 0.25}, material,
      seed);
}

void add_lamp(Solids& out, const Stand& at, std::uint64_t seed) {
  add_post(out, at, 7.0, 0.09, Material::kMetal, seed);
  add(out, at, Shape::kBox, {0, -1.0, 7.0}, {0.15, 1.0, 0.08}, Material::kMetal, seed);  // the arm, over the road
}

void add_sign(Solids& out, const Stand& at, std::uint64_t seed) {
  add_post(out, at, 2.6, 0.04, Material::kMetal, seed);
  Random random(seed);
  const double half_m = random.uniform(0.25, 0.45);
  add(out, at, Shape::kBox, {0.06, 0, 2.5}, {0.015, half_m, half_m * random.uniform(0.8, 1.4)}, Material::kRetro,
      random.next());
}

void add_box(Solids& out, const Stand& at, double length_m, double width_m, double bottom_m, double top_m,
             Material material, std::uint64_t seed) {
  add(out, at, Shape::kBox, {0, 0, 0.5 * (bottom_m + top_m)}, {0.5 * length_m, 0.5 * width_m, 0.5 * (top_m - bottom_m)},
      material, seed);
}

void add_vehicle(Solids& out, const Stand& at, VehicleKind kind, std::uint64_t seed) {
  Random random(seed);
  const std::uint64_t paint = random.next();
  const double length = kind == VehicleKind::kTruck      ? 8.0
                        : kind == VehicleKind::kLorry    ? 13.0
                        : kind == VehicleKind::kVan      ? 5.4
                        : kind == VehicleKind::kForklift ? 2.6
                                                         : random.uniform(3.7, 4.9);
  const double width = kind == VehicleKind::kTruck      ? 2.5
                       : kind == VehicleKind::kLorry    ? 2.5
                       : kind == VehicleKind::kVan      ? 2.0
                       : kind == VehicleKind::kForklift ? 1.2
                                                        : random.uniform(1.65, 1.85);
  const double height = kind == VehicleKind::kTruck      ? 3.4
                        : kind == VehicleKind::kLorry    ? 3.9
                        : kind == VehicleKind::kVan      ? random.uniform(2.0, 2.7)
                        : kind == VehicleKind::kForklift ? 2.1
                                                         : random.uniform(1.4, 1.65);
  const double belt = kind == VehicleKind::kCar ? 0.58 * height : kind == VehicleKind::kForklift ? 1.0 : 0.45 * height;
  add(out, at, Shape::kBox, {0, 0, 0.5 * (0.25 + belt)}, {0.5 * length, 0.5 * width, 0.5 * (belt - 0.25)},
      Material::kPaint, paint);
  // The cabin: sides lean in at front and back, so it is a wedge turned by a quarter.
  const double cabin = (kind == VehicleKind::kCar ? 0.30 : 0.49) * length;
  Solid& top = add(out, at, Shape::kWedge, {kind == VehicleKind::kCar ? -0.08 * length : 0.0, 0, 0.5 * (belt + height)},
                   {0.46 * width, cabin, 0.5 * (height - belt)},
                   kind == VehicleKind::kCar ? Material::kGlass : Material::kPaint, paint, 1.5707963);
  top.top_material = Material::kPaint;
  top.eaves = static_cast<float>(-0.5 * (height - belt));
  top.rise = static_cast<float>((height - belt) * (kind == VehicleKind::kCar ? 2.4 : 9.0));
  for (const double x : {-0.3, 0.3})
    for (const double y : {-0.5, 0.5})
      add(out, at, Shape::kBox, {x * length, y * (width - 0.22), 0.3}, {0.31, 0.11, 0.3}, Material::kRubber, seed);
  if (kind != VehicleKind::kForklift)
    for (const double end : {-1.0, 1.0})  // the plates
      add(out, at, Shape::kBox, {end * (0.5 * length + 0.01), 0, 0.5}, {0.01, 0.26, 0.06}, Material::kRetro, seed);
}

void add_clutter(Solids& out, const Stand& at, std::uint64_t seed) {
  Random random(seed);
  switch (random.whole(0, 5)) {
    case 0:
    case 1: {  // bins
      const int count = random.whole(1, 3);
      for (int i = 0; i < count; ++i) {
        Stand bin = at;
        bin.x += 0.7 * (i - 0.5 * (count - 1)) * std::cos(at.yaw_rad);
        bin.y += 0.7 * (i - 0.5 * (count - 1)) * std::sin(at.yaw_rad);
        bin.yaw_rad += random.uniform(-0.4, 0.4);
        add_box(out, bin, 0.58, 0.6, 0.0, random.uniform(1.0, 1.3), Material::kPlastic, random.next());
      }
      break;
    }
    case 2:  // a skip
      add_box(out, at, random.uniform(1.8, 2.4), 1.0, 0.1, random.uniform(1.1, 1.6), Material::kMetal, random.next());
      break;
    case 3:  // a heap: earth, sand, snow
      add(out, at, Shape::kEllipsoid, {0, 0, 0}, {random.uniform(0.7, 1.2), 0.5, random.uniform(0.5, 1.3)},
          random.chance(0.5) ? Material::kEarth : Material::kMarking, random.next());
      break;
    case 4: {  // a scaffold
      const double height_m = random.uniform(4.0, 8.0);
      for (const double x : {-1.1, 0.0, 1.1})
        for (const double y : {-0.4, 0.4})
          add(out, at, Shape::kCylinder, {x, y, 0.5 * height_m}, {0.04, 0.04, 0.5 * height_m}, Material::kMetal, seed);
      for (double z = 2.0; z < height_m; z += 2.0)
        add_box(out, at, 2.4, 0.8, z, z + 0.08, Material::kWood, random.next());
      break;
    }
    default:  // pallets, boxes, building material
      add_box(out, at, random.uniform(0.8, 2.2), random.uniform(0.6, 1.0), 0.0, random.uniform(0.4, 1.8),
              random.chance(0.5) ? Material::kWood : Material::kCardboard, random.next());
  }
}

void add_furniture(Solids& out, const Stand& at, std::uint64_t seed) {
  Random random(seed);
  switch (random.whole(0, 3)) {
    case 0:
      add_box(out, at, random.uniform(0.4, 1.0), random.uniform(0.4, 0.7), 0.0, random.uniform(0.4, 1.4),
              Material::kCardboard, random.next());
      break;
    case 1:
      add_bush(out, at, random.uniform(0.8, 1.4), random.next());
      break;
    case 2:  // a chair
      add_box(out, at, 0.45, 0.45, 0.42, 0.5, Material::kPlastic, seed);
      add_box(out, {at.x + 0.2 * std::cos(at.yaw_rad), at.y + 0.2 * std::sin(at.yaw_rad), at.z, at.yaw_rad}, 0.05, 0.45,
              0.5, 0.95, Material::kPlastic, seed);
      break;
    default:
      add_post(out, at, random.uniform(0.6, 1.1), random.uniform(0.15, 0.3), Material::kMetal, random.next());
  }
}

void add_person(Solids& out, const Stand& at, std::uint64_t seed) {
  Random random(seed);
  const double size = random.uniform(0.9, 1.05), stride = random.uniform(0.05, 0.25);
  for (const double side : {-1.0, 1.0})
    add(out, at, Shape::kCylinder, {side * stride, side * 0.1, 0.42 * size}, {0.08, 0.08, 0.42 * size},
        Material::kCloth, seed + 1);
  add(out, at, Shape::kEllipsoid, {0, 0, 1.15 * size}, {0.15, 0.24, 0.36 * size}, Material::kCloth, seed + 2);
  add(out, at, Shape::kEllipsoid, {0, 0, 1.62 * size}, {0.11, 0.11, 0.14}, Material::kCloth, seed + 3);
}

}  // namespace revisit::simulation_internal
