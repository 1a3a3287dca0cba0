// SPDX-License-Identifier: Apache-2.0
#include <revisit/io/pose_file.hpp>

#include <fstream>

#include "shared_data.hpp"

namespace revisit {
namespace {

namespace fs = std::filesystem;
using testing_support::fresh_folder;
using testing_support::shared_data;

Trajectory some_trajectory() {
  Trajectory trajectory;
  for (const int frame : {0, 1, 4}) {
    Pose T = Pose::Identity();
    T.translation() << frame * 1.5, -0.25 * frame, 0.125;
    T.linear() = Eigen::AngleAxisd(0.3 * frame, Eigen::Vector3d(0.1, 0.2, 1.0).normalized()).toRotationMatrix();
    trajectory.entries[FrameId{frame}] = {100.0 + 0.1 * frame, T};
  }
  return trajectory;
}

Pose camera() {
  Pose T = Pose::Identity();
  T.linear() << 0, -1, 0, 0, 0, -1, 1, 0, 0;
  T.translation() << 0.1, -0.2, 0.3;
  return T;
}

void expect_same(const Trajectory& got, const Trajectory& expected) {
  ASSERT_EQ(got.entries.size(), expected.entries.size());
  for (const auto& [frame, entry] : expected.entries) {
    ASSERT_TRUE(got.at(frame)) << frame.value;
    const Pose error = entry.T_world_lidar.inverse() * *got.at(frame);
    EXPECT_LT(error.translation().norm() + rotation_angle(error), 1e-6) << frame.value;
  }
}

const std::vector<FrameTime> kStamps = {{FrameId{0}, 100.0}, {FrameId{1}, 100.1}, {FrameId{4}, 100.4}};

TEST(PoseFile, EveryFormatReadsBackWhatWasWritten) {
  const fs::path folder = fresh_folder();
  const Trajectory trajectory = some_trajectory();
  ASSERT_TRUE(write_kitti_poses(folder / "lidar.txt", trajectory, std::nullopt));
  ASSERT_TRUE(write_kitti_poses(folder / "camera.txt", trajectory, camera()));
  ASSERT_TRUE(write_tum_poses(folder / "poses.tum", trajectory));
  ASSERT_TRUE(write_g2o_poses(folder / "graph.g2o", trajectory));
  for (const auto& [name, calibration] : {std::pair<const char*, std::optional<Pose>>{"lidar.txt", std::nullopt},
                                          {"camera.txt", camera()},
                                          {"poses.tum", std::nullopt},
                                          {"graph.g2o", std::nullopt}}) {
    const auto poses = read_poses(folder / name);
    ASSERT_TRUE(poses) << poses.error().message;
    expect_same(to_trajectory(*poses, calibration, kStamps), trajectory);
  }
}

TEST(PoseFile, TumPosesAreInterpolatedBetweenNearRows) {
  const fs::path file = fresh_folder() / "a.tum";
  std::ofstream(file) << "99.98 0 0 0 0 0 0 1\n100.02 4 0 0 0 0 1 0\n100.5 9 0 0 0 0 0 1\n";
  const Trajectory trajectory =
      to_trajectory(*read_poses(file), std::nullopt, {{FrameId{0}, 100.01}, {FrameId{1}, 100.3}});
  EXPECT_NEAR(trajectory.at(FrameId{0})->translation().x(), 3.0, 1e-6);
  EXPECT_NEAR(to_degrees(rotation_angle(*trajectory.at(FrameId{0}))), 135.0, 1e-6);
  EXPECT_FALSE(trajectory.at(FrameId{1}));
}

TEST(PoseFile, AFrameNumberThatWouldFillTheDiskIsRefused) {
  Trajectory trajectory;
  trajectory.entries[FrameId{999999999}] = {0.0, Pose::Identity()};
  EXPECT_FALSE(write_kitti_poses(fresh_folder() / "poses.txt", trajectory, std::nullopt));
}

TEST(PoseFile, TumRowsGoToTheNearestFrameInTime) {
  const fs::path file = fresh_folder() / "a.tum";
  std::ofstream(file) << "# time x y z q\n100.04 1 0 0 0 0 0 1\n100.149 2 0 0 0 0 0 1\n";
  const auto poses = read_poses(file);
  ASSERT_TRUE(poses);
  const Trajectory trajectory = to_trajectory(*poses, std::nullopt, kStamps);
  EXPECT_DOUBLE_EQ(trajectory.at(FrameId{0})->translation().x(), 1.0);
  EXPECT_DOUBLE_EQ(trajectory.at(FrameId{1})->translation().x(), 2.0);
  EXPECT_FALSE(trajectory.at(FrameId{4})) << "0.29 s away";
}

TEST(PoseFile, RowsThatAreNoPosesAreNamedByLine) {
  const fs::path file = fresh_folder() / "a.txt";
  for (const auto& [text, expected] :
       {std::pair<const char*, const char*>{"1 0 0 0 0 1 0 0 0 0 1 0\n1 2 3\n", ":2: 3 numbers"},
        {"1 0 0 0 0 1 0 0 0 0 1 0\n1 0 0 0 0 5 0 0 0 0 1 0\n", ":2: not a rigid transform"},
        {"1 0 0 0 0 1 0 0 0 0 1 nan\n", ":1: not a rigid transform"},
        {"a b c\n", ":1: 'a b c' is not a row of numbers"},
        {"1 2 3 4 5\n", ":1: 5 numbers"},
        {"0 0 0 0 0 0 0 0\n", ":1: not a rigid transform"},
        {"VERTEX_SE3:QUAT 0 1 2\n", ":1: a vertex needs 8 numbers"},
        {"", "holds no poses"},
        {"# nothing\n", "holds no poses"}}) {
    std::ofstream(file, std::ios::trunc) << text;
    const auto poses = read_poses(file);
    ASSERT_FALSE(poses) << text;
    EXPECT_NE(poses.error().message.find(expected), std::string::npos) << poses.error().message;
  }
}

TEST(PoseFile, RealTrajectories) {
  REVISIT_NEEDS_SHARED_DATA();
  for (const auto& [name, format, count] : {std::tuple{"kitti_00.txt", PoseFormat::kKitti, 4541u},
                                            {"kitti_08.txt", PoseFormat::kKitti, 4071u},
                                            {"mulran_kaist03.txt", PoseFormat::kKitti, 3179u}}) {
    const auto poses = read_poses(shared_data() / "poses" / name);
    ASSERT_TRUE(poses) << poses.error().message;
    EXPECT_EQ(poses->format, format);
    EXPECT_EQ(poses->rows.size(), count) << name;
  }
  // From line 76 on, these "quaternions" have norms other than 1: they are roll, pitch and yaw.
  const auto euler = read_poses(shared_data() / "poses" / "nclt_2012-01-08.tum");
  ASSERT_FALSE(euler);
  EXPECT_NE(euler.error().message.find(":76: not a rigid transform: a quaternion of norm 1.07"), std::string::npos)
      << euler.error().message;
  const auto subset = read_poses(shared_data() / "kitti00_mini" / "poses_subset.txt");
  ASSERT_TRUE(subset);
  EXPECT_EQ(subset->rows.back().frame->value, 4501) << "13 numbers: the frame first";
}

}  // namespace
}  // namespace revisit
