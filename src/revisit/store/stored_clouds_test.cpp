// SPDX-License-Identifier: Apache-2.0
#include <revisit/store/stored_clouds.hpp>

#include <gtest/gtest.h>

#include <revisit/store/keyframe_bytes.hpp>
#include <revisit/store/sensor_facts.hpp>

#include "synthetic_world.hpp"

namespace revisit {
namespace {

using testing_support::SyntheticWorld;

struct Stored {
  explicit Stored(const std::string& name) {
    file = std::filesystem::path(testing::TempDir()) / ("revisit_clouds_" + name + ".map");
    for (const char* ending : {"", "-wal", "-shm"}) std::filesystem::remove(file.string() + ending);
    store = std::make_shared<MapStore>(*MapStore::create(file));
    for (int i = 0; i < 5; ++i) {
      const Scan scan = SyntheticWorld(51).scan(SyntheticWorld::at(i, 0, 0), {16, 90, -15.0, 15.0});
      clouds.push_back(thin(scan.points, {}, 1.0));
      StoredKeyframe keyframe;
      keyframe.frame = FrameId{i};
      keyframe.place = to_bytes(clouds.back());
      EXPECT_TRUE(store->add(keyframe));
    }
    EXPECT_TRUE(store->commit());
  }
  std::filesystem::path file;
  std::shared_ptr<MapStore> store;
  std::vector<ThinCloud> clouds;
};

TEST(StoredClouds, GivesEachPlaceItsOwnCloudHoweverFewStayInMemory) {
  const Stored stored("few");
  const auto clouds = clouds_in_store(stored.store, 2);
  for (const int i : {0, 1, 2, 3, 4, 0, 4, 2, 2, 1}) {
    const auto cloud = clouds->get({i});
    ASSERT_TRUE(cloud) << cloud.error().message;
    EXPECT_EQ((*cloud)->points, stored.clouds[static_cast<std::size_t>(i)].points) << "place " << i;
  }
}

void gives_back(PlaceClouds& clouds, const std::vector<ThinCloud>& put) {
  for (std::size_t i = 0; i < put.size(); ++i) ASSERT_TRUE(clouds.put({static_cast<std::int64_t>(i)}, put[i]));
  for (const std::size_t i : {0u, 1u, 2u, 3u, 4u, 0u, 4u, 2u, 2u, 1u}) {
    const auto cloud = clouds.get({static_cast<std::int64_t>(i)});
    ASSERT_TRUE(cloud) << cloud.error().message;
    EXPECT_EQ((*cloud)->points, put[i].points) << "place " << i;
    EXPECT_EQ(to_bytes(**cloud), to_bytes(put[i])) << "place " << i;
  }
  EXPECT_FALSE(clouds.get({77}));
}

TEST(StoredClouds, InAFileThatNobodySees) {
  const Stored stored("file");
  gives_back(*clouds_in_file(1), stored.clouds);
}

TEST(StoredClouds, InAFileWithWhatWasSeenBefore) {
  const Stored stored("before");
  std::vector<ThinCloud> with = stored.clouds;
  for (std::size_t i = 0; i < with.size(); i += 2) with[i].before = std::make_shared<const ThinCloud>(stored.clouds[1]);
  const auto clouds = clouds_in_file(1);
  gives_back(*clouds, with);
  for (std::size_t i = 0; i < with.size(); ++i) {
    const auto cloud = *clouds->get({static_cast<std::int64_t>(i)});
    ASSERT_EQ(cloud->before != nullptr, with[i].before != nullptr) << "place " << i;
    if (cloud->before) {
      EXPECT_EQ(to_bytes(*cloud->before), to_bytes(stored.clouds[1])) << "place " << i;
    }
  }
}

TEST(StoredClouds, WithoutAFileTheyStayInMemory) {
  const Stored stored("no_file");
  setenv("TMPDIR", "/nowhere", 1);
  const auto clouds = clouds_in_file(1);
  unsetenv("TMPDIR");
  gives_back(*clouds, stored.clouds);
}

TEST(StoredClouds, ACloudGivenOutOutlivesItsPlaceInMemory) {
  const Stored stored("outlives");
  const auto clouds = clouds_in_store(stored.store, 1);
  const auto first = clouds->get({0});
  ASSERT_TRUE(clouds->get({1}) && clouds->get({2}));
  EXPECT_EQ((*first)->points, stored.clouds[0].points);
}

TEST(StoredClouds, AnUnknownPlaceShowsNothingAndADamagedOneIsAnError) {
  Stored stored("damaged");
  const auto clouds = clouds_in_store(stored.store, 2);
  const auto unknown = clouds->get({77});
  ASSERT_TRUE(unknown);
  EXPECT_TRUE((*unknown)->points.empty());
  StoredKeyframe broken;
  broken.frame = FrameId{9};
  broken.place = Bytes(13);
  ASSERT_TRUE(stored.store->add(broken));
  const auto damaged = clouds->get({9});
  ASSERT_FALSE(damaged);
  EXPECT_NE(damaged.error().message.find("the place of key frame 9 is damaged"), std::string::npos);
}

TEST(SensorFacts, ComeBackAndDamagedOnesAreRefused) {
  EXPECT_FALSE(to_sensor_facts("")->has_value()) << "none yet";
  SensorFacts facts;
  facts.intensity_scale.full_scale = 0.1;
  facts.intensity_scale.is_reflectance = false;
  facts.typical = {0.83, 0.61, 0.12};
  facts.typical_pairs = 40;
  facts.look_alikes_log_odds = -1.5;
  const auto back = to_sensor_facts(to_text(facts));
  ASSERT_TRUE(back && *back);
  EXPECT_EQ((*back)->intensity_scale.full_scale, 0.1);
  EXPECT_FALSE((*back)->intensity_scale.is_reflectance);
  EXPECT_EQ((*back)->typical.intensity_correlation, 0.61);
  EXPECT_EQ((*back)->typical.residual, 0.12);
  EXPECT_EQ((*back)->typical_pairs, 40u);
  EXPECT_EQ((*back)->look_alikes_log_odds, -1.5);
  EXPECT_EQ((*to_sensor_facts("1 1 0.8 0.9 10"))->look_alikes_log_odds, 0.0) << "of an earlier version";
  EXPECT_EQ((*to_sensor_facts("1 1 0.8 0.9 10 2.5"))->typical.residual, TypicalAgreement{}.residual)
      << "of another one";
  for (const char* damaged : {"x", "0 1 0.8 0.9 10", "1 1 1.8 0.9 10", "nan 1 0.8 0.9 10", "1 1 0.8 0.9 10 0 0",
                              "1 1 0.8 0.9 10 0 -1", "1 1 0.8 0.9 10 0 x"})
    EXPECT_FALSE(to_sensor_facts(damaged)) << damaged;
}

}  // namespace
}  // namespace revisit
