// SPDX-License-Identifier: Apache-2.0
#include <revisit/pipeline/loop_detector.hpp>

#include <stdexcept>

#include <revisit/io/recording.hpp>
#include <revisit/pipeline/recording_scale.hpp>

#include "shared_data.hpp"
#include "synthetic_world.hpp"

namespace revisit {
namespace {

using testing_support::shared_data;
using testing_support::SyntheticWorld;

const SyntheticWorld::Sensor kSensor{32, 900, -24.8, 5.0};

Scan scan_at(const SyntheticWorld& world, int frame, const Pose& T, unsigned seed,
             const SyntheticWorld::Sensor& sensor = kSensor) {
  Scan scan = world.scan(T, sensor, seed);
  scan.frame = FrameId{frame};
  scan.stamp_s = 0.1 * frame;
  return scan;
}

// Out along x through a street, and a long time later one scan on the way back.
TEST(LoopDetector, FindsThePlaceAndThePoseOfAReverseVisit) {
  const SyntheticWorld world(51);
  LoopDetector detector{Parameters{}};
  for (int i = 0; i < 8; ++i) {
    const auto detection =
        detector.process(scan_at(world, i, SyntheticWorld::at(-28.0 + 8.0 * i, 0, 0), static_cast<unsigned>(i)));
    ASSERT_TRUE(detection) << detection.error().message;
    EXPECT_EQ(detection->searchable_places, 0u);
    EXPECT_EQ(detection->reason(), "no searchable past");
  }
  const Pose T_query = SyntheticWorld::at(5.0, 1.0, to_radians(176.0));
  const auto detection = detector.process(scan_at(world, 1000, T_query, 99), T_query);
  ASSERT_TRUE(detection);
  ASSERT_TRUE(detection->loop) << detection->reason();
  EXPECT_EQ(detection->loop->match.value, 4) << "the place at x = 4";
  const Pose error = (SyntheticWorld::at(4.0, 0, 0).inverse() * T_query).inverse() * detection->loop->T_match_query;
  EXPECT_LT(error.translation().norm(), 0.15);
  EXPECT_LT(to_degrees(rotation_angle(error)), 0.5);
  EXPECT_GT(detection->score, 1.0);
  EXPECT_EQ(detection->row().match->value, 4);
  EXPECT_TRUE(detection->row().accepted);
  EXPECT_FALSE(detection->T_match_query_by_odometry) << "the match came without a pose";
}

// As above, with a sensor that leans one way on the way out and the other way on the way back.
TEST(LoopDetector, FindsThePlaceAndThePoseOfATiltedSensor) {
  const SyntheticWorld world(51);
  const SyntheticWorld::Sensor wide{48, 600, -35.0, 35.0};
  const auto tilted = [](Pose T, double roll_deg) {
    return T.rotate(Eigen::AngleAxisd(to_radians(roll_deg), Eigen::Vector3d::UnitX()));
  };
  LoopDetector detector{Parameters{}};
  for (int i = 0; i < 8; ++i)
    ASSERT_TRUE(detector.add(
        scan_at(world, i, tilted(SyntheticWorld::at(-28.0 + 8.0 * i, 0, 0), 15.0), static_cast<unsigned>(i), wide)));
  const Pose T_query = tilted(SyntheticWorld::at(5.0, 1.0, to_radians(176.0)), 15.0);
  const auto detection = detector.process(scan_at(world, 1000, T_query, 99, wide));
  ASSERT_TRUE(detection);
  ASSERT_TRUE(detection->loop) << detection->reason();
  EXPECT_EQ(detection->loop->match.value, 4) << "the place at x = 4";
  const Pose T_place = tilted(SyntheticWorld::at(4.0, 0, 0), 15.0);
  const Pose error = (T_place.inverse() * T_query).inverse() * detection->loop->T_match_query;
  EXPECT_LT(error.translation().norm(), 0.15) << "in the frames of the sensor as it leaned";
  EXPECT_LT(to_degrees(rotation_angle(error)), 0.5);
}

// Something large and near to all sides but one; of the street, a part is left.
Scan blocked(Scan scan, double open_deg) {
  const auto half = static_cast<float>(to_radians(open_deg / 2.0));
  for (Point& p : scan.points)
    if (std::abs(std::atan2(p.y, p.x)) > half) {
      const float shrink = std::min(1.f, 4.f / std::hypot(p.x, p.y));
      p.x *= shrink;
      p.y *= shrink;
      p.z *= shrink;
    }
  return scan;
}

TEST(LoopDetector, ALoopIsFollowedPastWhatStandsInTheWay) {
  const SyntheticWorld world(51);
  const auto at = [](int i) { return SyntheticWorld::at(-6.0 + i, 0, 0); };
  constexpr double open_deg = 95.0;
  const auto run = [&](bool follow, int first) {
    Parameters parameters;
    parameters.geometric.follow = follow;
    parameters.geometric.min_probability = 0.99999;
    LoopDetector detector{parameters};
    for (int i = 0; i < 8; ++i) EXPECT_TRUE(detector.process(scan_at(world, i, at(i), static_cast<unsigned>(i))));
    // It comes from farther off, so that odometry, interrupted for so long, is sure of itself again.
    for (int i = first == 4 ? 4 : first - 6; i < 4; ++i) {
      const auto detection = detector.process(scan_at(world, 1000 + i, at(i), 100U + static_cast<unsigned>(i)));
      EXPECT_TRUE(detection->loop || i < first) << i;
    }
    return *detector.process(blocked(scan_at(world, 1004, at(4), 104), open_deg));
  };
  const Detection followed = run(true, 0);
  ASSERT_TRUE(followed.loop) << followed.reason();
  EXPECT_EQ(followed.loop->match.value, 4);
  EXPECT_LT(followed.loop->T_match_query.translation().norm(), 0.1);
  const Detection alone = run(true, 4);
  EXPECT_FALSE(alone.loop) << "by itself it is not sure enough";
  EXPECT_FALSE(run(false, 0).loop) << "nor where loops are not followed";
}

// Swept at 10 m/s: of the first scan nobody knows how it moved until the second comes.
TEST(LoopDetector, TheFirstPlaceOfADriveIsCompensatedWithTheMotionOfTheSecondScan) {
  const SyntheticWorld world(51);
  const auto at = [](double x) { return SyntheticWorld::at(x, 0, 0); };
  // Every point as its own moment showed it: the sensor turns once in a tenth of a second, the stamp is in the middle.
  const auto swept = [&](int frame, double x) {
    Scan scan = scan_at(world, frame, at(x), static_cast<unsigned>(frame));
    for (const Point& p : scan.points)
      scan.times_s.push_back(static_cast<float>(0.1 * std::atan2(p.y, p.x) / (2.0 * kPi)));
    for (std::size_t i = 0; i < scan.points.size(); ++i) scan.points[i].x -= 10.f * scan.times_s[i];
    return scan;
  };
  LoopDetector detector{Parameters{}};
  for (int i = 0; i < 4; ++i) ASSERT_TRUE(detector.process(swept(i, -6.0 + i)));
  EXPECT_EQ(detector.index().size(), 4u);
  const Pose T_query = SyntheticWorld::at(-6.0, 0, kPi / 2.0);  // turned: another part is swept first
  const auto found = detector.process(scan_at(world, 1000, T_query, 99));
  ASSERT_TRUE(found && found->loop) << found->reason();
  EXPECT_EQ(found->loop->match, FrameId{0});
  EXPECT_LT(found->loop->T_match_query.translation().norm(), 0.02);
}

// Something so near to all sides but one that it gives no points.
Scan sector_of(Scan scan, double open_deg) {
  const auto half = static_cast<float>(to_radians(open_deg / 2.0));
  std::erase_if(scan.points, [&](const Point& p) { return std::abs(std::atan2(p.y, p.x)) > half; });
  return scan;
}

// The first whole scan says where those before it stood.
TEST(LoopDetector, ALoopLeadsBackToScansThatHadNone) {
  const SyntheticWorld world(51);
  const auto at = [](int i) { return SyntheticWorld::at(-6.0 + i, 0, 0); };
  Parameters parameters;
  parameters.geometric.min_probability = 1.0 - 1e-11;
  LoopDetector detector{parameters};
  for (int i = 0; i < 8; ++i) ASSERT_TRUE(detector.process(scan_at(world, i, at(i), static_cast<unsigned>(i)), at(i)));
  const auto come = [&](int i, double open_deg) {
    Scan scan = scan_at(world, 1000 + i, at(i), 100U + static_cast<unsigned>(i));
    scan.stamp_s = 100.0 + 1.5 * i;  // so slowly that none widens the view of the next
    auto detection = detector.process(sector_of(std::move(scan), open_deg), at(i));
    EXPECT_TRUE(detection);
    return *std::move(detection);
  };
  // It comes from farther off, so that odometry, interrupted for so long, is sure of itself again.
  for (int i = -6; i < 4; ++i) EXPECT_FALSE(come(i, 110.0).loop) << i;
  std::vector<Detection> earlier;
  for (const int i : {4, 5}) {
    Detection detection = come(i, 360.0);
    EXPECT_TRUE(detection.loop) << i << ": " << detection.reason();
    for (Detection& each : detection.earlier) earlier.push_back(std::move(each));
  }
  ASSERT_EQ(earlier.size(), 4u) << "two a scan";
  for (std::size_t k = 0; k < 4; ++k) {
    const int i = 3 - static_cast<int>(k);
    ASSERT_TRUE(earlier[k].loop);
    EXPECT_EQ(earlier[k].frame, FrameId{1000 + i}) << "the newest first";
    EXPECT_EQ(earlier[k].loop->match, FrameId{i});
    EXPECT_LT(earlier[k].loop->T_match_query.translation().norm(), 0.1);
    EXPECT_TRUE(earlier[k].row().accepted);
    ASSERT_TRUE(earlier[k].T_match_query_by_odometry);
    EXPECT_LT(earlier[k].T_match_query_by_odometry->translation().norm(), 1e-9);
  }
}

TEST(LoopDetector, OfAFarAnswerAndAMuchNearerPlaceBothCount) {
  const SyntheticWorld world(51);
  const auto run = [&](bool fits_nearby) {
    LoopDetector detector{Parameters{}};
    for (int i = 0; i < 6; ++i) {
      Scan place = scan_at(world, i, SyntheticWorld::at(i, 0, 0), static_cast<unsigned>(i));
      if (i > 2 && !fits_nearby) place = blocked(std::move(place), 110.0);
      EXPECT_TRUE(detector.add(std::move(place)));
    }
    return *detector.process(scan_at(world, 1000, SyntheticWorld::at(5.0, 0, 0), 104));
  };
  const Detection fits = run(true);
  ASSERT_TRUE(fits.loop) << fits.reason();
  EXPECT_EQ(fits.loop->match.value, 5);
  const Detection hidden = run(false);
  ASSERT_TRUE(hidden.loop) << hidden.reason();
  EXPECT_EQ(hidden.loop->match.value, 5) << "that it fits from farther away counts for it";
  EXPECT_GT(hidden.geometric->log_odds, hidden.geometric->own_log_odds + 2.0);
  EXPECT_LT(hidden.geometric->own_log_odds, fits.geometric->own_log_odds);
}

TEST(LoopDetector, InliersAreComparedWithThoseOfTheScansBefore) {
  const SyntheticWorld world(51);
  LoopDetector detector{Parameters{}};
  for (int i = 0; i < 4; ++i)
    ASSERT_TRUE(detector.add(scan_at(world, i, SyntheticWorld::at(i, 0, 0), static_cast<unsigned>(i))));
  const auto share = [&](const Detection& detection) {
    return detection.geometric->evidence.inlier_ratio / detection.geometric->evidence.inlier_share;
  };
  // 100 s later nothing is known of the last few; then half of each scan is hidden from the one before.
  const auto alone = detector.process(scan_at(world, 1000, SyntheticWorld::at(0, 0, 0), 10));
  ASSERT_TRUE(alone && alone->geometric);
  Scan half = blocked(scan_at(world, 1001, SyntheticWorld::at(0, 0, 0), 11), 150.0);
  const auto poor = detector.process(half);
  ASSERT_TRUE(poor && poor->geometric);
  EXPECT_LT(share(*poor), share(*alone) - 0.1);
}

TEST(LoopDetector, TheFirstPlaceCanBeRecognised) {
  const SyntheticWorld world(52);
  LoopDetector detector{Parameters{}};
  ASSERT_TRUE(detector.process(scan_at(world, 0, SyntheticWorld::at(0, 0, 0), 1), Pose::Identity()));
  Pose drifted = Pose::Identity();
  drifted.translation().x() = 100.0;
  const auto detection = detector.process(scan_at(world, 1000, SyntheticWorld::at(0.5, 0, 0), 2), drifted);
  ASSERT_TRUE(detection && detection->loop);
  EXPECT_EQ(detection->loop->match.value, 0);
  EXPECT_NEAR(detection->T_match_query_by_odometry->translation().x(), 100.0, 1e-9) << "evidence, not a gate";
}

TEST(LoopDetector, AnotherTownIsRefusedAndSaysWhy) {
  LoopDetector detector{Parameters{}};
  const SyntheticWorld home(53), away(54);
  for (int i = 0; i < 5; ++i)
    ASSERT_TRUE(detector.add(scan_at(home, i, SyntheticWorld::at(6.0 * i, 0, 0), static_cast<unsigned>(i))));
  const auto detection = detector.localise(scan_at(away, 0, SyntheticWorld::at(0, 0, 0), 7));
  ASSERT_TRUE(detection);
  EXPECT_FALSE(detection->loop);
  EXPECT_FALSE(detection->reason().empty());
  EXPECT_TRUE(detection->answer) << "what it looked like is told all the same";
  const auto back_home = detector.localise(scan_at(home, 0, SyntheticWorld::at(12.5, 0.5, 0), 8));
  ASSERT_TRUE(back_home && back_home->loop);
  EXPECT_EQ(back_home->loop->match.value, 2);
  EXPECT_EQ(detector.index().size(), 5u) << "localise adds nothing";
}

TEST(LoopDetector, AScanOfNoUseLeavesTheRestAlone) {
  const SyntheticWorld world(55);
  LoopDetector detector{Parameters{}};
  ASSERT_TRUE(detector.process(scan_at(world, 0, SyntheticWorld::at(0, 0, 0), 1)));
  Scan broken;
  broken.frame = FrameId{1};
  EXPECT_FALSE(detector.process(broken));
  EXPECT_TRUE(detector.process(scan_at(world, 2, SyntheticWorld::at(1, 0, 0), 2)));
  EXPECT_EQ(detector.index().size(), 2u);
}

TEST(LoopDetector, ParametersOutOfRangeThrow) {
  Parameters parameters;
  parameters.retrieval.top_k = 0;
  EXPECT_THROW(LoopDetector{parameters}, std::invalid_argument);
}

struct Outcome {
  std::map<std::int64_t, Detection> loops;
};

Outcome run(const std::filesystem::path& folder) {
  const auto recording = open_recording(folder);
  const Parameters parameters;
  LoopDetector detector(parameters, *intensity_scale_of(**recording, parameters.intensity));
  Outcome outcome;
  for (std::size_t i = 0; i < (*recording)->size(); ++i) {
    const auto detection = detector.process(*(*recording)->read(i));
    EXPECT_TRUE(detection) << detection.error().message;
    if (detection && detection->loop) outcome.loops[detection->frame.value] = *detection;
  }
  return outcome;
}

TEST(LoopDetectorOnRealScans, TheOneRevisitAndNoOther) {
  REVISIT_NEEDS_SHARED_DATA();
  const auto outcome = run(shared_data() / "kitti00_mini");
  ASSERT_EQ(outcome.loops.size(), 1u);
  const Detection& detection = outcome.loops.at(4501);
  EXPECT_EQ(detection.candidates[0].match.value, 52) << "top-1";
  const auto recording = open_recording(shared_data() / "kitti00_mini");
  const Trajectory& truth = (*recording)->trajectory();
  const Pose error =
      (truth.at(FrameId{52})->inverse() * *truth.at(FrameId{4501})).inverse() * detection.loop->T_match_query;
  EXPECT_LT(error.translation().norm(), 0.3);
  EXPECT_LT(to_degrees(rotation_angle(error)), 1.0);
}

// The drive is shorter than the exclusion, so this says no more than that the exclusion holds; cli_test shortens it.
TEST(LoopDetectorOnRealScans, NoLoopWithinTheExcludedPast) {
  REVISIT_NEEDS_SHARED_DATA();
  EXPECT_TRUE(run(shared_data() / "kitti_raw_0005").loops.empty());
}

TEST(LoopDetectorOnRealScans, NoScanOfOneTownIsAcceptedInAnother) {
  REVISIT_NEEDS_SHARED_DATA();
  const auto town = open_recording(shared_data() / "kitti_raw_0005"),
             away = open_recording(shared_data() / "kitti00_mini");
  Parameters parameters;
  parameters.geometric.min_overlap = 0.0;  // so that every scan comes as far as registration
  LoopDetector detector(parameters, *intensity_scale_of(**town, parameters.intensity));
  for (std::size_t i = 0; i < (*town)->size(); ++i) ASSERT_TRUE(detector.add(*(*town)->read(i)));
  for (std::size_t i = 0; i < (*away)->size(); i += 4) {  // every fourth: each asks for three registrations
    const auto detection = detector.localise(*(*away)->read(i));
    ASSERT_TRUE(detection);
    EXPECT_FALSE(detection->loop) << "frame " << detection->frame.value;
    ASSERT_TRUE(detection->geometric) << "it came as far as registration";
    EXPECT_LT(detection->geometric->evidence.inlier_ratio, 0.3) << "and not near the threshold";
  }
}

}  // namespace
}  // namespace revisit
