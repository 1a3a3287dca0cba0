// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <map>
#include <tuple>

#include <gtest/gtest.h>

#include <revisit/io/bag_topics.hpp>
#include <revisit/io/recording.hpp>
#include <revisit/io/scan_file.hpp>

#include "shared_data.hpp"

namespace revisit {
namespace {

namespace fs = std::filesystem;
using testing_support::shared_data;

fs::path packets() { return shared_data() / "recordings" / "packets"; }

std::unique_ptr<Recording> open_packets(const fs::path& file, const RecordingOptions& options = {}) {
  auto recording = open_recording(file, {}, options);
  EXPECT_TRUE(recording) << recording.error().message;
  return recording ? *std::move(recording) : nullptr;
}

Scan read(const Recording& recording, std::size_t index) {
  auto scan = recording.read(index);
  EXPECT_TRUE(scan) << scan.error().message;
  return scan ? *std::move(scan) : Scan();
}

// How far points lie from the nearest of a reference, metres, sorted. Farther than 0.2 m counts as 1.
std::vector<double> distances(const std::vector<Point>& points, const std::vector<Point>& reference) {
  constexpr float kCell_m = 0.2f;
  const auto cell = [](float value) { return static_cast<int>(std::floor(value / kCell_m)); };
  std::map<std::tuple<int, int, int>, std::vector<Point>> cells;
  for (const Point& p : reference) cells[{cell(p.x), cell(p.y), cell(p.z)}].push_back(p);
  std::vector<double> result;
  for (const Point& p : points) {
    double nearest = 1.0;
    for (int i = 0; i < 27; ++i) {
      const auto found = cells.find({cell(p.x) + i % 3 - 1, cell(p.y) + i / 3 % 3 - 1, cell(p.z) + i / 9 - 1});
      if (found == cells.end()) continue;
      for (const Point& q : found->second)
        nearest = std::min(nearest, static_cast<double>(std::hypot(p.x - q.x, p.y - q.y, p.z - q.z)));
    }
    result.push_back(nearest);
  }
  std::sort(result.begin(), result.end());
  return result;
}

struct Decoded {
  const char* bag;
  const char* truth;
  std::size_t scan;
};

TEST(VelodynePackets, AgreeWithTheReferenceDecoder) {
  REVISIT_NEEDS_SHARED_DATA();
  for (const auto& [bag, truth, index] :
       {Decoded{"vlp16.db3", "vlp16_truth.pcd", 3}, {"vlp32.db3", "vlp32_truth.pcd", 0}}) {
    const auto recording = open_packets(packets() / bag);
    ASSERT_TRUE(recording);
    const auto reference = read_scan(packets() / truth);
    ASSERT_TRUE(reference) << reference.error().message;
    const Scan scan = read(*recording, index);
    for (const auto& apart : {distances(scan.points, reference->points), distances(reference->points, scan.points)}) {
      EXPECT_LT(apart[apart.size() / 2], 1e-4) << bag;
      EXPECT_LT(apart[apart.size() * 95 / 100], 1e-3) << bag;
    }
    const auto [first, last] = std::minmax_element(scan.times_s.begin(), scan.times_s.end());
    EXPECT_FLOAT_EQ(*first, 0.f);
    EXPECT_NEAR(*last, recording->size() == 4 ? 0.1 : 0.05, 2e-3) << "a turn, or the half of it that the bag has";
    EXPECT_EQ(scan.rings.size(), scan.points.size());
  }
}

TEST(VelodynePackets, ScansAreCutAtAFixedAzimuth) {
  REVISIT_NEEDS_SHARED_DATA();
  const auto recording = open_packets(shared_data() / "formats/vlp16_50_frames.pcap");
  ASSERT_TRUE(recording);
  EXPECT_NEAR(static_cast<double>(recording->size()), 50, 1);
  EXPECT_NE(recording->findings()[0].find("VLP-16"), std::string::npos)
      << "although its packets call it an HDL-32E: they come as those of a VLP-16 do";
  for (const std::size_t i : {std::size_t{1}, std::size_t{25}}) {
    const Scan scan = read(*recording, i);
    EXPECT_NEAR(recording->stamp_s(i + 1) - scan.stamp_s, 0.05, 2e-4) << "20 turns a second";
    EXPECT_DOUBLE_EQ(recording->stamp_s(i), scan.stamp_s);
    EXPECT_EQ(*std::max_element(scan.rings.begin(), scan.rings.end()), 15);
    const auto [first, last] = std::minmax_element(scan.times_s.begin(), scan.times_s.end());
    for (const auto& [time, side] : {std::pair{first, 1.f}, {last, -1.f}}) {
      const Point& p = scan.points[static_cast<std::size_t>(time - scan.times_s.begin())];
      EXPECT_LT(p.x, 0.f) << "begins and ends behind";
      EXPECT_LT(std::abs(std::atan2(p.y, -p.x)), 0.1f);
    }
  }
}

TEST(VelodynePackets, OthersOnTheWireArePassedOver) {
  REVISIT_NEEDS_SHARED_DATA();
  const auto recording = open_packets(packets() / "vlp16_with_position.pcap");
  ASSERT_TRUE(recording);
  EXPECT_EQ(recording->size(), 4u);
  const auto topics = list_topics(packets() / "vlp16_with_position.pcap");
  ASSERT_TRUE(topics);
  ASSERT_EQ(topics->size(), 2u);
  EXPECT_EQ((*topics)[0].messages, 293u);
  EXPECT_EQ((*topics)[1].messages, 57u);
  EXPECT_EQ((*topics)[0].use, "scans of a VLP-16");
  EXPECT_TRUE((*topics)[1].use.empty());
}

TEST(VelodynePackets, Hdl32) {
  REVISIT_NEEDS_SHARED_DATA();
  const auto recording = open_packets(shared_data() / "formats/hdl32.pcap");
  ASSERT_TRUE(recording);
  ASSERT_EQ(recording->size(), 3u);
  const Scan scan = read(*recording, 1);
  EXPECT_GT(scan.points.size(), 45'000u);
  EXPECT_NEAR(recording->stamp_s(2) - recording->stamp_s(1), 0.1, 0.02);
  // The ground: what the lowest beams meet far enough from the vehicle lies on one level, more than on any other.
  std::map<int, int> levels;  // of 0.2 m
  int low = 0;
  for (std::size_t i = 0; i < scan.points.size(); ++i) {
    const Point& p = scan.points[i];
    if (scan.rings[i] >= 16 || std::hypot(p.x, p.y) < 4.f) continue;
    ++levels[static_cast<int>(std::floor(p.z / 0.2f))];
    ++low;
  }
  const auto ground =
      std::max_element(levels.begin(), levels.end(), [](auto& a, auto& b) { return a.second < b.second; });
  EXPECT_LT(ground->first, -8);
  EXPECT_GT(ground->second, low / 3);
}

struct Ouster {
  const char* file;
  std::size_t points;
  std::uint16_t rings;
  float reach_m;
};
TEST(OusterPackets, EveryGenerationOfTheirFormat) {
  REVISIT_NEEDS_SHARED_DATA();
  for (const auto& [file, points, rings, reach_m] :
       {Ouster{"OS-0-32-U1_v2.2.0_1024x10.pcap", 21631, 32, 63.f},
        {"OS-1-128_767798045_1024x10_20230712_120049.pcap", 16373, 128, 4.f},
        {"OS-1-32-G_v2.1.1_1024x10.pcap", 27310, 32, 205.f},
        {"../../formats/ouster_packets_ros1.bag", 28751, 128, 12.f}}) {
    const auto recording = open_packets(packets() / file);
    ASSERT_TRUE(recording);
    ASSERT_EQ(recording->size(), 1u) << file;
    const Scan scan = read(*recording, 0);
    EXPECT_EQ(scan.points.size(), points) << file;
    EXPECT_LT(*std::max_element(scan.rings.begin(), scan.rings.end()), rings) << file;
    const auto farthest = std::max_element(scan.points.begin(), scan.points.end(), [](const Point& a, const Point& b) {
      return std::hypot(a.x, a.y, a.z) < std::hypot(b.x, b.y, b.z);
    });
    EXPECT_LT(std::hypot(farthest->x, farthest->y, farthest->z), reach_m) << file;
    // One beam is a cone: what it meets lies at one elevation, but for the few cm by which the beam misses the axis.
    for (const std::uint16_t ring : {std::uint16_t{0}, static_cast<std::uint16_t>(rings - 1)}) {
      std::vector<double> elevations;
      for (std::size_t i = 0; i < scan.points.size(); ++i) {
        const Point& p = scan.points[i];
        if (scan.rings[i] == ring && std::hypot(p.x, p.y) > 3.f)
          elevations.push_back(std::atan2(static_cast<double>(p.z) - 0.036, std::hypot(p.x, p.y)));
      }
      if (elevations.empty()) continue;
      std::sort(elevations.begin(), elevations.end());
      EXPECT_LT(elevations.back() - elevations.front(), 0.01) << file << " ring " << ring;
    }
  }
}

TEST(OusterPackets, TwoSensorsOnOnePortInFragments) {
  REVISIT_NEEDS_SHARED_DATA();
  const fs::path file = packets() / "two_ousters_fragmented.pcap";
  const auto both = open_recording(file);
  ASSERT_FALSE(both);
  EXPECT_NE(both.error().message.find("name one with --topic"), std::string::npos);
  EXPECT_NE(both.error().message.find("169.254.92.158"), std::string::npos);
  for (const auto& [sender, sensor, points] :
       {std::tuple{"169.254.92.158", "OS-0-128", 1964u}, {"169.254.238.111", "OS-1-64", 985u}}) {
    const auto recording = open_packets(file, {.topic = sender});
    ASSERT_TRUE(recording);
    EXPECT_NE(recording->findings()[0].find(sensor), std::string::npos);
    EXPECT_EQ(read(*recording, 0).points.size(), points);
  }
}

TEST(OusterPackets, TheLastOfTwoReturnsLiesBehindTheStrongest) {
  REVISIT_NEEDS_SHARED_DATA();
  const fs::path file = packets() / "OS-0-32-U1_v2.2.0_1024x10.pcap";
  const Scan strongest = read(*open_packets(file), 0), last = read(*open_packets(file, {.last_return = true}), 0);
  const auto sum = [](const Scan& scan) {
    double metres = 0.0;
    for (const Point& p : scan.points) metres += std::hypot(p.x, p.y, p.z);
    return metres;
  };
  EXPECT_GE(last.points.size(), strongest.points.size());
  EXPECT_GT(sum(last), sum(strongest));
}

TEST(Packets, WhatIsNotDecodedIsRefusedWithAdvice) {
  REVISIT_NEEDS_SHARED_DATA();
  for (const auto& [file, advice] : {std::pair{"hesai_40p.db3", "record the driver's PointCloud2 topic"},
                                     {"hesai_xt32.db3", "record the driver's PointCloud2 topic"},
                                     {"empty.pcap", "holds no UDP packet"}}) {
    const auto recording = open_recording(packets() / file);
    ASSERT_FALSE(recording) << file;
    EXPECT_NE(recording.error().message.find(advice), std::string::npos) << recording.error().message;
  }
}

}  // namespace
}  // namespace revisit
