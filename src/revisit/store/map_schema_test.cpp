// SPDX-License-Identifier: Apache-2.0
#include <revisit/store/internal/map_schema.hpp>

#include <fstream>

#include <gtest/gtest.h>
#include <sqlite3.h>

#include <revisit/store/internal/database.hpp>
#include <revisit/store/stored_map.hpp>

#include "shared_data.hpp"

namespace revisit {
namespace {

namespace fs = std::filesystem;
using testing_support::fresh_folder;

void run_sql(const fs::path& file, const std::string& sql) {
  sqlite3* database = nullptr;
  ASSERT_EQ(sqlite3_open(file.c_str(), &database), SQLITE_OK);
  char* reason = nullptr;
  EXPECT_EQ(sqlite3_exec(database, sql.c_str(), nullptr, nullptr, &reason), SQLITE_OK) << (reason ? reason : "");
  sqlite3_close(database);
}

// Seven float64: at (x, 0, 0), not turned.
std::string pose_blob(double x) {
  std::string text = "x'";
  for (const double value : {x, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0})
    for (const std::byte byte : std::as_bytes(std::span(&value, 1))) {
      char hex[3];
      std::snprintf(hex, sizeof hex, "%02x", static_cast<unsigned>(byte));
      text += hex;
    }
  return text + "'";
}

// As version 2 wrote it: one session, its facts in notes, bytes beside the key frames.
fs::path map_of_version_2() {
  const fs::path file = fresh_folder() / "map.sqlite";
  run_sql(file, R"(
    CREATE TABLE notes(name TEXT PRIMARY KEY, text TEXT NOT NULL);
    CREATE TABLE keyframes(frame INTEGER PRIMARY KEY, stamp_s REAL NOT NULL, T_odom_lidar BLOB NOT NULL,
      starts_anew INTEGER NOT NULL, descriptor BLOB NOT NULL, place BLOB NOT NULL, cloud BLOB NOT NULL);
    CREATE TABLE scans(frame INTEGER PRIMARY KEY, keyframe INTEGER NOT NULL, stamp_s REAL NOT NULL,
      T_keyframe_lidar BLOB NOT NULL, T_odom_lidar BLOB NOT NULL, is_tracked INTEGER NOT NULL);
    CREATE TABLE edges(id INTEGER PRIMARY KEY, from_frame INTEGER NOT NULL, to_frame INTEGER NOT NULL,
      T_from_to BLOB NOT NULL, information BLOB NOT NULL, score REAL, inlier_ratio REAL, rmse_m REAL, probability REAL);
    CREATE TABLE answers(query INTEGER PRIMARY KEY, match INTEGER, score REAL NOT NULL, accepted INTEGER NOT NULL,
      reason TEXT NOT NULL);
    INSERT INTO notes VALUES('input', 'drive.bag'), ('parameters', 'a=1'), ('sensor', '1 1 0.8 0.9 40'),
      ('mine', 'kept');
    INSERT INTO keyframes VALUES(4, 0.4, )" +
                    pose_blob(0) + R"(, 0, x'010203', x'04', x'05'),
      (9, 0.9, )" + pose_blob(2) +
                    R"(, 0, x'', x'', x'');
    INSERT INTO scans VALUES(4, 4, 0.4, )" +
                    pose_blob(0) + "," + pose_blob(0) + R"(, 1);
    INSERT INTO edges VALUES(1, 4, 9, )" +
                    pose_blob(2) + R"(, zeroblob(288), NULL, NULL, NULL, NULL);
    PRAGMA application_id=0x52565354; PRAGMA user_version=2;)");
  return file;
}

TEST(MapSchema, AMapOfVersion2IsUpgraded) {
  const fs::path file = map_of_version_2();
  EXPECT_EQ(MapStore::file_of(file.parent_path()), file);
  const auto store = MapStore::open(file, MapStore::Access::kRead);
  ASSERT_TRUE(store) << store.error().message;
  ASSERT_TRUE(store->check()) << store->check().error().message;
  const auto map = read_map(*store);
  ASSERT_TRUE(map) << map.error().message;
  ASSERT_EQ(map->sessions.size(), 1u);
  EXPECT_EQ(map->sessions[0].recording, "drive.bag");
  EXPECT_EQ(map->sessions[0].sensor, "1 1 0.8 0.9 40");
  ASSERT_EQ(map->keyframes.size(), 2u);
  EXPECT_EQ(map->keyframes[1].point.T_segment_lidar.translation().x(), 2.0);
  EXPECT_EQ(*store->part({4}, MapStore::Part::kDescriptor), (Bytes{std::byte{1}, std::byte{2}, std::byte{3}}));
  EXPECT_TRUE(store->part({9}, MapStore::Part::kDescriptor)->empty());
  EXPECT_TRUE(store->state()->empty());
}

TEST(MapSchema, AMapOfVersion3IsUpgraded) {
  const fs::path file = map_of_version_2();
  (void)MapStore::open(file);
  run_sql(file, "DROP TABLE gravity; DROP TABLE state; PRAGMA user_version=3");
  {  // where nothing can be written, too
    const auto reader = MapStore::open(file, MapStore::Access::kRead);
    ASSERT_TRUE(reader) << reader.error().message;
    EXPECT_TRUE(reader->check()) << reader->check().error().message;
    EXPECT_TRUE(reader->ups()->empty());
  }
  auto store = MapStore::open(file);
  ASSERT_TRUE(store) << store.error().message;
  EXPECT_EQ(store->keyframes()->size(), 2u);
  EXPECT_TRUE(store->ups()->empty());
  ASSERT_TRUE(store->add(StoredUp{{9}, {0.0, 0.6, 0.8}}));
  ASSERT_TRUE(store->commit());
  ASSERT_TRUE(store->check()) << store->check().error().message;
  ASSERT_EQ(store->ups()->size(), 1u);
  EXPECT_EQ((*store->ups())[0].keyframe, FrameId{9});
  EXPECT_EQ((*store->ups())[0].up, Eigen::Vector3d(0.0, 0.6, 0.8));
}

TEST(MapSchema, AMapOfVersion4IsUpgraded) {
  const fs::path file = map_of_version_2();
  {
    auto store = MapStore::open(file);
    ASSERT_TRUE(store->add(StoredUp{{9}, {0.0, 0.6, 0.8}}) && store->commit());
  }
  run_sql(file, "DROP TABLE state; PRAGMA user_version=4");
  {  // where nothing can be written, too
    const auto reader = MapStore::open(file, MapStore::Access::kRead);
    ASSERT_TRUE(reader) << reader.error().message;
    EXPECT_TRUE(reader->check()) << reader->check().error().message;
    EXPECT_EQ(reader->ups()->size(), 1u);
    EXPECT_TRUE(reader->state()->empty());
  }
  auto store = MapStore::open(file);
  ASSERT_TRUE(store) << store.error().message;
  EXPECT_EQ(store->ups()->size(), 1u);
  ASSERT_TRUE(store->set_state(Bytes(10, std::byte{1})));
  ASSERT_TRUE(store->commit());
  EXPECT_EQ(store->state()->size(), 10u);
}

TEST(MapSchema, AMapOfVersion5IsUpgraded) {
  const fs::path file = map_of_version_2();
  {
    auto store = MapStore::open(file);
    ASSERT_TRUE(store->set_state(Bytes(10, std::byte{1})) && store->commit());
  }
  run_sql(file, "PRAGMA user_version=5");
  EXPECT_EQ(MapStore::open(file, MapStore::Access::kRead)->state()->size(), 10u);
  const auto store = MapStore::open(file);
  ASSERT_TRUE(store) << store.error().message;
  EXPECT_EQ(store->state()->size(), 10u);
  EXPECT_EQ(store->keyframes()->size(), 2u);
}

TEST(MapSchema, AMapOfALaterVersionIsRefusedAndLeftAsItIs) {
  const fs::path file = map_of_version_2();
  run_sql(file, "PRAGMA user_version=99");
  const auto store = MapStore::open(file);
  ASSERT_FALSE(store);
  EXPECT_NE(store.error().message.find("version 99"), std::string::npos) << store.error().message;
  run_sql(file, "SELECT descriptor FROM keyframes");
}

// Maps of before carry these sums.
TEST(MapSchema, ASumStaysWhatItWas) {
  sqlite3* database = nullptr;
  ASSERT_EQ(sqlite3_open(":memory:", &database), SQLITE_OK);
  ASSERT_TRUE(store_internal::add_checksum_function(database, "a map"));
  const auto sum_of = [&](const char* arguments) {
    store_internal::Statement statement(database, "a map", ("SELECT checksum(" + std::string(arguments) + ")").c_str());
    EXPECT_TRUE(statement.step()) << arguments;
    return statement.integer(0);
  };
  EXPECT_EQ(sum_of("7"), 6828285977912635141);
  EXPECT_EQ(sum_of("0.25"), -2927792052633346100);
  EXPECT_EQ(sum_of("'a text', x'0102', NULL, 7, 0.25"), -1844972708476890687);
  EXPECT_EQ(sum_of("-0.0"), sum_of("0.0")) << "as SQLite gives it back";
  EXPECT_NE(sum_of("7"), sum_of("7.0"));
  EXPECT_NE(sum_of("x''"), sum_of("NULL"));
  EXPECT_NE(sum_of("'ab', 'c'"), sum_of("'a', 'bc'"));
  sqlite3_close(database);
}

// Bytes that somebody else changed in any row are found.
TEST(MapSchema, AlteredRowsAreFound) {
  for (const char* change :
       {"UPDATE sessions SET recording='other.bag'", "UPDATE keyframes SET stamp_s=7.5 WHERE frame=9",
        "UPDATE descriptors SET bytes=x'010204'", "UPDATE places SET bytes=x'06'", "UPDATE clouds SET bytes=x''",
        "UPDATE scans SET is_tracked=0", "UPDATE edges SET information=zeroblob(287)||x'01'",
        "UPDATE edges SET score=1", "UPDATE map_poses SET part=3", "UPDATE gravity SET frame=9",
        "UPDATE state SET bytes=x'02'"}) {
    const fs::path file = map_of_version_2();
    {
      auto store = MapStore::open(file);
      ASSERT_TRUE(store);
      const StoredMapPose pose{{4}, planar_pose(1, 2, 3), 0};
      ASSERT_TRUE(store->set_map_poses(std::span(&pose, 1)));
      ASSERT_TRUE(store->add(StoredUp{{4}}));
      ASSERT_TRUE(store->set_state(Bytes(1, std::byte{1})));
      ASSERT_TRUE(store->commit());
      ASSERT_TRUE(store->check()) << store->check().error().message;
    }
    run_sql(file, change);
    const auto store = MapStore::open(file, MapStore::Access::kRead);
    ASSERT_TRUE(store) << change;
    const Status checked = store->check();
    EXPECT_FALSE(checked) << change;
    if (!checked) {
      EXPECT_NE(checked.error().message.find(file.string()), std::string::npos) << change;
    }
  }
}

TEST(MapSchema, ACutOffMapIsFound) {
  const fs::path file = map_of_version_2();
  (void)MapStore::open(file);
  const auto whole = fs::file_size(file);
  for (const double share : {0.0, 0.01, 0.3, 0.6, 0.95}) {
    const fs::path part = file.parent_path() / "part.revisit";
    fs::copy_file(file, part, fs::copy_options::overwrite_existing);
    fs::resize_file(part, static_cast<std::uintmax_t>(share * static_cast<double>(whole)));
    const auto store = MapStore::open(part, MapStore::Access::kRead);
    EXPECT_FALSE(store && store->check()) << share;
  }
}

// A finished map is one file, and is read where nothing can be written.
TEST(MapSchema, ManyReadWhileOneWrites) {
  const fs::path file = fresh_folder() / "map.revisit";
  {
    auto writer = MapStore::create(file);
    ASSERT_TRUE(writer);
    ASSERT_TRUE(writer->set(StoredSession{0, "a", "b", ""}));
    ASSERT_TRUE(writer->commit());
    const auto one = MapStore::open(file, MapStore::Access::kRead), two = MapStore::open(file, MapStore::Access::kRead);
    ASSERT_TRUE(one && two) << (one ? two : one).error().message;
    ASSERT_TRUE(one->hold());
    ASSERT_TRUE(writer->set(StoredSession{1, "c", "d", ""}));
    EXPECT_EQ(one->sessions()->size(), 1u) << "not committed yet";
    ASSERT_TRUE(writer->commit());
    EXPECT_EQ(one->sessions()->size(), 1u) << "held";
    ASSERT_TRUE(one->release());
    EXPECT_EQ(one->sessions()->size(), 2u);
    EXPECT_EQ(MapStore::open(file, MapStore::Access::kRead)->sessions()->size(), 2u);
    EXPECT_EQ(two->sessions()->size(), 2u);
  }
  {
    auto writer = MapStore::open(file);
    ASSERT_TRUE(writer);
  }
  EXPECT_FALSE(fs::exists(file.string() + "-wal"));
  fs::permissions(file, fs::perms::owner_read);
  EXPECT_TRUE(MapStore::open(file, MapStore::Access::kRead));
}

}  // namespace
}  // namespace revisit
