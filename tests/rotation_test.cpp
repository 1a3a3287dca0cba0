// SPDX-License-Identifier: Apache-2.0
// A place seen again under any heading: the retrieved yaw and the pose of the constraint, over a whole turn.
#include <revisit/io/recording.hpp>
#include <revisit/pipeline/loop_detector.hpp>

#include "shared_data.hpp"
#include "synthetic_world.hpp"

namespace revisit {
namespace {

using testing_support::shared_data;
using testing_support::SyntheticWorld;

// The scan of a sensor that stands where `scan` was taken, but heads `yaw_rad` further to the left.
Scan turned(const Scan& scan, double yaw_rad) {
  Scan result = scan;
  const double c = std::cos(-yaw_rad), s = std::sin(-yaw_rad);
  for (Point& p : result.points) {
    const double x = p.x, y = p.y;
    p.x = static_cast<float>(c * x - s * y);
    p.y = static_cast<float>(s * x + c * y);
  }
  return result;
}

double difference_deg(double a_rad, double b_rad) { return std::abs(to_degrees(wrap_angle(a_rad - b_rad))); }

// `reach` is how far the retrieved yaw may lie from the true one, in columns: half of one, and a little where the angle
// lies between two columns and what is seen decides for either.
void expect_every_yaw(const Scan& place, const Parameters& parameters, double step_deg, double reach) {
  LoopDetector detector(parameters);
  ASSERT_TRUE(detector.add(place));
  const double column_deg = 360.0 / parameters.descriptor.sectors;
  for (double yaw_deg = 0.0; yaw_deg < 360.0; yaw_deg += step_deg) {
    Scan query = turned(place, to_radians(yaw_deg));
    query.frame = FrameId{1000};
    const auto detection = detector.localise(query);
    ASSERT_TRUE(detection) << detection.error().message;
    ASSERT_FALSE(detection->candidates.empty());
    EXPECT_LE(difference_deg(detection->candidates[0].yaw_rad, to_radians(yaw_deg)), reach * column_deg) << yaw_deg;
    ASSERT_TRUE(detection->loop) << yaw_deg << ": " << detection->reason();
    EXPECT_LT(difference_deg(yaw_of(detection->loop->T_match_query), to_radians(yaw_deg)), 0.3) << yaw_deg;
    EXPECT_LT(detection->loop->T_match_query.translation().norm(), 0.1) << yaw_deg;
  }
}

TEST(Rotation, OfASimulatedPlaceOverAWholeTurn) {
  const Scan place = SyntheticWorld(61).scan(SyntheticWorld::at(0, 0, 0), {32, 1200, -24.8, 5.0});
  expect_every_yaw(place, {}, 7.3, 0.6);
  expect_every_yaw(place, *preset("grid20x60"), 23.7, 0.55);
}

TEST(Rotation, OfARealPlaceOverAWholeTurn) {
  REVISIT_NEEDS_SHARED_DATA();
  const auto recording = open_recording(shared_data() / "kitti00_mini");
  ASSERT_TRUE(recording);
  expect_every_yaw(*(*recording)->read(18), {}, 31.7, 0.65);
}

TEST(Rotation, ByWholeColumnsShiftsTheDescriptorAndNothingElse) {
  const Scan place = SyntheticWorld(62).scan(SyntheticWorld::at(0, 0, 0), {32, 1200, -24.8, 5.0});
  for (const Parameters& parameters : {Parameters{}, *preset("grid20x60")}) {
    const auto before = prepare_scan(place, parameters, IntensityScale{});
    ASSERT_TRUE(before);
    const int sectors = parameters.descriptor.sectors, rings = parameters.descriptor.rings;
    for (int k = 0; k < sectors; ++k) {
      const auto after = prepare_scan(turned(place, k * 2.0 * kPi / sectors), parameters, IntensityScale{});
      ASSERT_TRUE(after);
      // Column j of the turned scan is column j + k of the place; rounding moves a few points over a border.
      int differing = 0;
      for (int j = 0; j < sectors; ++j)
        for (int i = 0; i < rings; ++i)
          differing += after->descriptor.intensity[static_cast<std::size_t>(j * rings + i)] !=
                       before->descriptor.intensity[static_cast<std::size_t>((j + k) % sectors * rings + i)];
      EXPECT_LE(differing, rings * sectors / 200) << k;
    }
  }
}

}  // namespace
}  // namespace revisit
