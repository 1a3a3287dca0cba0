// SPDX-License-Identifier: Apache-2.0
#include <revisit/io/point_cloud.hpp>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include <gtest/gtest.h>

namespace revisit {
namespace {

constexpr std::uint8_t kUint8 = 2, kUint16 = 4, kInt32 = 5, kUint32 = 6, kFloat32 = 7, kFloat64 = 8;

// A cloud that is written value by value, as drivers do it.
class Cloud {
 public:
  explicit Cloud(std::vector<PointCloudView::Field> fields, bool is_big_endian = false) {
    view_.fields = std::move(fields);
    view_.is_big_endian = is_big_endian;
    constexpr std::size_t kBytes[] = {0, 1, 1, 2, 2, 4, 4, 4, 8};
    for (PointCloudView::Field& field : view_.fields) {
      field.offset = static_cast<std::uint32_t>(view_.point_step);
      view_.point_step += kBytes[field.type];
    }
  }
  void add(const std::vector<double>& values) {
    for (std::size_t i = 0; i < values.size(); ++i) {
      switch (view_.fields[i].type) {
        case kUint8:
          put(static_cast<std::uint8_t>(values[i]));
          break;
        case kUint16:
          put(static_cast<std::uint16_t>(values[i]));
          break;
        case kInt32:
          put(static_cast<std::int32_t>(values[i]));
          break;
        case kUint32:
          put(static_cast<std::uint32_t>(values[i]));
          break;
        case kFloat32:
          put(static_cast<float>(values[i]));
          break;
        default:
          put(values[i]);
      }
    }
    ++view_.width;
  }
  PointCloudView view() const {
    PointCloudView view = view_;
    view.data = bytes_;
    return view;
  }

 private:
  template <typename T>
  void put(T value) {
    std::uint8_t bytes[sizeof(T)];
    std::memcpy(bytes, &value, sizeof(T));
    if (view_.is_big_endian) std::reverse(bytes, bytes + sizeof(T));
    bytes_.insert(bytes_.end(), bytes, bytes + sizeof(T));
  }
  PointCloudView view_;
  std::vector<std::uint8_t> bytes_;
};

const std::vector<PointCloudView::Field> kXyz = {{"x", 0, kFloat32}, {"y", 0, kFloat32}, {"z", 0, kFloat32}};

std::vector<PointCloudView::Field> xyz_and(const std::string& name, std::uint8_t type) {
  auto fields = kXyz;
  fields.push_back({name, 0, type});
  return fields;
}

Scan decode(const Cloud& cloud, std::optional<double> stamp_s, PointTimes* times = nullptr) {
  auto scan = to_scan(cloud.view(), stamp_s, "test", {}, times);
  EXPECT_TRUE(scan) << scan.error().message;
  return scan ? *std::move(scan) : Scan();
}

struct Convention {
  const char* what;
  const char* field;
  std::uint8_t type;
  std::vector<double> values;  ///< of three points
  std::vector<float> expected_s;
  PointTimes::Meaning meaning;
};

TEST(PointTimes, EveryConventionOfDrivers) {
  constexpr double kStamp_s = 1'600'000'000.25;
  using Meaning = PointTimes::Meaning;
  for (const Convention& c : {
           Convention{
               "Velodyne: seconds from the stamp", "time", kFloat32, {0, .05, .1}, {0, .05f, .1f}, Meaning::kFromStamp},
           {"stamp at the end of the sweep", "time", kFloat32, {-.1, -.05, 0}, {-.1f, -.05f, 0}, Meaning::kFromStamp},
           {"stamp in the middle", "time", kFloat32, {-.05, 0, .05}, {-.05f, 0, .05f}, Meaning::kFromStamp},
           {"Ouster: nanoseconds", "t", kUint32, {0, 5e7, 1e8}, {0, .05f, .1f}, Meaning::kFromStamp},
           {"microseconds", "t", kUint32, {0, 5e4, 1e5}, {0, .05f, .1f}, Meaning::kFromStamp},
           {"does not begin at 0", "t", kUint32, {3e6, 5e7, 1e8}, {.003f, .05f, .1f}, Meaning::kFromStamp},
           {"Hesai: seconds since 1970",
            "timestamp",
            kFloat64,
            {kStamp_s, kStamp_s + .05, kStamp_s + .1},
            {0, .05f, .1f},
            Meaning::kAbsolute},
           {"Livox: nanoseconds since 1970",
            "timestamp",
            kFloat64,
            {kStamp_s * 1e9, (kStamp_s + .05) * 1e9, (kStamp_s + .1) * 1e9},
            {0, .05f, .1f},
            Meaning::kAbsolute},
           {"absolute, stamp at the end",
            "timestamp",
            kFloat64,
            {kStamp_s - .1, kStamp_s - .05, kStamp_s},
            {-.1f, -.05f, 0},
            Meaning::kAbsolute},
           {"the sensor's own clock",
            "timestamp",
            kFloat64,
            {512.5, 512.55, 512.6},
            {0, .05f, .1f},
            Meaning::kFromFirstPoint},
           {"backwards at the seam", "t", kUint32, {9e7, 0, 5e7}, {.09f, 0, .05f}, Meaning::kFromStamp},
           {"32 bits roll over",
            "t",
            kUint32,
            {4294967295. - 49999999., 0, 5e7},
            {0, .05f, .1f},
            Meaning::kFromFirstPoint},
           {"microseconds of the hour roll over",
            "t",
            kUint32,
            {3599950000., 0, 50000},
            {0, .05f, .1f},
            Meaning::kFromFirstPoint},
           {"no times at all", "t", kUint32, {7, 7, 7}, {}, Meaning::kNone},
       }) {
    Cloud cloud(xyz_and(c.field, c.type));
    for (const double value : c.values) cloud.add({1, 2, 3, value});
    PointTimes times;
    const Scan scan = decode(cloud, kStamp_s, &times);
    ASSERT_EQ(scan.times_s.size(), c.expected_s.size()) << c.what;
    EXPECT_EQ(times.meaning, c.meaning) << c.what;
    for (std::size_t i = 0; i < c.expected_s.size(); ++i) EXPECT_NEAR(scan.times_s[i], c.expected_s[i], 2e-6) << c.what;
  }
}

TEST(PointTimes, SecondsAndNanosecondsApart) {
  auto fields = xyz_and("time_sec", kUint32);
  fields.push_back({"time_nsec", 0, kUint32});
  Cloud cloud(fields);
  cloud.add({1, 2, 3, 1'600'000'000, 950'000'000});
  cloud.add({1, 2, 3, 1'600'000'001, 50'000'000});
  const Scan scan = decode(cloud, 1'600'000'001.0);
  ASSERT_EQ(scan.times_s.size(), 2u);
  EXPECT_NEAR(scan.times_s[0], -0.05, 1e-6);
  EXPECT_NEAR(scan.times_s[1], 0.05, 1e-6);
}

TEST(PointTimes, AFewOutsideTheSweepDoNotSpoilTheOthers) {
  Cloud cloud(xyz_and("timestamp", kFloat64));
  for (int i = 0; i < 1000; ++i) cloud.add({1, 2, 3, i == 500 ? 0.0 : 100.0 + 1e-4 * i});
  const Scan scan = decode(cloud, 100.0);
  ASSERT_EQ(scan.times_s.size(), 1000u);
  EXPECT_NEAR(scan.times_s[999], 0.0999, 1e-3);
  EXPECT_GE(scan.times_s[500], -1e-3f);
}

TEST(PointCloud, PointsWithoutReturnShiftNoTimes) {
  Cloud cloud(xyz_and("t", kUint32));
  const double nan = std::numeric_limits<double>::quiet_NaN();
  cloud.add({nan, nan, nan, 0});
  cloud.add({1, 2, 3, 4e7});
  cloud.add({0, 0, 0, 6e7});
  cloud.add({4, 5, 6, 8e7});
  const Scan scan = decode(cloud, 5.0);
  ASSERT_EQ(scan.points.size(), 2u);
  EXPECT_EQ(scan.dropped_non_finite, 1u);
  EXPECT_EQ(scan.dropped_at_origin, 1u);
  EXPECT_NEAR(scan.times_s[0], 0.04, 1e-6);
  EXPECT_NEAR(scan.times_s[1], 0.08, 1e-6);
}

TEST(PointCloud, BothByteOrdersAndAllTypesOfIntensityAreTheSame) {
  for (const bool is_big_endian : {false, true})
    for (const std::uint8_t type : {kUint8, kUint16, kInt32, kFloat32, kFloat64}) {
      auto fields = xyz_and("intensity", type);
      fields.push_back({"ring", 0, kUint16});
      Cloud cloud(fields, is_big_endian);
      cloud.add({1.5, -2.25, 300, 200, 31});
      const Scan scan = decode(cloud, std::nullopt);
      ASSERT_EQ(scan.points.size(), 1u);
      EXPECT_EQ(scan.points[0].x, 1.5f);
      EXPECT_EQ(scan.points[0].y, -2.25f);
      EXPECT_EQ(scan.points[0].z, 300.f);
      EXPECT_EQ(scan.points[0].intensity, 200.f);
      EXPECT_EQ(scan.rings[0], 31);
    }
}

TEST(PointCloud, RowsMayBePadded) {
  Cloud cloud(kXyz);
  for (int i = 0; i < 4; ++i) cloud.add({static_cast<double>(i), 1, 1});
  PointCloudView view = cloud.view();
  view.width = 1;
  view.height = 2;
  view.row_step = 36;  // one point, two of padding
  const auto scan = to_scan(view, std::nullopt, "test");
  ASSERT_TRUE(scan) << scan.error().message;
  ASSERT_EQ(scan->points.size(), 2u);
  EXPECT_EQ(scan->points[1].x, 3.f);
}

TEST(PointCloud, LayoutsThatLieAreRefused) {
  Cloud cloud(kXyz);
  cloud.add({1, 2, 3});
  const auto refused = [&](auto change) {
    PointCloudView view = cloud.view();
    change(view);
    const auto scan = to_scan(view, std::nullopt, "test");
    return !scan && scan.error().message.starts_with("test: ");
  };
  EXPECT_TRUE(refused([](PointCloudView& v) { v.width = 2; }));
  EXPECT_TRUE(refused([](PointCloudView& v) { v.height = 1u << 31; }));
  EXPECT_TRUE(refused([](PointCloudView& v) { v.point_step = 8; }));
  EXPECT_TRUE(refused([](PointCloudView& v) { v.row_step = 4; }));
  EXPECT_TRUE(refused([](PointCloudView& v) { v.fields[0].type = 9; }));
  EXPECT_TRUE(refused([](PointCloudView& v) { v.fields[2].offset = 0xFFFFFFFF; }));
  EXPECT_TRUE(refused([](PointCloudView& v) { v.fields[2].name = "w"; }));
  EXPECT_TRUE(refused([](PointCloudView& v) { v.point_step = 0; }));
}

}  // namespace
}  // namespace revisit
