// SPDX-License-Identifier: Apache-2.0
#include <revisit/pipeline/recording_scale.hpp>

#include <fstream>

#include "shared_data.hpp"
#include "synthetic_world.hpp"

namespace revisit {
namespace {

using testing_support::SyntheticWorld;

TEST(IntensityScaleOf, BrokenScansDoNotHideTheGoodOnes) {
  const auto folder = testing_support::fresh_folder();
  const Scan scan = SyntheticWorld(5).scan(SyntheticWorld::at(0, 0, 0), {16, 180, -15.0, 15.0});
  for (int i = 0; i < 20; ++i) {
    std::ofstream file(folder / (std::to_string(100 + i) + ".bin"), std::ios::binary);
    file.write(reinterpret_cast<const char*>(scan.points.data()),
               static_cast<std::streamsize>(i % 2 == 0 ? 1001 : scan.points.size() * sizeof(Point)));
  }
  const auto recording = open_recording(folder);
  ASSERT_TRUE(recording);
  const auto scale = intensity_scale_of(**recording, {});
  ASSERT_TRUE(scale) << scale.error().message;
  EXPECT_GT(scale->max_raw, 0.0);
}

}  // namespace
}  // namespace revisit
