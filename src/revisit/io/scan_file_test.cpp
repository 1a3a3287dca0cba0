// SPDX-License-Identifier: Apache-2.0
#include <revisit/io/scan_file.hpp>

#include <cmath>
#include <fstream>
#include <limits>
#include <optional>
#include <set>

#include "shared_data.hpp"

namespace revisit {
namespace {

namespace fs = std::filesystem;
using testing_support::fresh_folder;
using testing_support::shared_data;

template <typename T>
void append(std::string& bytes, T value) {
  bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
}

fs::path write_file(const std::string& name, const std::string& bytes) {
  const fs::path file = fresh_folder() / name;
  std::ofstream(file, std::ios::binary) << bytes;
  return file;
}

std::string kitti_bytes(int points) {
  std::string bytes;
  for (int i = 0; i < points; ++i)
    for (const float value : {1.f + 0.01f * static_cast<float>(i), -2.5f, 0.3f, 0.25f}) append(bytes, value);
  return bytes;
}

TEST(ReadBin, KittiPointsAsWritten) {
  const auto scan = read_scan(write_file("a.bin", kitti_bytes(100)));
  ASSERT_TRUE(scan) << scan.error().message;
  ASSERT_EQ(scan->points.size(), 100u);
  EXPECT_FLOAT_EQ(scan->points[99].x, 1.99f);
  EXPECT_FLOAT_EQ(scan->points[99].intensity, 0.25f);
  EXPECT_TRUE(scan->rings.empty());
}

TEST(ReadBin, DropsAndCountsUnusablePoints) {
  std::string bytes = kitti_bytes(10);
  const float nan = std::numeric_limits<float>::quiet_NaN(), inf = std::numeric_limits<float>::infinity();
  for (const float value : {nan, 1.f, 1.f, 0.f, 1.f, inf, 1.f, 0.f, 0.f, 0.f, 0.f, 0.5f}) append(bytes, value);
  const auto scan = read_scan(write_file("a.bin", bytes));
  ASSERT_TRUE(scan) << scan.error().message;
  EXPECT_EQ(scan->points.size(), 10u);
  EXPECT_EQ(scan->dropped_non_finite, 2u);
  EXPECT_EQ(scan->dropped_at_origin, 1u);
}

TEST(ReadBin, CoordinatesThatAreZeroButForRoundingAreNoReasonToDoubt) {
  std::string bytes;
  for (int i = 0; i < 200; ++i)
    for (const float value : {i % 3 == 0 ? 4e-16f : 5.f, 7.f, 0.f, 0.5f}) append(bytes, value);
  EXPECT_TRUE(read_scan(write_file("a.bin", bytes)));
}

TEST(ReadBin, FiveFloatsWithRings) {
  std::string bytes;
  for (int i = 0; i < 64; ++i)
    for (const float value : {3.f + 0.1f * static_cast<float>(i / 32), 4.f, 0.5f + 0.01f * static_cast<float>(i % 32),
                              17.f, static_cast<float>(i % 32)})
      append(bytes, value);
  const auto scan = read_scan(write_file("a.pcd.bin", bytes));
  ASSERT_TRUE(scan) << scan.error().message;
  ASSERT_EQ(scan->rings.size(), 64u);
  EXPECT_EQ(scan->rings[33], 1);
  EXPECT_FLOAT_EQ(scan->points[33].y, 4.f);
}

// A scan as a sensor writes it, ring after ring, with `floats` values a point.
std::string records(int floats) {
  std::string bytes;
  for (int i = 0; i < 4000; ++i) {
    const float angle = 0.0063f * static_cast<float>(i % 1000), range = 10.f + 3.f * std::sin(3.f * angle);
    const float values[8] = {range * std::cos(angle),
                             range * std::sin(angle),
                             -1.f + 0.5f * static_cast<float>(i / 1000),
                             0.3f + 0.1f * std::sin(40.f * angle),
                             0.0001f * static_cast<float>(i) + 0.05f,
                             1.f,
                             std::cos(angle),
                             std::sin(angle)};
    for (int k = 0; k < floats; ++k) append(bytes, values[k]);
  }
  return bytes;
}

TEST(ReadBin, RecordsOfAnotherWidthAreNotReadAsRubbish) {
  EXPECT_TRUE(read_scan(write_file("4.bin", records(4))));
  for (const int floats : {3, 5, 6, 8}) {
    const auto scan = read_scan(write_file("wide.bin", records(floats)));
    ASSERT_FALSE(scan) << floats;
    EXPECT_NE(scan.error().message.find("looks like records of " + std::to_string(floats) + " floats"),
              std::string::npos)
        << scan.error().message;
  }
}

// Beams that follow one another may see the ground and a wall: then every other point lies nearer than the next.
TEST(ReadBin, BeamsThatPointApartAreStillFourFloats) {
  std::string bytes;
  for (int i = 0; i < 4000; ++i) {
    const bool is_low = i % 2 == 0;
    const float angle = 0.00157f * static_cast<float>(i), range = is_low ? 3.f : 12.f;
    for (const float value :
         {range * std::cos(angle), range * std::sin(angle), is_low ? -1.f : 1.f, is_low ? 0.2f : 0.6f})
      append(bytes, value);
  }
  const auto scan = read_scan(write_file("a.bin", bytes));
  ASSERT_TRUE(scan) << scan.error().message;
  EXPECT_EQ(scan->points.size(), 4000u);
}

TEST(ReadBin, PointsAllAlikeAreStillFourFloats) {
  for (const float step : {0.f, 0.01f}) {
    std::string bytes;
    for (int i = 0; i < 1000; ++i)
      for (const float value : {10.f + step * static_cast<float>(i % 3), 0.f, 0.f, 0.f}) append(bytes, value);
    const auto scan = read_scan(write_file("a.bin", bytes));
    ASSERT_TRUE(scan) << scan.error().message;
    EXPECT_EQ(scan->points.size(), 1000u);
    EXPECT_TRUE(scan->rings.empty());
  }
}

TEST(ReadBin, BrokenFilesAreRefusedWithTheirName) {
  for (const auto& [name, bytes] :
       {std::pair<std::string, std::string>{"truncated.bin", kitti_bytes(100).substr(0, 1595)},
        {"truncated8.bin", kitti_bytes(101).substr(0, 1608)},
        {"empty.bin", ""},
        {"text.bin", "this is no scan at all, but a letter"}}) {
    const auto scan = read_scan(write_file(name, bytes));
    ASSERT_FALSE(scan) << name;
    EXPECT_NE(scan.error().message.find(name), std::string::npos) << scan.error().message;
  }
}

TEST(ReadBin, NothingUsableIsAnError) {
  std::string bytes;
  for (int i = 0; i < 40; ++i) append(bytes, std::numeric_limits<float>::quiet_NaN());
  const auto scan = read_scan(write_file("nan.bin", bytes));
  ASSERT_FALSE(scan);
  EXPECT_NE(scan.error().message.find("10 not finite"), std::string::npos) << scan.error().message;
}

TEST(ReadScan, KindsThatAreNotReadSayWhatToDo) {
  EXPECT_NE(read_scan(write_file("a.laz", "x")).error().message.find("laszip"), std::string::npos);
  EXPECT_NE(read_scan(write_file("a.e57", "x")).error().message.find("pdal translate"), std::string::npos);
  EXPECT_NE(read_scan(write_file("a.txt", "x")).error().message.find("allowed: .bin, .pcd, .ply"), std::string::npos);
  for (const char* missing : {"/no/such.bin", "/no/such", "nowhere.txt"})
    EXPECT_EQ(read_scan(missing).error().message, missing + std::string(": no such file or folder"));
}

TEST(ReadScan, SurveyFormatsAreReadOrRefusedByName) {
  REVISIT_NEEDS_SHARED_DATA();
  const auto survey = shared_data() / "recordings" / "survey";
  std::string remark;
  const auto scan = read_scan(survey / "simple.las", [&](LogLevel, const std::string& message) { remark = message; });
  ASSERT_TRUE(scan) << scan.error().message;
  EXPECT_EQ(scan->points.size(), 1065u);
  EXPECT_LT(std::abs(scan->points[0].x), 1.f) << "counted from the first point";
  EXPECT_NE(remark.find("(637012, 849028, 431)"), std::string::npos) << remark;
  for (const auto& [file, advice] :
       {std::pair{"simple.laz", "laszip"}, {"color.copc.laz", "laszip"}, {"A_B.e57", "pdal translate"}})
    EXPECT_NE(read_scan(survey / file).error().message.find(advice), std::string::npos) << file;
}

TEST(ReadScan, LasThatLiesIsRefused) {
  REVISIT_NEEDS_SHARED_DATA();
  std::ifstream stream(shared_data() / "recordings" / "survey" / "simple.las", std::ios::binary);
  const std::string whole{std::istreambuf_iterator<char>(stream), {}};
  EXPECT_TRUE(read_scan(write_file("whole.las", whole)));
  for (const auto& [at, value] :
       {std::pair{std::size_t{104}, '\x83'}, {104, '\x0b'}, {105, '\x01'}, {110, '\x7f'}, {138, '\xbf'}, {0, 'X'}}) {
    std::string broken = whole;
    broken[at] = value;
    const auto scan = read_scan(write_file("broken.las", broken));
    ASSERT_FALSE(scan) << at;
    EXPECT_NE(scan.error().message.find("LAS header"), std::string::npos) << scan.error().message;
  }
  EXPECT_FALSE(read_scan(write_file("cut.las", whole.substr(0, whole.size() / 2))));
}

std::string pcd(const std::string& fields, const std::string& sizes, const std::string& types,
                const std::string& counts, int points, const std::string& encoding) {
  return "# .PCD v0.7\nVERSION 0.7\nFIELDS " + fields + "\nSIZE " + sizes + "\nTYPE " + types + "\nCOUNT " + counts +
         "\nWIDTH " + std::to_string(points) + "\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS " + std::to_string(points) +
         "\nDATA " + encoding + "\n";
}

TEST(ReadPcd, AsciiWithRings) {
  const auto scan =
      read_scan(write_file("a.pcd", pcd("x y z intensity ring", "4 4 4 4 2", "F F F F U", "1 1 1 1 1", 2, "ascii") +
                                        "1 2 3 40 5\n-1 nan 3 40 6\n"));
  ASSERT_TRUE(scan) << scan.error().message;
  ASSERT_EQ(scan->points.size(), 1u);
  EXPECT_EQ(scan->rings, (std::vector<std::uint16_t>{5}));
  EXPECT_FLOAT_EQ(scan->points[0].intensity, 40.f);
  EXPECT_EQ(scan->dropped_non_finite, 1u);
}

TEST(ReadPcd, TimesOfAnyUnitBecomeSecondsOfTheSweep) {
  std::string bytes = pcd("x y z t", "4 4 4 4", "F F F U", "1 1 1 1", 3, "binary");
  for (const std::uint32_t t : {5'000'000u, 55'000'000u, 105'000'000u}) {  // nanoseconds
    for (const float value : {1.f, 2.f, 3.f}) append(bytes, value);
    append(bytes, t);
  }
  const auto scan = read_scan(write_file("a.pcd", bytes));
  ASSERT_TRUE(scan) << scan.error().message;
  ASSERT_EQ(scan->times_s.size(), 3u);
  EXPECT_NEAR(scan->times_s[2], 0.1, 1e-6);
}

TEST(ReadPcd, LyingHeadersAreRefused) {
  const std::string body(64, '\1');
  for (const std::string& header :
       {pcd("x y z", "4 4 4", "F F F", "1 1 1", 1000, "binary"),  // more points than data
        pcd("x y z", "4 4 4", "F F F", "1 1 1", 1000, "binary_compressed"),
        pcd("x y z", "4 4 4", "F F F", "1 1 1", 2, "zipped"), pcd("x y z", "4 4", "F F F", "1 1 1", 2, "binary"),
        pcd("x y z", "4 4 3", "F F F", "1 1 1", 2, "binary"),
        pcd("x y z", "4 4 4", "F F F", "1 1 999999999", 2, "binary"),
        pcd("x y", "4 4", "F F", "1 1", 2, "binary"),         // no z
        pcd("x y z", "4 4 4", "F F F", "1 1 1", 2, "ascii"),  // no text
        std::string("VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 99999999999999999999\n"
                    "HEIGHT 1\nPOINTS 1\nDATA binary\n"),
        std::string("FIELDS x y z\n"), std::string("DATA binary\n")}) {
    const auto scan = read_scan(write_file("a.pcd", header + body));
    EXPECT_FALSE(scan) << header;
  }
}

TEST(ReadPcd, AsciiRowsThatAreNoPointsAreNamed) {
  const std::string header = pcd("x y z intensity", "4 4 4 4", "F F F F", "1 1 1 1", 3, "ascii");
  for (const char* rows : {"1 2 3 4\nabc 2 3 4\n5 6 7 8\n", "1 2 3 4\n1 2\n5 6 7 8\n", "1 2 3 4\n1 2 3 4 5\n5 6 7 8\n",
                           "1 2 3 4\n5 5 5 hello\n5 6 7 8\n"}) {
    const auto scan = read_scan(write_file("a.pcd", header + rows));
    ASSERT_FALSE(scan) << rows;
    EXPECT_NE(scan.error().message.find("point 2: "), std::string::npos) << scan.error().message;
  }
  // 2000 points of 100,000 values each do not fit in a few bytes.
  EXPECT_FALSE(
      read_scan(write_file("b.pcd", pcd("x y z w", "4 4 4 8", "F F F F", "1 1 1 100000", 2000, "ascii") + "1 2 3\n")));
}

TEST(ReadPly, AsciiAndLies) {
  const std::string header =
      "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\n"
      "property float z\nproperty float intensity\nend_header\n";
  const auto scan = read_scan(write_file("a.ply", header + "1 2 3 4\n5 6 7 8\n"));
  ASSERT_TRUE(scan) << scan.error().message;
  ASSERT_EQ(scan->points.size(), 2u);
  EXPECT_FLOAT_EQ(scan->points[1].z, 7.f);
  EXPECT_FALSE(read_scan(write_file("b.ply",
                                    "ply\nformat binary_little_endian 1.0\nelement vertex 1000000\nproperty float x\n"
                                    "property float y\nproperty float z\nend_header\nshort")));
  EXPECT_FALSE(read_scan(write_file("c.ply", "no ply at all")));
}

// What the data's README says of each file: points usable and rings named, or refused.
struct Expectation {
  const char* file;
  std::optional<std::size_t> points;  // nothing: refused
  std::size_t rings;                  // distinct ring numbers named by the file
  bool times;
  float max_intensity;
};

void PrintTo(const Expectation& expectation, std::ostream* out) { *out << expectation.file; }

class RealFormats : public testing::TestWithParam<Expectation> {};

TEST_P(RealFormats, ReadRightOrRefusedWithAReason) {
  REVISIT_NEEDS_SHARED_DATA();
  const Expectation& expected = GetParam();
  const auto scan = read_scan(shared_data() / "formats" / expected.file);
  if (!expected.points) {
    ASSERT_FALSE(scan);
    EXPECT_NE(scan.error().message.find(expected.file), std::string::npos) << scan.error().message;
    EXPECT_EQ(scan.error().message.find('\n'), std::string::npos) << "one line";
    return;
  }
  ASSERT_TRUE(scan) << scan.error().message;
  EXPECT_EQ(scan->points.size(), *expected.points);
  EXPECT_EQ(std::set<std::uint16_t>(scan->rings.begin(), scan->rings.end()).size(), expected.rings);
  EXPECT_EQ(!scan->times_s.empty(), expected.times);
  float max_intensity = 0.f;
  for (const Point& p : scan->points) {
    max_intensity = std::max(max_intensity, p.intensity);
    ASSERT_LT(std::hypot(p.x, p.y, p.z), 300.f) << "no LiDAR here sees that far: rubbish was read";
  }
  EXPECT_NEAR(max_intensity, expected.max_intensity, 1e-3f * expected.max_intensity);
}

INSTANTIATE_TEST_SUITE_P(Formats, RealFormats,
                         testing::Values(Expectation{"handheld_os0.pcd", 73452, 0, false, 811.f},
                                         Expectation{"hdl32_padded_a.pcd", 64545, 32, false, 118.f},
                                         Expectation{"hdl32_padded_b.pcd", 64032, 32, false, 115.f},
                                         Expectation{"hdl32_pair.ply", 64685, 0, false, 128.f},
                                         Expectation{"hdl32_pair_a.pcd", 64056, 0, false, 114.f},
                                         Expectation{"hdl32_pair_b.pcd", 64685, 0, false, 128.f},
                                         Expectation{"hesai_binary_compressed.pcd", 80787, 61, true, 254.f},
                                         Expectation{"livox.pcd", 41657, 0, false, 255.f},
                                         Expectation{"livox_malformed_ascii.pcd", std::nullopt, 0, false, 0.f},
                                         Expectation{"nclt_velodyne_sync.bin", 23546, 32, false, 255.f},
                                         Expectation{"nuscenes_five_floats.pcd.bin", 34688, 32, false, 255.f},
                                         Expectation{"ouster_intensity_7000.pcd", 62082, 0, false, 7156.f},
                                         Expectation{"padded_ring_timestamp_f8.pcd", 68242, 40, true, 255.f},
                                         Expectation{"pandaset_organized_nan_compressed.pcd", 77295, 0, false, 255.f},
                                         Expectation{"rellis_os1.bin", 77708, 0, false, 0.0115053f},
                                         Expectation{"rellis_vlp32.bin", 37334, 0, false, 235.f},
                                         Expectation{"ring_time_in_intensity.pcd", 37101, 0, false, 20.1003f},
                                         Expectation{"vlp16_nan_unorganised_ring_time.pcd", 25207, 0, false, 15.1887f},
                                         Expectation{"width_height_zero.pcd", std::nullopt, 0, false, 0.f},
                                         Expectation{"vlp16_50_frames.pcap", std::nullopt, 0, false, 0.f},
                                         Expectation{"hdl32.pcap", std::nullopt, 0, false, 0.f},
                                         Expectation{"ouster_packets_ros1.bag", std::nullopt, 0, false, 0.f}),
                         [](const auto& each) {
                           std::string name = each.param.file;
                           std::replace_if(
                               name.begin(), name.end(),
                               [](char c) { return !std::isalnum(static_cast<unsigned char>(c)); }, '_');
                           return name;
                         });

// Cut and altered copies of small synthetic files: every prefix must be refused or read, never crash.
TEST(ReadScan, SurvivesEveryTruncation) {
  std::string binary = pcd("x y z intensity", "4 4 4 4", "F F F F", "1 1 1 1", 20, "binary") + kitti_bytes(20);
  const std::string ply =
      "ply\nformat binary_little_endian 1.0\nelement vertex 20\nproperty float x\nproperty float y\n"
      "property float z\nproperty float intensity\nend_header\n" +
      kitti_bytes(20);
  const fs::path folder = fresh_folder();
  for (const auto& [name, whole] : {std::pair<std::string, std::string>{"a.pcd", binary}, {"a.ply", ply}}) {
    for (std::size_t size = 0; size < whole.size(); size += 3) {
      std::ofstream(folder / name, std::ios::binary | std::ios::trunc) << whole.substr(0, size);
      EXPECT_FALSE(read_scan(folder / name)) << name << " cut to " << size;
    }
    std::ofstream(folder / name, std::ios::binary | std::ios::trunc) << whole;
    EXPECT_TRUE(read_scan(folder / name)) << name;
  }
}

}  // namespace
}  // namespace revisit
