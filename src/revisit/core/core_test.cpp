// SPDX-License-Identifier: Apache-2.0
#include <clocale>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include <gtest/gtest.h>

#include <revisit/core/fast_math.hpp>
#include <revisit/core/intensity_calibration.hpp>
#include <revisit/core/log.hpp>
#include <revisit/core/loop.hpp>
#include <revisit/core/put_in_place.hpp>
#include <revisit/core/refusal_text.hpp>
#include <revisit/core/result.hpp>
#include <revisit/core/scan.hpp>
#include <revisit/core/text.hpp>

namespace revisit {
namespace {

TEST(Result, HoldsEitherValueOrError) {
  const Result<int> good = 7;
  const Result<int> bad = Error{"file x: 3 is not allowed"};
  ASSERT_TRUE(good);
  EXPECT_EQ(*good, 7);
  ASSERT_FALSE(bad);
  EXPECT_EQ(bad.error().message, "file x: 3 is not allowed");
}

TEST(WrapAngle, StaysInHalfOpenTurn) {
  EXPECT_NEAR(wrap_angle(3 * kPi), -kPi, 1e-12);
  EXPECT_NEAR(wrap_angle(-kPi), -kPi, 1e-12);
  EXPECT_NEAR(wrap_angle(0.25 - 4 * kPi), 0.25, 1e-12);
  EXPECT_NEAR(to_degrees(to_radians(33.0)), 33.0, 1e-12);
}

TEST(FastMath, EqualsTheLibrary) {
  for (const float value : {-1e6f, -2.5f, -2.f, -1e-20f, -0.f, 0.f, 1e-20f, 0.99999994f, 1.f, 7.5f, 1e6f})
    EXPECT_EQ(floor_to_int(value), static_cast<int>(std::floor(value))) << value;
  for (int i = 0; i < 720; ++i) {
    const double angle = to_radians(0.5 * i - 180.0);
    const auto y = static_cast<float>(7.0 * std::sin(angle)), x = static_cast<float>(7.0 * std::cos(angle));
    EXPECT_NEAR(approximate_atan2(y, x), std::atan2(y, x), 2e-5) << angle;
  }
}

TEST(UprightPose, TurnsUpToZAndNothingWhereItIsZ) {
  EXPECT_TRUE(upright_pose(Eigen::Vector3f::UnitZ()).linear().isIdentity(0.0));
  const Eigen::Vector3f up = Eigen::Vector3f(0.3f, -0.5f, 0.8f).normalized();
  const Pose T_upright_lidar = upright_pose(up);
  EXPECT_TRUE((T_upright_lidar * up.cast<double>()).isApprox(Eigen::Vector3d::UnitZ(), 1e-6));
  EXPECT_TRUE(T_upright_lidar.linear().isUnitary(1e-9));
  EXPECT_NEAR(rotation_angle(T_upright_lidar), std::acos(static_cast<double>(up.z())), 1e-6) << "no more than needed";
}

TEST(KeepPoints, KeepsRingsAndTimesWithTheirPoints) {
  Scan scan;
  for (int i = 0; i < 5; ++i) {
    scan.points.push_back({static_cast<float>(i), 0.f, 0.f, 0.f});
    scan.rings.push_back(static_cast<std::uint16_t>(10 + i));
    scan.times_s.push_back(0.5f * static_cast<float>(i));
  }
  keep_points(scan, [](std::size_t i) { return i % 2 == 1; });
  ASSERT_EQ(scan.points.size(), 2u);
  EXPECT_EQ(scan.points[1].x, 3.f);
  EXPECT_EQ(scan.rings, (std::vector<std::uint16_t>{11, 13}));
  EXPECT_EQ(scan.times_s, (std::vector<float>{0.5f, 1.5f}));
}

TEST(IntensityCalibration, InterpolatesAndHoldsAtTheEnds) {
  const IntensityCalibration identity;
  EXPECT_TRUE(identity.is_identity());
  EXPECT_EQ(identity.distance_gain(12.0) * identity.ring_gain(3), 1.0);
  const IntensityCalibration table{{10.0, 20.0}, {1.0, 3.0}, {0.5}};
  EXPECT_DOUBLE_EQ(table.distance_gain(5.0), 1.0);
  EXPECT_DOUBLE_EQ(table.distance_gain(15.0), 2.0);
  EXPECT_DOUBLE_EQ(table.distance_gain(99.0), 3.0);
  EXPECT_DOUBLE_EQ(table.ring_gain(0), 0.5);
  EXPECT_DOUBLE_EQ(table.ring_gain(7), 1.0);
}

// A host may speak German: files keep their decimal points.
TEST(Format, WritesDecimalPointsInEveryLocale) {
  const std::string before = std::setlocale(LC_ALL, nullptr);
  const bool is_there = std::setlocale(LC_ALL, "de_DE.UTF-8") != nullptr;
  const std::string text = format("%.2f", 1.5);
  const std::string of_host = std::to_string(1.5);
  std::setlocale(LC_ALL, before.c_str());
  EXPECT_EQ(text, "1.50");
  if (!is_there) GTEST_SKIP() << "de_DE.UTF-8 is not installed; elsewhere this shows more";
  EXPECT_EQ(of_host[1], ',');
}

TEST(PutInPlace, ReplacesFilesAndFoldersAndNamesWhatItCannot) {
  namespace fs = std::filesystem;
  const fs::path folder = fs::path(testing::TempDir()) / "PutInPlace";
  fs::remove_all(folder);
  const auto write = [&](const fs::path& name, const char* text) {
    fs::create_directories((folder / name).parent_path());
    std::ofstream(folder / name) << text;
  };
  const auto read = [&](const fs::path& name) {
    std::ifstream file(folder / name);
    return std::string(std::istreambuf_iterator<char>(file), {});
  };
  write("map.part", "new");
  write("map", "old");
  EXPECT_TRUE(put_in_place(folder / "map.part", folder / "map"));
  EXPECT_EQ(read("map"), "new");
  EXPECT_FALSE(fs::exists(folder / "map.part"));

  write("tiles.part/a/1", "new");
  write("tiles/a/1", "old");
  write("tiles/gone", "old");
  EXPECT_TRUE(put_in_place(folder / "tiles.part", folder / "tiles"));
  EXPECT_EQ(read("tiles/a/1"), "new");
  EXPECT_FALSE(fs::exists(folder / "tiles" / "gone"));
  EXPECT_FALSE(fs::exists(folder / "tiles.part"));

  const Status none = put_in_place(folder / "none", folder / "map");
  ASSERT_FALSE(none);
  EXPECT_NE(none.error().message.find("map: cannot be written: "), std::string::npos) << none.error().message;
  EXPECT_EQ(read("map"), "new");
}

// They stand in a column of candidates.csv, unquoted.
TEST(Refusal, TextsHoldNoComma) {
  for (int reason = 0; reason <= static_cast<int>(Refusal::Reason::kTooFar); ++reason) {
    const std::string text = to_text({static_cast<Refusal::Reason>(reason), 0.001, 0.002});
    EXPECT_EQ(text.find(','), std::string::npos) << text;
  }
}

TEST(LogSink, SilentWithoutASink) {
  log_to({}, LogLevel::kWarning, "nobody listens");
  std::string heard;
  log_to([&](LogLevel, const std::string& message) { heard = message; }, LogLevel::kWarning, "hello");
  EXPECT_EQ(heard, "hello");
}

}  // namespace
}  // namespace revisit
