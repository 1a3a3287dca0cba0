// SPDX-License-Identifier: Apache-2.0
#include <revisit/preprocess/rings.hpp>

#include <algorithm>
#include <numeric>
#include <random>

#include <revisit/io/scan_file.hpp>

#include "shared_data.hpp"
#include "synthetic_world.hpp"

namespace revisit {
namespace {

using testing_support::shared_data;
using testing_support::SyntheticWorld;

struct RingCase {
  int rings;
  double lowest_deg, highest_deg;
};

void PrintTo(const RingCase& sensor, std::ostream* out) { *out << sensor.rings << " lines"; }

class RecoveredRings : public testing::TestWithParam<RingCase> {};

TEST_P(RecoveredRings, EqualTheTrueOnesWhateverTheOrder) {
  const auto [count, lowest, highest] = GetParam();
  SyntheticWorld::Sensor sensor{count, 900, lowest, highest};
  sensor.noise_m = 0.02;
  sensor.with_rings = true;
  Scan scan = SyntheticWorld(3).scan(SyntheticWorld::at(0, 0, 0), sensor);
  // Shuffled, so that only the elevation angles tell.
  std::vector<std::size_t> order(scan.points.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::shuffle(order.begin(), order.end(), std::mt19937(4));
  Scan shuffled;
  std::vector<std::uint16_t> truth;
  for (const std::size_t i : order) {
    shuffled.points.push_back(scan.points[i]);
    truth.push_back(static_cast<std::uint16_t>(count - 1 - scan.rings[i]));  // ours count from below
  }
  const Rings rings = find_rings(shuffled);
  EXPECT_EQ(rings.source, RingSource::kElevation);
  // Rings that look at the sky have no returns; they cannot be found and do not count.
  const auto highest_seen = *std::max_element(truth.begin(), truth.end());
  const auto lowest_seen = *std::min_element(truth.begin(), truth.end());
  ASSERT_EQ(rings.count(), static_cast<std::size_t>(highest_seen - lowest_seen + 1));
  std::size_t wrong = 0;
  for (std::size_t i = 0; i < truth.size(); ++i) wrong += rings.of_point[i] + lowest_seen != truth[i];
  EXPECT_LT(static_cast<double>(wrong), 0.01 * static_cast<double>(truth.size()));
}

INSTANTIATE_TEST_SUITE_P(Sensors, RecoveredRings,
                         testing::Values(RingCase{16, -15.0, 15.0}, RingCase{32, -30.67, 10.67},
                                         RingCase{64, -24.8, 2.0}),
                         [](const auto& each) { return std::to_string(each.param.rings) + "_lines"; });

// What an Ouster shows of surfaces a metre away: beams do not start in one point, and stand beside their line.
TEST(FindRings, LinesThatNearSurfacesDoubleCountOnce) {
  Scan scan;
  std::mt19937 random(6);
  std::normal_distribution<double> off_deg(0.0, 0.01);
  const auto add = [&](double elevation_deg, int points) {
    for (int i = 0; i < points; ++i) {
      const double e = to_radians(elevation_deg + off_deg(random)), a = 2.0 * kPi * i / points;
      scan.points.push_back({static_cast<float>(10.0 * std::cos(e) * std::cos(a)),
                             static_cast<float>(10.0 * std::cos(e) * std::sin(a)),
                             static_cast<float>(10.0 * std::sin(e)), 0.f});
    }
  };
  for (int line = 0; line < 64; ++line) add(-44.0 + 1.4 * line, 400);
  add(-44.0 + 1.4 * 25 + 0.32, 130);
  add(-44.0 + 1.4 * 30 - 0.25, 180);
  add(-44.0 + 1.4 * 64, 90);
  EXPECT_EQ(find_rings(scan).count(), 64u);
}

TEST(FindRings, CountsTheLinesOfRealSensors) {
  REVISIT_NEEDS_SHARED_DATA();
  struct Case {
    const char* file;
    std::size_t lines;
  };
  for (const Case& each :
       {Case{"handheld_os0.pcd", 64}, Case{"ouster_intensity_7000.pcd", 128}, Case{"rellis_os1.bin", 64},
        Case{"rellis_vlp32.bin", 32}, Case{"hdl32_pair_a.pcd", 32}, Case{"vlp16_nan_unorganised_ring_time.pcd", 16}}) {
    const auto scan = read_scan(shared_data() / "formats" / each.file);
    ASSERT_TRUE(scan) << each.file;
    EXPECT_EQ(find_rings(*scan).count(), each.lines) << each.file;
  }
}

TEST(FindRings, TakesTheFilesOwnAndNumbersThemFromBelow) {
  Scan scan;
  for (int i = 0; i < 30; ++i) {
    const int laser = i % 3;  // laser 0 is highest
    scan.points.push_back({10.f, static_cast<float>(i), 2.f - 2.f * static_cast<float>(laser), 0.f});
    scan.rings.push_back(static_cast<std::uint16_t>(laser));
  }
  const Rings rings = find_rings(scan);
  EXPECT_EQ(rings.source, RingSource::kFile);
  EXPECT_EQ(rings.of_point[0], 2);
  EXPECT_EQ(rings.of_point[2], 0);
}

TEST(FindRings, NoneInScatteredOrTinyScans) {
  std::mt19937 random(5);
  std::uniform_real_distribution<float> at(-20.f, 20.f);
  Scan scan;
  for (int i = 0; i < 20000; ++i) scan.points.push_back({at(random), at(random), 0.3f * at(random), 0.f});
  EXPECT_EQ(find_rings(scan).source, RingSource::kNone);
  scan.points.resize(1);
  EXPECT_EQ(find_rings(scan).source, RingSource::kNone);
  scan.points.clear();
  EXPECT_EQ(find_rings(scan).source, RingSource::kNone);
}

}  // namespace
}  // namespace revisit
