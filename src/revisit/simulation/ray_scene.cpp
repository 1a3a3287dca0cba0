// SPDX-License-Identifier: Apache-2.0
#include <revisit/simulation/internal/ray_scene.hpp>

#include <algorithm>
#include <cmath>
#include <new>
#include <utility>

#include <embree3/rtcore.h>

namespace revisit::simulation_internal {
namespace {

constexpr float kMargin_m = 0.01f;  // boxes are larger than what is in them by more than any rounding

struct Query {
  RTCIntersectContext context;  // must come first: Embree hands it back
  const Ray* rays;
  Met* mets;
};

template <typename Thing>
struct Things {
  const Thing* list = nullptr;
  float time_reach_s = 0.f;
};

RTCBounds bounds_of(const Eigen::Vector3f& low, const Eigen::Vector3f& high) {
  return {low.x() - kMargin_m,  low.y() - kMargin_m,  low.z() - kMargin_m,  0.f,
          high.x() + kMargin_m, high.y() + kMargin_m, high.z() + kMargin_m, 0.f};
}

void solid_bounds(const RTCBoundsFunctionArguments* arguments) {
  const auto& things = *static_cast<const Things<Solid>*>(arguments->geometryUserPtr);
  const Solid& solid = things.list[arguments->primID];
  Eigen::Vector3f half = bounding_half(solid);
  half.x() += std::abs(solid.velocity.x()) * things.time_reach_s;
  half.y() += std::abs(solid.velocity.y()) * things.time_reach_s;
  *arguments->bounds_o = bounds_of(solid.centre - half, solid.centre + half);
}

void cell_bounds(const RTCBoundsFunctionArguments* arguments) {
  const Terrain::Cell& cell =
      static_cast<const Things<Terrain::Cell>*>(arguments->geometryUserPtr)->list[arguments->primID];
  constexpr auto kSize = static_cast<float>(Terrain::kCell_m);
  const auto [low, high] = std::minmax({cell.h00, cell.h10, cell.h01, cell.h11});
  *arguments->bounds_o = bounds_of({cell.x, cell.y, low}, {cell.x + kSize, cell.y + kSize, high});
}

// Of two things equally far, the one of the smaller kind and number counts, in whatever order they are tried.
template <typename Thing, Met::What kWhat>
void try_thing(const RTCIntersectFunctionNArguments* arguments) {
  const auto& query = *reinterpret_cast<const Query*>(arguments->context);
  const Thing& thing = static_cast<const Things<Thing>*>(arguments->geometryUserPtr)->list[arguments->primID];
  RTCRayN* rays = RTCRayHitN_RayN(arguments->rayhit, arguments->N);
  RTCHitN* hits = RTCRayHitN_HitN(arguments->rayhit, arguments->N);
  for (unsigned lane = 0; lane < arguments->N; ++lane) {
    if (arguments->valid[lane] == 0) continue;
    const unsigned id = RTCRayN_id(rays, arguments->N, lane);
    Met& met = query.mets[id];
    const bool wins_ties = std::pair(kWhat, arguments->primID) < std::pair(met.what, met.index);
    const float limit = wins_ties ? std::nextafter(met.range_m, std::numeric_limits<float>::infinity()) : met.range_m;
    const float range_m = intersect(thing, query.rays[id], limit);
    if (!(range_m < limit)) continue;
    met = {range_m, kWhat, arguments->primID};
    RTCRayN_tfar(rays, arguments->N, lane) = range_m;
    RTCHitN_geomID(hits, arguments->N, lane) = arguments->geomID;
    RTCHitN_primID(hits, arguments->N, lane) = arguments->primID;
  }
}

}  // namespace

struct RayScene::Embree {
  RTCDevice device = nullptr;
  RTCScene scene = nullptr;
  Things<Solid> solids;
  Things<Terrain::Cell> cells;

  explicit Embree(RTCDevice of) : device(of) {  // takes over a reference to the device
    if (device == nullptr) throw std::bad_alloc();
    scene = rtcNewScene(device);
    rtcSetSceneFlags(scene, RTC_SCENE_FLAG_ROBUST);
  }
  ~Embree() {
    rtcReleaseScene(scene);
    rtcReleaseDevice(device);
  }
  Embree(const Embree&) = delete;
  Embree& operator=(const Embree&) = delete;

  template <typename Thing, Met::What kWhat>
  void attach(Things<Thing>& things, std::size_t count, RTCBoundsFunction bounds) {
    if (count == 0) return;
    RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_USER);
    rtcSetGeometryUserPrimitiveCount(geometry, static_cast<unsigned>(count));
    rtcSetGeometryUserData(geometry, &things);
    rtcSetGeometryBoundsFunction(geometry, bounds, nullptr);
    rtcSetGeometryIntersectFunction(geometry, &try_thing<Thing, kWhat>);
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(scene, geometry);
    rtcReleaseGeometry(geometry);
  }
  void commit() const {
    rtcCommitScene(scene);
    if (rtcGetDeviceError(device) != RTC_ERROR_NONE) throw std::bad_alloc();
  }
};

RayScene::RayScene(const Solids& solids, const std::vector<Terrain::Cell>& ground, const std::string& embree_options)
    : embree_(std::make_unique<Embree>(rtcNewDevice(embree_options.c_str()))) {
  embree_->solids.list = solids.data();
  embree_->cells.list = ground.data();
  embree_->attach<Solid, Met::What::kSolid>(embree_->solids, solids.size(), solid_bounds);
  embree_->attach<Terrain::Cell, Met::What::kGround>(embree_->cells, ground.size(), cell_bounds);
  embree_->commit();
}

RayScene::RayScene(const RayScene& fixed, const Solids& moving, float time_reach_s) {
  rtcRetainDevice(fixed.embree_->device);
  embree_ = std::make_unique<Embree>(fixed.embree_->device);
  embree_->solids = {moving.data(), time_reach_s};
  embree_->attach<Solid, Met::What::kMoving>(embree_->solids, moving.size(), solid_bounds);
  embree_->commit();
}

RayScene::~RayScene() = default;

void RayScene::trace(std::span<const Ray> rays, Met* mets) const {
  if (rays.empty()) return;
  Query query;
  rtcInitIntersectContext(&query.context);
  query.context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
  query.rays = rays.data();
  query.mets = mets;
  alignas(64) int valid[kPacket] = {};
  RTCRayHit16 packet;
  // Embree may check the rays that are not valid, and try them as well: they are the last one again, number and all.
  for (std::size_t i = 0; i < kPacket; ++i) {
    const std::size_t k = std::min(i, rays.size() - 1);
    if (i < rays.size()) valid[i] = -1;
    packet.ray.org_x[i] = rays[k].origin.x();
    packet.ray.org_y[i] = rays[k].origin.y();
    packet.ray.org_z[i] = rays[k].origin.z();
    packet.ray.dir_x[i] = rays[k].direction.x();
    packet.ray.dir_y[i] = rays[k].direction.y();
    packet.ray.dir_z[i] = rays[k].direction.z();
    packet.ray.tnear[i] = 0.f;
    packet.ray.tfar[i] = mets[k].range_m;
    packet.ray.time[i] = 0.f;
    packet.ray.mask[i] = ~0u;
    packet.ray.id[i] = static_cast<unsigned>(k);
    packet.ray.flags[i] = 0;
    packet.hit.geomID[i] = RTC_INVALID_GEOMETRY_ID;
    packet.hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
  }
  rtcIntersect16(valid, embree_->scene, &query.context, &packet);
}

}  // namespace revisit::simulation_internal
