// SPDX-License-Identifier: Apache-2.0
#include <revisit/io/nmea_file.hpp>

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <string>

#include <gtest/gtest.h>
#include <unistd.h>

namespace revisit {
namespace {

namespace fs = std::filesystem;

std::string sentence(const std::string& payload) {
  unsigned sum = 0;
  for (const char c : payload) sum ^= static_cast<unsigned char>(c);
  char end[8];
  std::snprintf(end, sizeof end, "*%02X\r\n", sum);
  return "$" + payload + end;
}

Result<std::vector<GpsFix>> read(const std::string& text) {
  const fs::path file = fs::temp_directory_path() / ("revisit_nmea_" + std::to_string(::getpid()) + ".txt");
  std::ofstream(file, std::ios::binary) << text;
  auto fixes = read_nmea(file);
  fs::remove(file);
  return fixes;
}

TEST(Nmea, FixesHaveDegreesHeightsTimesAndDeviations) {
  const auto fixes = read(sentence("GPGGA,235959.50,4907.0380,N,01131.0000,E,4,12,0.8,545.4,M,46.9,M,,") +
                          sentence("GNGST,235959.50,1.0,,,,0.012,0.011,0.034") +
                          sentence("GNRMC,235959.50,A,4907.038,N,01131.000,E,0.0,0.0,310724,,,A") +
                          sentence("GPGGA,000000.50,4907.0380,S,01131.0000,W,1,08,2.0,10.0,M,,M,,"));
  ASSERT_TRUE(fixes) << fixes.error().message;
  ASSERT_EQ(fixes->size(), 2u);
  const GpsFix& first = (*fixes)[0];
  EXPECT_NEAR(first.latitude_deg, 49.1173, 1e-6);
  EXPECT_NEAR(first.longitude_deg, 11.516667, 1e-6);
  EXPECT_NEAR(first.altitude_m, 592.3, 1e-6) << "above the ellipsoid";
  EXPECT_NEAR(first.stamp_s, 1722470399.5, 1e-6) << "2024-07-31 23:59:59.5 UTC";
  EXPECT_TRUE(first.deviation_m.isApprox(Eigen::Vector3d(0.011, 0.012, 0.034)));
  const GpsFix& second = (*fixes)[1];
  EXPECT_NEAR(second.stamp_s - first.stamp_s, 1.0, 1e-6) << "after midnight";
  EXPECT_NEAR(second.latitude_deg, -49.1173, 1e-6);
  EXPECT_NEAR(second.longitude_deg, -11.516667, 1e-6);
  EXPECT_NEAR(second.deviation_m.x(), 6.0, 1e-9) << "3 m at a dilution of 1";
}

TEST(Nmea, WhatIsDamagedIsLeftOut) {
  const std::string good = sentence("GPGGA,120000.00,4907.0380,N,01131.0000,E,1,08,1.0,545.4,M,46.9,M,,");
  std::string altered = good;
  altered[12] = '5';
  for (const std::string& bad :
       {altered, std::string("$GPGGA,*7F\n"), std::string("\n\n$"), std::string(100000, ','), good.substr(0, 30),
        sentence("GPGGA,120000.00,4907.0380,N,01131.0000,E,0,00,99.9,,M,,M,,"),
        sentence("GPGGA,990000.00,9907.0380,N,01131.0000,E,1,08,1.0,545.4,M,46.9,M,,")}) {
    const auto none = read(bad);
    EXPECT_FALSE(none) << bad.substr(0, 50);
    if (!none) {
      EXPECT_NE(none.error().message.find("no fix"), std::string::npos);
    }
    const auto one = read(bad + "\n" + good);
    ASSERT_TRUE(one) << bad.substr(0, 50);
    EXPECT_EQ(one->size(), 1u);
  }
  EXPECT_FALSE(read_nmea("/no/such/file"));
}

}  // namespace
}  // namespace revisit
