// SPDX-License-Identifier: Apache-2.0
#include <revisit/vision/density_map.hpp>
#include <revisit/vision/visual_words.hpp>

#include <algorithm>

#include <gtest/gtest.h>

#include <revisit/core/pose.hpp>

#include "made_place.hpp"

namespace revisit {
namespace {

// Grey rectangles, other ones for another seed; seen `right` pixels farther to the right.
Image made_image(unsigned seed, int right = 0) {
  Image image{320, 200, std::vector<std::uint8_t>(320 * 200, 90)};
  std::mt19937 random(seed);
  for (int i = 0; i < 150; ++i) {
    const int column = static_cast<int>(random() % 340) - right, row = static_cast<int>(random() % 200);
    const int width = 5 + static_cast<int>(random() % 40), height = 5 + static_cast<int>(random() % 40);
    const auto grey = static_cast<std::uint8_t>(random() % 256);
    for (int r = row; r < std::min(200, row + height); ++r)
      for (int c = std::max(0, column); c < std::min(320, column + width); ++c)
        image.grey[static_cast<std::size_t>(r) * 320 + static_cast<std::size_t>(c)] = grey;
  }
  return image;
}

std::shared_ptr<const Vocabulary> vocabulary() {
  static const auto made = [] {
    std::vector<Image> images;
    for (unsigned seed = 100; seed < 120; ++seed) images.push_back(made_image(seed));
    return make_vocabulary(images);
  }();
  return made;
}

TEST(ImageFeatures, MoveWithTheImage) {
  const auto here = find_features(made_image(1), {}), moved = find_features(made_image(1, 8), {});
  ASSERT_GT(here.size(), 300u);
  std::size_t found = 0;
  for (const BinaryFeature& a : here)
    found += std::any_of(moved.begin(), moved.end(), [&](const BinaryFeature& b) {
      return std::abs(a.column - 8.f - b.column) < 1.f && std::abs(a.row - b.row) < 1.f && hamming(a.bits, b.bits) < 30;
    });
  EXPECT_GT(found, here.size() / 2);
  EXPECT_TRUE(find_features({}, {}).empty());
}

TEST(Vocabulary, AnImageIsMostLikeItself) {
  const auto words_of = [](const Image& image) { return vocabulary()->words_of(find_features(image, {})); };
  EXPECT_GT(vocabulary()->words(), 1000u);
  const WordWeights here = words_of(made_image(1));
  EXPECT_NEAR(similarity(here, here), 1.0, 1e-5);
  const double beside = similarity(here, words_of(made_image(1, 8))),
               elsewhere = similarity(here, words_of(made_image(2)));
  EXPECT_GT(beside, 2.0 * elsewhere);
  EXPECT_TRUE(words_of({}).empty());
}

TEST(VisualWords, FindTheImageAgainWhenItIsOldEnough) {
  VisualWords places(vocabulary(), ExclusionRule{5, 0.0});
  for (int i = 0; i < 12; ++i) {
    const auto row = places.process({FrameId{i}, 0.1 * i}, made_image(static_cast<unsigned>(i)));
    EXPECT_EQ(row.has_value(), i >= 5);
  }
  const auto row = places.process({FrameId{12}, 1.2}, made_image(4, 8));
  ASSERT_TRUE(row && row->match);
  EXPECT_EQ(row->match->value, 4);
  EXPECT_GT(row->score, 0.5);
  EXPECT_FALSE(row->accepted);
}

TEST(DensityMap, FindsThePlaceAndWhereItIsSeenFrom) {
  using testing_support::made_place;
  const auto method = make_density_map();
  const auto query = method->describe(
      testing_support::turned(testing_support::moved(made_place(1), 5.f, -2.f), to_radians(66.0)), -1.7);
  const auto place = method->describe(made_place(1), -1.7), other = method->describe(made_place(2), -1.7);
  EXPECT_GT(method->similarity(query, place), 2.0 * method->similarity(query, other));
  const Pose T = method->T_place_query(query, place);
  EXPECT_NEAR(to_degrees(yaw_of(T)), -66.0, 1.0);
  EXPECT_NEAR(T.translation().x(), 5.0, 0.5);
  EXPECT_NEAR(T.translation().y(), -2.0, 0.5);
  EXPECT_DOUBLE_EQ(method->similarity(method->describe({}, -1.7), place), 0.0);
}

}  // namespace
}  // namespace revisit
