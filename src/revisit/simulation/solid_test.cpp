// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>

#include <revisit/simulation/internal/random.hpp>
#include <revisit/simulation/internal/ray_scene.hpp>

#include <embree3/rtcore.h>

namespace revisit::simulation_internal {
namespace {

Solid turned(Shape shape, double yaw_rad) {
  Solid solid;
  solid.shape = shape;
  solid.centre = {3.f, -2.f, 1.f};
  solid.half = {2.f, 1.f, 1.5f};
  solid.cos_yaw = static_cast<float>(std::cos(yaw_rad));
  solid.sin_yaw = static_cast<float>(std::sin(yaw_rad));
  solid.eaves = 0.5f;
  solid.rise = 1.f;
  return solid;
}

// Whether the point lies in the solid, from the shape's definition.
bool is_inside(const Solid& s, const Eigen::Vector3f& world) {
  const Eigen::Vector3f d = world - s.centre;
  const Eigen::Vector3f p(s.cos_yaw * d.x() + s.sin_yaw * d.y(), s.cos_yaw * d.y() - s.sin_yaw * d.x(), d.z());
  const bool in_box = (p.cwiseAbs() - s.half).maxCoeff() <= 0.f;
  switch (s.shape) {
    case Shape::kWedge:
      return in_box && p.z() <= s.eaves + s.rise * (1.f - std::abs(p.y()) / s.half.y());
    case Shape::kCylinder:
      return p.head<2>().norm() <= s.half.x() && std::abs(p.z()) <= s.half.z();
    case Shape::kEllipsoid:
      return p.cwiseQuotient(s.half).norm() <= 1.f;
    default:
      return in_box;
  }
}

Ray random_ray(Random& random) {
  const auto draw = [&](double low, double high) { return static_cast<float>(random.uniform(low, high)); };
  Ray ray;
  ray.origin = {draw(-9, 15), draw(-14, 10), draw(-5, 8)};
  const Eigen::Vector3f aim(draw(0, 6), draw(-5, 1), draw(-1, 3));
  ray.direction = (aim - ray.origin).normalized();
  return ray;
}

class ConvexSolids : public ::testing::TestWithParam<Shape> {};

TEST_P(ConvexSolids, RangeIsWhereTheRayEnters) {
  Random random(5);
  int hits = 0;
  for (int i = 0; i < 300; ++i) {
    const Solid solid = turned(GetParam(), random.uniform(-3.0, 3.0));
    const Ray ray = random_ray(random);
    if (is_inside(solid, ray.origin)) continue;
    float walked = std::numeric_limits<float>::infinity();
    for (float t = 0.f; t < 40.f && std::isinf(walked); t += 0.004f)
      if (is_inside(solid, ray.origin + t * ray.direction)) walked = t;
    Hit hit;
    const float range_m = intersect(solid, ray, 100.f, &hit);
    if (std::isinf(walked)) continue;  // a corner may be cut between two steps
    ++hits;
    ASSERT_NEAR(range_m, walked, 0.0045f);
    EXPECT_NEAR(hit.normal.norm(), 1.f, 1e-4f);
    EXPECT_LT(hit.normal.dot(ray.direction), 1e-3f) << "the side that is met faces the ray";
    EXPECT_TRUE(std::isinf(intersect(solid, ray, 0.999f * range_m))) << "nothing beyond the limit";
    EXPECT_FALSE(is_inside(solid, ray.origin + (range_m - 0.01f) * ray.direction));
  }
  EXPECT_GT(hits, 60);
}

INSTANTIATE_TEST_SUITE_P(Shapes, ConvexSolids,
                         ::testing::Values(Shape::kBox, Shape::kWedge, Shape::kCylinder, Shape::kEllipsoid));

TEST(Solids, MissesWhatItDoesNotTouch) {
  const Ray up{{3.f, -2.f, 10.f}, Eigen::Vector3f::UnitZ(), 0.f};
  const Ray beside{{3.f, 10.f, 1.f}, Eigen::Vector3f::UnitX(), 0.f};
  for (const Shape shape :
       {Shape::kBox, Shape::kWedge, Shape::kCylinder, Shape::kEllipsoid, Shape::kFence, Shape::kCrown, Shape::kHedge}) {
    EXPECT_TRUE(std::isinf(intersect(turned(shape, 0.3), up, 100.f)));
    EXPECT_TRUE(std::isinf(intersect(turned(shape, 0.3), beside, 100.f)));
  }
}

TEST(Solids, WindowsLieDeeperThanTheWall) {
  Solid wall = turned(Shape::kBox, 0.0);
  wall.half = {10.f, 5.f, 6.f};
  wall.ground = -6.f;
  wall.facade = 1;
  int deep = 0, flush = 0;
  const float front = wall.centre.y() - 5.f;
  for (int i = 0; i < 400; ++i) {
    const Ray ray{{-6.f + 0.045f * static_cast<float>(i), front - 8.f, 2.2f}, Eigen::Vector3f::UnitY(), 0.f};
    Hit hit;
    const float depth = intersect(wall, ray, 100.f, &hit) - 8.f;
    (depth > 0.05f ? deep : flush) += 1;
    EXPECT_NEAR(depth, depth > 0.05f ? kFacades[1].recess_m : 0.f, 1e-4f);
    EXPECT_EQ(hit.material != Material::kPlaster, depth > 0.05f);
  }
  EXPECT_GT(deep, 50);
  EXPECT_GT(flush, 100);
}

TEST(Solids, LeavesAndFencesLetSomeRaysThroughTheSameOnesAlways) {
  for (const Shape shape : {Shape::kCrown, Shape::kHedge, Shape::kFence}) {
    Solid solid = turned(shape, 0.0);
    solid.half.y() = 0.35f;
    int met = 0;
    for (int i = 0; i < 200; ++i) {
      const Ray ray{{1.5f + 0.015f * static_cast<float>(i), -12.f, 1.4f}, Eigen::Vector3f::UnitY(), 0.f};
      const float range_m = intersect(solid, ray, 100.f);
      met += std::isfinite(range_m);
      EXPECT_EQ(range_m, intersect(solid, ray, 100.f));
    }
    EXPECT_GT(met, 60);
    EXPECT_LT(met, 200);
  }
}

TEST(Solids, AMovingOneIsMetWhereItIsAtThatTime) {
  Solid solid = turned(Shape::kBox, 0.0);
  solid.velocity = {0.f, 10.f};
  Ray ray{{3.f, -12.f, 1.f}, Eigen::Vector3f::UnitY(), 0.f};
  EXPECT_NEAR(intersect(solid, ray, 100.f), 9.f, 1e-4f);
  ray.time_s = 0.05f;
  EXPECT_NEAR(intersect(solid, ray, 100.f), 9.5f, 1e-4f);
}

// A thicket of everything over a hilly ground.
struct Thicket {
  Solids solids;
  std::vector<Terrain::Cell> cells;

  Thicket() {
    Random random(9);
    for (int i = 0; i < 300; ++i) {
      Solid solid = turned(static_cast<Shape>(i % 7), random.uniform(-3.0, 3.0));
      solid.centre =
          Eigen::Vector3d(random.uniform(-40, 40), random.uniform(-40, 40), random.uniform(0, 3)).cast<float>();
      solid.object = static_cast<std::uint32_t>(i / 2);
      solids.push_back(solid);
      if (i % 10 == 0) solids.push_back(solid);  // the same thing twice: a tie
    }
    const auto height = [](float x, float y) { return std::sin(0.1f * x) + std::cos(0.13f * y) - 1.5f; };
    for (float x = -48.f; x < 48.f; x += 4.f)
      for (float y = -48.f; y < 48.f; y += 4.f)
        cells.push_back({x, y, height(x, y), height(x + 4, y), height(x, y + 4), height(x + 4, y + 4)});
  }

  Met by_trying_all(const Ray& ray) const {
    Met met;
    for (std::uint32_t i = 0; i < solids.size(); ++i)
      if (const float t = intersect(solids[i], ray, met.range_m); t < met.range_m) met = {t, Met::What::kSolid, i};
    for (std::uint32_t i = 0; i < cells.size(); ++i)
      if (const float t = intersect(cells[i], ray, met.range_m); t < met.range_m) met = {t, Met::What::kGround, i};
    return met;
  }
};

std::vector<Ray> rays_into(int count) {
  Random random(13);
  std::vector<Ray> rays;
  for (int i = 0; i < count; ++i) {
    const double azimuth = random.uniform(-3.14, 3.14), elevation = random.uniform(-0.5, 0.2);
    rays.push_back({{0.1f, 0.2f, 4.5f},
                    Eigen::Vector3d(std::cos(elevation) * std::cos(azimuth), std::cos(elevation) * std::sin(azimuth),
                                    std::sin(elevation))
                        .cast<float>(),
                    0.f});
  }
  return rays;
}

// Embree may use any instruction set: what a ray meets, and where, is the same to the last bit.
class RayScenes : public ::testing::TestWithParam<const char*> {};

TEST_P(RayScenes, FindTheSameAsTryingEverything) {
  const Thicket thicket;
  const RayScene scene(thicket.solids, thicket.cells, GetParam());
  const std::vector<Ray> rays = rays_into(1600);
  int solids = 0, ground = 0;
  for (std::size_t i = 0; i < rays.size(); i += RayScene::kPacket) {
    std::array<Met, RayScene::kPacket> mets;
    scene.trace(std::span(rays).subspan(i, RayScene::kPacket), mets.data());
    for (std::size_t k = 0; k < RayScene::kPacket; ++k) {
      const Met expected = thicket.by_trying_all(rays[i + k]);
      ASSERT_EQ(mets[k].range_m, expected.range_m);
      ASSERT_EQ(mets[k].what, expected.what);
      if (expected.what != Met::What::kNothing) {
        ASSERT_EQ(mets[k].index, expected.index);
      }
      solids += expected.what == Met::What::kSolid;
      ground += expected.what == Met::What::kGround;
    }
  }
  EXPECT_GT(solids, 300);
  EXPECT_GT(ground, 150);
}

// Of a packet that is not full, Embree may try the rays that are not there: nothing beyond those that are is read or
// written.
TEST_P(RayScenes, APacketThatIsNotFullTouchesNothingElse) {
  const Thicket thicket;
  const RayScene scene(thicket.solids, thicket.cells, GetParam());
  const std::vector<Ray> rays = rays_into(400 + RayScene::kPacket);
  for (const std::size_t count : {1, 2, 7, 9, 15})
    for (std::size_t i = 0; i < 400; ++i) {
      std::array<Met, RayScene::kPacket> mets;
      scene.trace(std::span(rays).subspan(i, count), mets.data());
      for (std::size_t k = 0; k < RayScene::kPacket; ++k) {
        const Met expected = k < count ? thicket.by_trying_all(rays[i + k]) : Met();
        ASSERT_EQ(mets[k].range_m, expected.range_m) << k << " of " << count;
        ASSERT_EQ(mets[k].what, expected.what);
      }
    }
}

INSTANTIATE_TEST_SUITE_P(InstructionSets, RayScenes,
                         ::testing::Values("", "isa=sse2", "isa=sse4.2", "isa=avx", "isa=avx2"));

TEST(RayScenesForced, TheInstructionSetIsReallyForced) {
  const auto packet_of_eight = [](const char* options) {
    RTCDevice device = rtcNewDevice(options);
    const auto native = rtcGetDeviceProperty(device, RTC_DEVICE_PROPERTY_NATIVE_RAY8_SUPPORTED);
    rtcReleaseDevice(device);
    return native;
  };
  EXPECT_EQ(packet_of_eight("isa=sse4.2"), 0);
  if (packet_of_eight("") == 0) GTEST_SKIP() << "this processor has no AVX";
  EXPECT_NE(packet_of_eight("isa=avx2"), 0);
}

}  // namespace
}  // namespace revisit::simulation_internal
