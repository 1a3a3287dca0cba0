// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace revisit::simulation_internal {

enum class Material : std::uint8_t {
  kAsphalt,
  kMarking,
  kPavement,
  kGrass,
  kEarth,
  kPlaster,
  kBrick,
  kConcrete,
  kRoof,
  kGlass,
  kDoor,
  kWood,
  kBark,
  kLeaf,
  kPaint,
  kMetal,
  kRubber,
  kRetro,
  kCloth,
  kCardboard,
  kPlastic,
  kFloor,
  kCount
};

/// How a surface answers to a beam of 905 nm.
struct Surface {
  float reflectance;  ///< diffuse, of a white target; a retro-reflector's is above 1
  float flatness;     ///< 1: returns fall with the cosine of the angle of incidence; 0: not at all (rough ground)
  float gloss;        ///< share of the light that is reflected away unless the beam comes in straight
  float spread;       ///< how much single objects differ in reflectance, as a share
  float roughness_m;  ///< half height of the relief
};

// Orders of magnitude as published for near infrared; asphalt, grass and leaves are what most points of a drive lie on.
inline constexpr std::array<Surface, static_cast<std::size_t>(Material::kCount)> kSurfaces = {{
    {0.21f, 0.15f, 0.00f, 0.10f, 0.003f},  // asphalt
    {0.60f, 0.25f, 0.00f, 0.10f, 0.003f},  // marking
    {0.30f, 0.20f, 0.00f, 0.15f, 0.004f},  // pavement
    {0.36f, 0.10f, 0.00f, 0.10f, 0.040f},  // grass
    {0.24f, 0.15f, 0.00f, 0.20f, 0.025f},  // earth
    {0.42f, 0.70f, 0.00f, 0.60f, 0.004f},  // plaster
    {0.30f, 0.70f, 0.00f, 0.40f, 0.008f},  // brick
    {0.30f, 0.70f, 0.00f, 0.30f, 0.005f},  // concrete
    {0.22f, 0.60f, 0.00f, 0.50f, 0.015f},  // roof
    {0.30f, 1.00f, 0.93f, 0.30f, 0.000f},  // glass
    {0.25f, 0.80f, 0.20f, 0.80f, 0.002f},  // door
    {0.32f, 0.60f, 0.00f, 0.40f, 0.008f},  // wood
    {0.25f, 0.50f, 0.00f, 0.30f, 0.010f},  // bark
    {0.40f, 0.20f, 0.00f, 0.30f, 0.000f},  // leaf
    {0.28f, 0.90f, 0.55f, 0.90f, 0.000f},  // car paint
    {0.38f, 0.80f, 0.30f, 0.40f, 0.001f},  // metal
    {0.05f, 0.60f, 0.00f, 0.20f, 0.004f},  // rubber
    {6.00f, 0.30f, 0.00f, 0.30f, 0.001f},  // retro-reflector
    {0.30f, 0.50f, 0.00f, 0.70f, 0.010f},  // cloth
    {0.38f, 0.70f, 0.00f, 0.25f, 0.003f},  // cardboard
    {0.35f, 0.70f, 0.15f, 0.60f, 0.001f},  // plastic
    {0.30f, 0.25f, 0.15f, 0.05f, 0.001f},  // warehouse floor
}};

inline const Surface& surface_of(Material material) { return kSurfaces[static_cast<std::size_t>(material)]; }

}  // namespace revisit::simulation_internal
