// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <fstream>
#include <iomanip>
#include <set>

#include <revisit/io/pose_file.hpp>
#include <revisit/simulation/write_recording.hpp>

#include "shared_data.hpp"

namespace revisit {
namespace {

namespace fs = std::filesystem;
using testing_support::fresh_folder;

SimulationOptions small(const std::string& world, const std::string& sensor = "vlp16") {
  SimulationOptions options;
  options.world = world;
  options.sensor = sensor;
  options.length_m = 60.0;
  return options;
}

std::unique_ptr<SimulatedRecording> make(const SimulationOptions& options, int threads = 0) {
  auto recording = simulate(options, {}, threads);
  EXPECT_TRUE(recording) << (recording ? "" : recording.error().message);
  return recording ? *std::move(recording) : nullptr;
}

std::string refusal(const SimulationOptions& options) {
  const auto recording = simulate(options);
  return recording ? "" : recording.error().message;
}

bool same_bytes(const Scan& a, const Scan& b) {
  return a.points.size() == b.points.size() && a.rings == b.rings && a.times_s == b.times_s &&
         std::memcmp(a.points.data(), b.points.data(), a.points.size() * sizeof(Point)) == 0;
}

TEST(Simulation, TheSameBytesForAnyNumberOfThreadsAndInAnyOrder) {
  const auto one = make(small("town"), 1), many = make(small("town"), 3);
  ASSERT_EQ(one->size(), many->size());
  const Scan last = *one->read(20);
  for (const std::size_t index : {0u, 10u, 20u}) EXPECT_TRUE(same_bytes(*one->read(index), *many->read(index)));
  EXPECT_TRUE(same_bytes(last, *one->read(20)));
}

TEST(Simulation, AnotherSeedIsAnotherWorld) {
  SimulationOptions other = small("town");
  other.seed = 2;
  EXPECT_FALSE(same_bytes(*make(small("town"))->read(5), *make(other)->read(5)));
}

TEST(Simulation, DifficultyIsReproducibleAndChangesTheWorld) {
  SimulationOptions hard = small("town", "hdl64e");
  hard.difficulty = 1.0;
  const Scan scan = *make(hard, 1)->read(30), tame = *make(small("town", "hdl64e"))->read(30);
  EXPECT_TRUE(same_bytes(scan, *make(hard, 3)->read(30)));
  EXPECT_FALSE(same_bytes(scan, tame));
  EXPECT_LT(scan.points.size(), tame.points.size()) << "drop-outs, weather";
  EXPECT_GT(scan.points.size(), tame.points.size() / 2);
}

TEST(Simulation, ABuildingIsWalkedThrough) {
  SimulationOptions options = small("building", "os0-128");
  options.difficulty = 1.0;
  const auto walk = make(options);
  const Scan scan = *walk->read(100);
  EXPECT_GT(scan.points.size(), 50'000u);
  // Walls on both sides of the corridor, a ceiling above.
  int near = 0, above = 0;
  for (const Point& p : scan.points) {
    near += std::hypot(p.x, p.y) < 3.f;
    above += p.z > 0.6f && p.z < 1.f;
  }
  EXPECT_GT(near, 20'000);
  EXPECT_GT(above, 5'000);
  options.trajectory = "poses.txt";
  EXPECT_NE(refusal(options).find("a building has its own walk"), std::string::npos);
}

TEST(Simulation, WhoWalksTurnsAsPeopleDo) {
  const auto walk = make(small("building", "os0-128"));
  ASSERT_GT(walk->size(), 300u);
  double most_radps = 0.0;
  for (std::size_t i = 1; i < walk->size(); ++i) {
    const Pose T_before = *walk->trajectory().at(walk->frame(i - 1)), T_here = *walk->trajectory().at(walk->frame(i));
    const double turned_rad = rotation_angle(T_before.inverse() * T_here);
    most_radps = std::max(most_radps, turned_rad / (walk->stamp_s(i) - walk->stamp_s(i - 1)));
  }
  EXPECT_GT(most_radps, 0.5) << "there are corners";
  EXPECT_LT(most_radps, 2.5);
}

TEST(Simulation, EverySensorKeepsToItsTable) {
  for (const SensorModel& sensor : sensor_models()) {
    SCOPED_TRACE(sensor.name);
    const auto recording = make(small("town", sensor.name));
    const Scan scan = *recording->read(30);
    EXPECT_GT(scan.points.size(), sensor.beams() / (sensor.is_dome() ? 6 : 3)) << "a dome sees much sky";
    EXPECT_LE(scan.points.size(), sensor.beams());
    EXPECT_EQ(scan.rings.size(), sensor.rotates() ? scan.points.size() : 0u);
    ASSERT_EQ(scan.times_s.size(), scan.points.size());
    std::set<int> rings(scan.rings.begin(), scan.rings.end());
    EXPECT_GE(rings.size(), sensor.elevations_deg.size() / 3);
    double off_step = 0.0;
    for (std::size_t i = 0; i < scan.points.size(); ++i) {
      const Point& p = scan.points[i];
      const double range_m = std::sqrt(double{p.x} * p.x + double{p.y} * p.y + double{p.z} * p.z);
      ASSERT_GE(range_m, sensor.min_range_m - 1e-3);
      ASSERT_LE(range_m, sensor.max_range_m + 1e-3);
      ASSERT_LE(std::abs(scan.times_s[i]), 0.5 * sensor.sweep_s);
      ASSERT_GE(p.intensity, 0.f);
      ASSERT_LE(double{p.intensity}, sensor.intensity_max + 1e-6);
      const double steps = p.intensity / sensor.intensity_step;
      off_step = std::max(off_step, std::abs(steps - std::round(steps)));
      if (sensor.rotates()) {
        const double elevation = to_degrees(std::asin(p.z / range_m));
        ASSERT_NEAR(elevation, sensor.elevations_deg[scan.rings[i]], 0.01);
      } else if (sensor.is_dome()) {
        const double elevation = to_degrees(std::asin(p.z / range_m));
        ASSERT_GE(elevation, sensor.lowest_deg - 1e-3);
        ASSERT_LE(elevation, sensor.highest_deg + 1e-3);
      } else {
        ASSERT_LT(to_degrees(std::acos(p.x / range_m)), sensor.rosette_half_angle_deg + 4.0);
      }
    }
    EXPECT_LT(off_step, 1e-3);
  }
}

TEST(Simulation, RosetteAndDomeDoNotRepeat) {
  for (const char* sensor : {"rosette", "mid360"}) {
    SCOPED_TRACE(sensor);
    const auto recording = make(small("warehouse", sensor));
    const Scan a = *recording->read(1), b = *recording->read(2);
    // Directions of one scan, in cells of a tenth of a degree: the next one looks mostly elsewhere.
    const auto cells = [](const Scan& scan) {
      std::set<std::pair<int, int>> result;
      for (const Point& p : scan.points)
        result.emplace(static_cast<int>(to_degrees(std::atan2(p.y, p.x)) * 10 + 5000),
                       static_cast<int>(to_degrees(std::atan2(p.z, std::hypot(p.x, p.y))) * 10 + 5000));
      return result;
    };
    const auto first = cells(a), second = cells(b);
    std::size_t common = 0;
    for (const auto& cell : second) common += first.contains(cell);
    EXPECT_LT(static_cast<double>(common), 0.35 * static_cast<double>(second.size()));
  }
}

TEST(Simulation, WhatCarriesTheSensorHidesTheViewBehindIt) {
  const auto azimuth_deg = [](const Point& p) { return std::abs(to_degrees(std::atan2(p.y, p.x))); };
  SimulationOptions options = small("town", "os1-64");
  const Scan whole = *make(options)->read(30);
  options.blind_deg = 90.0;
  const Scan ahead = *make(options)->read(30);
  std::size_t seen = 0;
  for (const Point& p : whole.points) seen += azimuth_deg(p) < 134.9;
  EXPECT_LT(seen, whole.points.size()) << "without, it sees what is behind";
  EXPECT_NEAR(static_cast<double>(ahead.points.size()), static_cast<double>(seen), 0.01 * static_cast<double>(seen));
  for (const Point& p : ahead.points) ASSERT_LT(azimuth_deg(p), 135.1);
}

// The floor of the warehouse is flat at z = 0 and its western wall stands at x = 0: of the points, brought into the
// world by the poses of their own times, many must lie on them, and none below or behind.
void expect_on_floor_and_wall(const SimulationOptions& options) {
  constexpr double kNear_m = 0.05;  // three times the sensor's noise
  const auto recording = make(options);
  std::size_t on_floor = 0, below = 0, on_wall = 0, behind = 0;
  for (std::size_t index = 20; index + 1 < recording->size(); index += 40) {
    const Scan scan = *recording->read(index);
    const Pose T = *recording->trajectory().at(scan.frame);
    for (std::size_t i = 0; i < scan.points.size(); ++i) {
      const Point& p = scan.points[i];
      // Poses change alike from one stamp to the next.
      const double share = scan.times_s.empty() ? 0.0 : double{scan.times_s[i]} / 0.1;
      const Pose T_other = *recording->trajectory().at(FrameId{scan.frame.value + (share < 0.0 ? -1 : 1)});
      const Eigen::AngleAxisd turn(T.linear().transpose() * T_other.linear());
      Pose T_point = T;
      T_point.linear() = T.linear() * Eigen::AngleAxisd(std::abs(share) * turn.angle(), turn.axis()).toRotationMatrix();
      T_point.translation() += std::abs(share) * (T_other.translation() - T.translation());
      const Eigen::Vector3d world = T_point * Eigen::Vector3d(p.x, p.y, p.z);
      on_floor += std::abs(world.z()) <= kNear_m;
      below += world.z() < -kNear_m;
      on_wall += std::abs(world.x()) <= kNear_m && world.z() > 0.5;
      behind += world.x() < -kNear_m;
    }
  }
  EXPECT_GT(on_floor, 10000u);
  EXPECT_LT(below, on_floor / 500);
  EXPECT_GT(on_wall, 3000u);
  EXPECT_LT(behind, on_wall / 200);
}

TEST(Simulation, PosesAndTimesArePreciseWithMotionDistortion) {
  SimulationOptions options = small("warehouse");
  options.traffic = 0.0;
  expect_on_floor_and_wall(options);
}

TEST(Simulation, PosesArePreciseWithoutMotionDistortion) {
  SimulationOptions options = small("warehouse");
  options.traffic = 0.0;
  options.motion_distortion = false;
  EXPECT_TRUE(make(options)->read(3)->times_s.empty());
  expect_on_floor_and_wall(options);
}

// How alike the intensities of a scan and the pixels they lie on are, from -1 to 1; in the image or its mirror.
double correlation(const Scan& scan, const Image& image, bool is_mirrored) {
  std::vector<Eigen::Vector2d> pairs;
  for (const Point& p : scan.points) {
    if (p.x < 2.f) continue;
    const auto column = static_cast<int>(320.f - (is_mirrored ? -1.f : 1.f) * 320.f * p.y / p.x);
    const auto row = static_cast<int>(120.f - 320.f * p.z / p.x);
    if (column < 0 || column >= image.width || row < 0 || row >= image.height) continue;
    const auto first = static_cast<std::size_t>(row) * static_cast<std::size_t>(image.width);
    pairs.emplace_back(std::min(0.6, static_cast<double>(p.intensity)),
                       image.grey[first + static_cast<std::size_t>(column)]);
  }
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  for (const auto& pair : pairs) mean += pair / static_cast<double>(pairs.size());
  Eigen::Matrix2d products = Eigen::Matrix2d::Zero();
  for (const auto& pair : pairs) products += (pair - mean) * (pair - mean).transpose();
  return products(0, 1) / std::sqrt(products(0, 0) * products(1, 1));
}

TEST(Simulation, TheCameraSeesWhatTheLidarSees) {
  SimulationOptions options = small("town", "hdl64e");
  options.motion_distortion = false;
  const auto recording = make(options);
  double straight = 0.0, mirrored = 0.0;
  for (const std::size_t i : {0u, 20u, 40u, 60u}) {
    const Image image = recording->image(i);
    ASSERT_EQ(image.grey.size(), 640u * 240u);
    straight += correlation(*recording->read(i), image, false) / 4.0;
    mirrored += correlation(*recording->read(i), image, true) / 4.0;
  }
  EXPECT_GT(straight, 0.3);
  EXPECT_LT(mirrored, straight - 0.2);
}

TEST(Simulation, ImagesAreReproducibleAndNightsAreDark) {
  const auto one = make(small("town"), 1), all = make(small("town"));
  const Image day = all->image(30), night = all->image(30, ImageLight::kNight);
  EXPECT_EQ(day.grey, one->image(30).grey);
  EXPECT_NE(day.grey, all->image(29).grey);
  const auto dark = [](const Image& image) {
    return std::count_if(image.grey.begin(), image.grey.end(), [](std::uint8_t grey) { return grey < 25; });
  };
  EXPECT_GT(dark(night), 3 * dark(day));
}

TEST(Simulation, ATiltedSensorLeansAsFarAsItMay) {
  SimulationOptions options = small("town");
  options.length_m = 300.0;
  options.tilt_deg = 40.0;
  double most_deg = 0.0;
  const auto recording = make(options);
  for (const auto& [frame, entry] : recording->trajectory().entries)
    most_deg = std::max(most_deg, to_degrees(std::acos(entry.T_world_lidar.linear()(2, 2))));
  EXPECT_GT(most_deg, 30.0);
  EXPECT_LE(most_deg, 40.0 + 1e-6);
}

struct Revisits {
  int same_way = 0, other_way = 0;
};
Revisits count_revisits(const Trajectory& trajectory) {
  std::vector<Pose> poses;
  for (const auto& [frame, entry] : trajectory.entries) poses.push_back(entry.T_world_lidar);
  Revisits revisits;
  for (std::size_t i = 300; i < poses.size(); ++i) {
    bool same = false, other = false;
    for (std::size_t j = 0; j + 300 < i; ++j) {
      if ((poses[i].translation() - poses[j].translation()).norm() > 4.0) continue;
      const double turn_deg = std::abs(to_degrees(wrap_angle(yaw_of(poses[i]) - yaw_of(poses[j]))));
      same |= turn_deg < 30.0;
      other |= turn_deg > 150.0;
    }
    revisits.same_way += same;
    revisits.other_way += other;
  }
  return revisits;
}

TEST(Simulation, ATownIsDrivenThroughAgainTheSameWayAndTheOtherWay) {
  for (const int seed : {1, 2, 3}) {
    SimulationOptions options;
    options.seed = seed;
    const auto recording = make(options);
    const Revisits revisits = count_revisits(recording->trajectory());
    EXPECT_GT(revisits.same_way, 80) << "seed " << seed;
    EXPECT_GT(revisits.other_way, 70) << "seed " << seed;
    const auto& entries = recording->trajectory().entries;
    double driven_m = 0.0;
    for (auto next = std::next(entries.begin()); next != entries.end(); ++next)
      driven_m +=
          (next->second.T_world_lidar.translation() - std::prev(next)->second.T_world_lidar.translation()).norm();
    EXPECT_NEAR(driven_m, 1000.0, 30.0);
  }
}

TEST(Simulation, TheWarehouseRobotComesBackTheSameWay) {
  SimulationOptions options = small("warehouse");
  options.length_m = 150.0;
  const auto recording = make(options);
  EXPECT_GT(count_revisits(recording->trajectory()).other_way, 400);
  const auto& entries = recording->trajectory().entries;
  const Eigen::Vector3d home = entries.begin()->second.T_world_lidar.translation(),
                        end = entries.rbegin()->second.T_world_lidar.translation();
  EXPECT_LT((home - end).norm(), 1.0);
}

TEST(Simulation, OdometriesDriftButNotAtOnce) {
  SimulationOptions options = small("town");
  options.length_m = 400.0;
  const auto recording = make(options);
  for (const Trajectory* odometry : {&recording->wheel_odometry(), &recording->drifting_odometry()}) {
    ASSERT_EQ(odometry->entries.size(), recording->size());
    const auto error_m = [&](std::int64_t frame) {
      return (odometry->at(FrameId{frame})->translation() - recording->trajectory().at(FrameId{frame})->translation())
          .head<2>()
          .norm();
    };
    EXPECT_LT(error_m(1), 0.2);
    EXPECT_GT(error_m(static_cast<std::int64_t>(recording->size()) - 1), 0.5);
    EXPECT_LT(error_m(static_cast<std::int64_t>(recording->size()) - 1), 60.0);
  }
}

TEST(Simulation, WhatIsWrittenIsReadBackTheSame) {
  SimulationOptions options = small("town");
  options.frames = 3;
  const auto recording = make(options);
  const fs::path folder = fresh_folder() / "drive";
  std::size_t reported = 0;
  ASSERT_TRUE(write_recording(*recording, folder, 2, [&](std::size_t done) { return reported = done, true; }));
  EXPECT_EQ(reported, 3u);
  const auto read = open_recording(folder);
  ASSERT_TRUE(read) << read.error().message;
  ASSERT_EQ((*read)->size(), 3u);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_TRUE(same_bytes(*recording->read(i), *(*read)->read(i)));
    EXPECT_NEAR((*read)->stamp_s(i), recording->stamp_s(i), 1e-6);
    EXPECT_TRUE((*read)
                    ->trajectory()
                    .at(read.operator*()->frame(i))
                    ->isApprox(*recording->trajectory().at(recording->frame(i)), 1e-6));
  }
  for (const char* file : {"wheel_odometry.tum", "odometry.tum"}) {
    const auto odometry = read_poses(folder / file);
    ASSERT_TRUE(odometry) << odometry.error().message;
    EXPECT_EQ(odometry->rows.size(), 3u);
  }
}

TEST(Simulation, AFolderThatHoldsSomethingIsLeftAlone) {
  const fs::path folder = fresh_folder();
  std::ofstream(folder / "mine.txt") << "precious";
  SimulationOptions options = small("town");
  options.frames = 1;
  const Status status = write_recording(*make(options), folder);
  ASSERT_FALSE(status);
  EXPECT_NE(status.error().message.find("holds something already"), std::string::npos);
  EXPECT_EQ(std::distance(fs::directory_iterator(folder), fs::directory_iterator()), 1);
}

TEST(Simulation, StopsWhenAskedAndLeavesARecordingWithoutHoles) {
  SimulationOptions options = small("town");
  options.frames = 20;
  const fs::path folder = fresh_folder() / "drive";
  ASSERT_TRUE(write_recording(*make(options), folder, 2, [](std::size_t done) { return done < 4; }));
  const auto read = open_recording(folder);
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_GE((*read)->size(), 4u);
  EXPECT_LE((*read)->size(), 6u);
  for (std::size_t i = 0; i < (*read)->size(); ++i) EXPECT_EQ((*read)->frame(i).value, static_cast<std::int64_t>(i));
}

TEST(Simulation, UnknownNamesAreToldWithTheKnownOnes) {
  EXPECT_EQ(refusal(small("town", "hdl32")),
            "simulation.sensor = 'hdl32' is not known; allowed: hdl64e, vlp16, os0-128, rosette, os1-64, mid360");
  EXPECT_EQ(refusal(small("moon")), "simulation.world = 'moon' is not known; allowed: town, warehouse, building");
}

std::string drive_along(const std::string& rows) {
  const fs::path file = fresh_folder() / "poses.txt";
  std::ofstream(file) << rows;
  SimulationOptions options = small("town");
  options.trajectory = file.string();
  return refusal(options);
}

std::string kitti_row(double x, double z) {
  std::ostringstream row;
  row << "1 0 0 " << x << " 0 1 0 0 0 0 1 " << z << "\n";
  return row.str();
}

TEST(Simulation, TrajectoriesThatCannotBeDrivenAreRefused) {
  EXPECT_EQ(drive_along(kitti_row(0, 0) + kitti_row(0, 1) + kitti_row(0, 2)), "");
  EXPECT_NE(drive_along(kitti_row(0, 0)).find("holds 1 pose; a drive needs at least 2"), std::string::npos);
  EXPECT_NE(drive_along(kitti_row(0, 0) + kitti_row(0, 1) + kitti_row(40, 1)).find("pose 3: a jump of 40.0 m"),
            std::string::npos);
  EXPECT_NE(drive_along(kitti_row(0, 0) + "1 0 0 nan 0 1 0 0 0 0 1 0\n").find(":2: not a rigid transform"),
            std::string::npos);
  std::string gap = kitti_row(0, 0) + kitti_row(0, 1);
  for (int i = 0; i < 12; ++i) gap += i < 11 ? "nan " : "nan\n";
  EXPECT_NE(drive_along(gap).find("1 rows of NaN"), std::string::npos) << "NaN is counted as a row";
  EXPECT_NE(drive_along(kitti_row(0, 0) + kitti_row(0, 0)).find("the drive is 0.000000 m long"), std::string::npos);
  EXPECT_NE(drive_along("0 0 0 0 0 0 0 1\n1 1 0 0 0 0 0 1\n1 2 0 0 0 0 0 1\n").find("does not increase"),
            std::string::npos);
  EXPECT_NE(drive_along("0 0 0 0 0 0 0 1\n9 1 0 0 0 0 0 1\n").find("9.0 s after"), std::string::npos);
  EXPECT_NE(drive_along("").find("holds no poses"), std::string::npos);
  SimulationOptions indoors = small("warehouse");
  indoors.trajectory = "poses.txt";
  EXPECT_NE(refusal(indoors).find("a warehouse has its own drive"), std::string::npos);
}

// The same drive in coordinates of a map grid: the same scans to the bit, and poses that differ by the offset alone.
TEST(Simulation, DrivesFarFromTheOriginAreAsPrecise) {
  const auto along = [](double east_m, double north_m) {
    const fs::path file = fresh_folder() / "poses.tum";
    std::ofstream rows(file);
    rows << std::setprecision(12);
    for (int i = 0; i < 30; ++i)
      rows << 0.1 * i << " " << east_m + 0.75 * i << " " << north_m + 0.25 * i << " 0 0 0 0 1\n";
    rows.close();
    SimulationOptions options = small("town");
    options.trajectory = file.string();
    return make(options);
  };
  const auto near = along(0, 0), far = along(330000, 4150000);
  EXPECT_TRUE(same_bytes(*near->read(10), *far->read(10)));
  const Eigen::Vector3d offset =
      far->trajectory().at(FrameId{10})->translation() - near->trajectory().at(FrameId{10})->translation();
  EXPECT_LT((offset - Eigen::Vector3d(330000, 4150000, 0)).norm(), 1e-6);
}

TEST(Simulation, ATrajectoryIsFollowed) {
  REVISIT_NEEDS_SHARED_DATA();
  SimulationOptions options = small("town");
  options.trajectory = (testing_support::shared_data() / "poses/kitti_06.txt").string();
  const auto recording = make(options);
  const auto poses = read_poses(options.trajectory);
  ASSERT_EQ(recording->size(), poses->rows.size());
  for (const std::int64_t frame : {0, 300, 1100}) {
    const Eigen::Vector3d camera = poses->rows[static_cast<std::size_t>(frame)].T_world_body.translation();
    const Eigen::Vector3d lidar = recording->trajectory().at(FrameId{frame})->translation();
    EXPECT_NEAR(lidar.x(), camera.z(), 0.1);   // z forward, x right -> x forward, y left
    EXPECT_NEAR(lidar.y(), -camera.x(), 0.1);  // the mast leans with the road
  }
}

}  // namespace
}  // namespace revisit
