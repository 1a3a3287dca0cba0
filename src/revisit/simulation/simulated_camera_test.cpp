// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "simulated_drive.hpp"

namespace revisit {
namespace {

using testing_support::make;
using testing_support::small_drive;

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
  SimulationOptions options = small_drive("town", "hdl64e");
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
  const auto one = make(small_drive("town"), 1), all = make(small_drive("town"));
  const Image day = all->image(30), night = all->image(30, ImageLight::kNight);
  EXPECT_EQ(day.grey, one->image(30).grey);
  EXPECT_NE(day.grey, all->image(29).grey);
  const auto dark = [](const Image& image) {
    return std::count_if(image.grey.begin(), image.grey.end(), [](std::uint8_t grey) { return grey < 25; });
  };
  EXPECT_GT(dark(night), 3 * dark(day));
}

}  // namespace
}  // namespace revisit
