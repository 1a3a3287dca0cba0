// SPDX-License-Identifier: Apache-2.0
#include <revisit/preprocess/intensity.hpp>

#include <cmath>
#include <random>

#include <revisit/io/scan_file.hpp>

#include "shared_data.hpp"

namespace revisit {
namespace {

using testing_support::shared_data;

// Quantised readings up to `top`, and one in two hundred a retro-reflector `tail` times as bright.
Scan readings(double top, double tail, unsigned seed = 1) {
  std::mt19937 random(seed);
  std::uniform_int_distribution<int> level(0, 200);
  Scan scan;
  for (int i = 0; i < 20000; ++i) {
    const double value = level(random) / 200.0 * top * (i % 200 == 0 ? tail : 1.0);
    scan.points.push_back({1.f + static_cast<float>(i % 50), 0.f, 0.f, static_cast<float>(value)});
  }
  return scan;
}

IntensityScale scale_of(const Scan& scan) { return estimate_intensity_scale(std::span<const Scan>(&scan, 1), {}); }

TEST(IntensityScale, AnyUnitBecomesTheSame) {
  Scan reference = readings(1.0, 1.0);
  normalise_intensity(reference, scale_of(reference));
  for (const double top : {0.0115, 0.99, 255.0, 7156.0}) {
    Scan scan = readings(top, 1.0);
    const IntensityScale scale = scale_of(scan);
    EXPECT_TRUE(scale.is_reflectance) << scale.warning;
    normalise_intensity(scan, scale);
    for (std::size_t i = 0; i < scan.points.size(); i += 97)
      EXPECT_NEAR(scan.points[i].intensity, reference.points[i].intensity, 1e-4) << top;
  }
}

TEST(IntensityScale, AHeavyTailDoesNotDarkenTheRest) {
  Scan plain = readings(100.0, 1.0), tailed = readings(100.0, 50.0);
  EXPECT_LT(scale_of(tailed).full_scale, 1.1 * scale_of(plain).full_scale);
  normalise_intensity(tailed, scale_of(tailed));
  for (const Point& p : tailed.points) {
    ASSERT_GE(p.intensity, 0.f);
    ASSERT_LE(p.intensity, 1.f);
  }
}

TEST(IntensityScale, FieldsThatAreNoReflectanceAreNamed) {
  Scan ring_time = readings(1.0, 1.0), equal = ring_time, zero = ring_time;
  for (std::size_t i = 0; i < ring_time.points.size(); ++i) {
    ring_time.points[i].intensity = static_cast<float>(i % 16) + 1e-5f * static_cast<float>(i / 2);
    equal.points[i].intensity = 0.5f;
    zero.points[i].intensity = 0.f;
  }
  EXPECT_NE(scale_of(ring_time).warning.find("ring + time"), std::string::npos);
  EXPECT_NE(scale_of(equal).warning.find("equal"), std::string::npos);
  EXPECT_NE(scale_of(zero).warning.find("no positive value"), std::string::npos);
  EXPECT_EQ(scale_of(readings(1.0, 1.0)).warning, "");
  equal.points.resize(20);
  EXPECT_FALSE(scale_of(equal).is_reflectance) << "also of few points";
  // Such a field says only that there was a return.
  normalise_intensity(equal, scale_of(equal));
  EXPECT_EQ(equal.points[0].intensity, 1.f);
}

TEST(IntensityScale, UnquantisedReflectanceIsReflectance) {
  std::mt19937 random(3);
  for (const float top : {1.f, 10.f, 255.f, 4000.f}) {
    std::uniform_real_distribution<float> reading(0.f, top);
    Scan scan = readings(1.0, 1.0);
    for (Point& p : scan.points) p.intensity = reading(random);
    EXPECT_TRUE(scale_of(scan).is_reflectance) << top;
  }
}

TEST(IntensityScale, SaturatedReadingsAreToldButUsed) {
  Scan scan = readings(1.0, 1.0);
  for (std::size_t i = 0; i < scan.points.size(); ++i) scan.points[i].intensity = i % 3 == 0 ? 100.f : 255.f;
  EXPECT_TRUE(scale_of(scan).is_reflectance);
  EXPECT_NE(scale_of(scan).warning.find("upper end"), std::string::npos);
}

TEST(IntensityScale, NothingToLookAt) {
  const Scan empty;
  EXPECT_EQ(scale_of(empty).full_scale, 1.0);
  EXPECT_EQ(estimate_intensity_scale({}, {}).full_scale, 1.0);
}

TEST(NormaliseIntensity, AppliesTheCalibration) {
  Scan scan;
  scan.points = {{10.f, 0.f, 0.f, 0.2f}, {20.f, 0.f, 0.f, 0.2f}};
  const IntensityCalibration phi{{10.0, 20.0}, {1.0, 2.0}, {1.0, 1.5}};
  const std::vector<std::uint16_t> rings = {0, 1};
  Scan with_rings = scan;
  IntensityScale unit;
  normalise_intensity(scan, unit, phi);
  EXPECT_NEAR(scan.points[0].intensity, 0.2 * 1.0, 0.01);
  EXPECT_NEAR(scan.points[1].intensity, 0.2 * 2.0, 0.01);
  normalise_intensity(with_rings, unit, phi, rings);
  EXPECT_NEAR(with_rings.points[1].intensity, 0.2 * 2.0 * 1.5, 0.01);
}

TEST(IntensityScale, RealSensors) {
  REVISIT_NEEDS_SHARED_DATA();
  for (const auto& [file, least, most] : {std::tuple{"rellis_os1.bin", 0.004, 0.0115},
                                          {"handheld_os0.pcd", 100.0, 300.0},
                                          {"ouster_intensity_7000.pcd", 150.0, 1500.0},
                                          {"livox.pcd", 40.0, 255.0}}) {
    const auto scan = read_scan(shared_data() / "formats" / file);
    ASSERT_TRUE(scan);
    const IntensityScale scale = scale_of(*scan);
    EXPECT_TRUE(scale.is_reflectance) << file << ": " << scale.warning;
    EXPECT_GT(scale.full_scale, least) << file;
    EXPECT_LT(scale.full_scale, most) << file;
  }
  for (const char* file : {"ring_time_in_intensity.pcd", "vlp16_nan_unorganised_ring_time.pcd"})
    EXPECT_FALSE(scale_of(*read_scan(shared_data() / "formats" / file)).is_reflectance) << file;
}

}  // namespace
}  // namespace revisit
