// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include <revisit/simulation/internal/builders.hpp>
#include <revisit/simulation/internal/terrain.hpp>

namespace revisit::simulation_internal {

/// What a beam met: a solid, a cell of the ground, or a solid that moves, by its place in its scene's list.
struct Met {
  enum class What : std::uint8_t { kSolid, kGround, kMoving, kNothing };

  float range_m = std::numeric_limits<float>::infinity();
  What what = What::kNothing;
  std::uint32_t index = 0;
};

/// Finds the first thing on a ray. Embree only walks its tree of boxes; whether and where a thing is met is computed by
/// `intersect`, whose operations are rounded alike everywhere. So no tree, thread or instruction set changes a range.
class RayScene {
 public:
  /// What never moves. The lists must outlive the scene and stay as they are. `embree_options`: for tests, e.g.
  /// "isa=sse4.2".
  RayScene(const Solids& solids, const std::vector<Terrain::Cell>& ground, const std::string& embree_options = "");
  /// What moves, up to `time_reach_s` before and after the middle of the sweep, beside the scene `fixed`.
  RayScene(const RayScene& fixed, const Solids& moving, float time_reach_s);
  ~RayScene();
  RayScene(const RayScene&) = delete;
  RayScene& operator=(const RayScene&) = delete;

  /// Neighbouring beams are traced together.
  static constexpr std::size_t kPacket = 16;

  /// Betters `mets`, one a ray, which may hold what another scene or a neighbouring beam has found. At most kPacket
  /// rays. Safe from several threads.
  void trace(std::span<const Ray> rays, Met* mets) const;

 private:
  struct Embree;
  std::unique_ptr<Embree> embree_;
};

}  // namespace revisit::simulation_internal
