// SPDX-License-Identifier: Apache-2.0
#include <revisit/preprocess/calibration_learning.hpp>

#include <cmath>

#include "shared_data.hpp"
#include "synthetic_world.hpp"

namespace revisit {
namespace {

using testing_support::SyntheticWorld;

// A drive whose sensor reads reflectance * true_gain(distance) * ring_gain: what must be found again.
double true_gain(double distance_m) { return 0.35 + 0.65 * std::exp(-distance_m / 15.0); }
double true_ring_gain(int ring) { return ring % 2 == 0 ? 0.8 : 1.0; }

class CalibrationLearnerFarFromTheOrigin : public testing::TestWithParam<double> {};

TEST_P(CalibrationLearnerFarFromTheOrigin, FindsTheGainsOfASimulatedSensor) {
  const SyntheticWorld world(11);
  CalibrationLearner learner;
  SyntheticWorld::Sensor sensor{32, 900, -24.8, 2.0};
  sensor.with_rings = true;
  for (int i = 0; i < 12; ++i) {
    const Pose T = SyntheticWorld::at(-12.0 + 2.0 * i, 0.0, 0.0);
    Scan scan = world.scan(T, sensor, static_cast<unsigned>(i));
    for (std::size_t k = 0; k < scan.points.size(); ++k) {
      Point& p = scan.points[k];
      p.intensity *= static_cast<float>(true_gain(std::hypot(p.x, p.y, p.z)) * true_ring_gain(scan.rings[k]));
    }
    Pose T_map_lidar = T;  // maps may count from hundreds of kilometres away
    T_map_lidar.translation() += Eigen::Vector3d(GetParam(), 10.0 * GetParam(), 0.0);
    learner.add(scan, scan.rings, T_map_lidar);
  }
  const auto report = learner.solve();
  ASSERT_TRUE(report) << report.error().message;
  EXPECT_LT(report->disagreement_after, 0.6 * report->disagreement_before);
  // phi must undo the fall with distance, up to one common factor.
  const IntensityCalibration& phi = report->calibration;
  const double factor = phi.distance_gain(10.0) * true_gain(10.0);
  for (const double d : {6.0, 15.0, 25.0, 40.0})
    EXPECT_NEAR(phi.distance_gain(d) * true_gain(d) / factor, 1.0, 0.12) << d << " m";
  EXPECT_NEAR(phi.ring_gain(20) / phi.ring_gain(21), 1.0 / 0.8, 0.08);
}

INSTANTIATE_TEST_SUITE_P(Offsets, CalibrationLearnerFarFromTheOrigin, testing::Values(0.0, 400000.0),
                         [](const auto& each) { return each.param == 0.0 ? "none" : "UTM"; });

TEST(CalibrationLearner, AStandingSensorTeachesNothing) {
  const SyntheticWorld world(11);
  CalibrationLearner learner;
  for (int i = 0; i < 3; ++i) {
    const Pose T = SyntheticWorld::at(0, 0, 0);
    learner.add(world.scan(T, {16, 360, -15.0, 15.0}, static_cast<unsigned>(i)), {}, T);
  }
  const auto report = learner.solve();
  ASSERT_FALSE(report);
  EXPECT_NE(report.error().message.find("are needed"), std::string::npos) << report.error().message;
}

}  // namespace
}  // namespace revisit
