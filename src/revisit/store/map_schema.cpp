// SPDX-License-Identifier: Apache-2.0
#include <revisit/store/internal/map_schema.hpp>

#include <array>
#include <cstdint>
#include <filesystem>
#include <fstream>

#define XXH_INLINE_ALL  // whoever links this library needs no other
#include <xxhash.h>

#include <revisit/store/internal/database.hpp>

namespace revisit::store_internal {
namespace {

constexpr const char* kSchema = R"(
CREATE TABLE notes(name TEXT PRIMARY KEY, text TEXT NOT NULL);
CREATE TABLE sessions(id INTEGER PRIMARY KEY, recording TEXT NOT NULL, parameters TEXT NOT NULL, sensor TEXT NOT NULL,
  sum INTEGER NOT NULL);
CREATE TABLE keyframes(frame INTEGER PRIMARY KEY, stamp_s REAL NOT NULL, T_odom_lidar BLOB NOT NULL,
  starts_anew INTEGER NOT NULL, sum INTEGER NOT NULL);
CREATE TABLE descriptors(frame INTEGER PRIMARY KEY, bytes BLOB NOT NULL, sum INTEGER NOT NULL);
CREATE TABLE places(frame INTEGER PRIMARY KEY, bytes BLOB NOT NULL, sum INTEGER NOT NULL);
CREATE TABLE clouds(frame INTEGER PRIMARY KEY, bytes BLOB NOT NULL, sum INTEGER NOT NULL);
CREATE TABLE visits(frame INTEGER PRIMARY KEY, bytes BLOB NOT NULL, sum INTEGER NOT NULL);
CREATE TABLE changes(frame INTEGER PRIMARY KEY, bytes BLOB NOT NULL, sum INTEGER NOT NULL);
CREATE TABLE map_poses(frame INTEGER PRIMARY KEY, T_map_lidar BLOB NOT NULL, part INTEGER NOT NULL,
  sum INTEGER NOT NULL);
CREATE TABLE scans(frame INTEGER PRIMARY KEY, keyframe INTEGER NOT NULL, stamp_s REAL NOT NULL,
  T_keyframe_lidar BLOB NOT NULL, T_odom_lidar BLOB NOT NULL, is_tracked INTEGER NOT NULL, sum INTEGER NOT NULL);
CREATE TABLE edges(id INTEGER PRIMARY KEY, from_frame INTEGER NOT NULL, to_frame INTEGER NOT NULL,
  T_from_to BLOB NOT NULL, information BLOB NOT NULL, score REAL, inlier_ratio REAL, rmse_m REAL, probability REAL,
  sum INTEGER NOT NULL);
CREATE TABLE place_index(offset INTEGER PRIMARY KEY, bytes BLOB NOT NULL);
CREATE TABLE place_poses(id INTEGER PRIMARY KEY, bytes BLOB NOT NULL, sum INTEGER NOT NULL);
CREATE TABLE fixes(frame INTEGER PRIMARY KEY, latitude_deg REAL NOT NULL, longitude_deg REAL NOT NULL,
  altitude_m REAL NOT NULL, deviation_m BLOB NOT NULL, sum INTEGER NOT NULL);
CREATE TABLE earth(part INTEGER PRIMARY KEY, latitude_deg REAL NOT NULL, longitude_deg REAL NOT NULL,
  altitude_m REAL NOT NULL, T_earth_map BLOB NOT NULL, sum INTEGER NOT NULL);
CREATE TABLE answers(query INTEGER PRIMARY KEY, match INTEGER, score REAL NOT NULL, accepted INTEGER NOT NULL,
  reason TEXT NOT NULL);
)";
constexpr const char* kSinceVersion4 = R"(
CREATE TABLE gravity(frame INTEGER PRIMARY KEY, up BLOB NOT NULL, sum INTEGER NOT NULL);
)";
constexpr const char* kSinceVersion5 = R"(
CREATE TABLE state(id INTEGER PRIMARY KEY, bytes BLOB NOT NULL, sum INTEGER NOT NULL);
)";

// One session, whose facts were notes; the bytes of a key frame in its row.
constexpr const char* kFrom2To3 = R"(
INSERT INTO sessions SELECT 0, recording, parameters, sensor, checksum(0, recording, parameters, sensor) FROM (SELECT
  coalesce((SELECT text FROM old_notes WHERE name='input'), '') AS recording,
  coalesce((SELECT text FROM old_notes WHERE name='parameters'), '') AS parameters,
  coalesce((SELECT text FROM old_notes WHERE name='sensor'), '') AS sensor)
  WHERE EXISTS(SELECT 1 FROM old_notes) OR EXISTS(SELECT 1 FROM old_keyframes);
INSERT INTO notes SELECT * FROM old_notes WHERE name NOT IN ('input', 'parameters', 'sensor');
INSERT INTO keyframes SELECT frame, stamp_s, T_odom_lidar, starts_anew,
  checksum(frame, stamp_s, T_odom_lidar, starts_anew) FROM old_keyframes;
INSERT INTO descriptors SELECT frame, descriptor, checksum(frame, descriptor) FROM old_keyframes
  WHERE length(descriptor) > 0;
INSERT INTO places SELECT frame, place, checksum(frame, place) FROM old_keyframes WHERE length(place) > 0;
INSERT INTO clouds SELECT frame, cloud, checksum(frame, cloud) FROM old_keyframes WHERE length(cloud) > 0;
INSERT INTO scans SELECT *, checksum(frame, keyframe, stamp_s, T_keyframe_lidar, T_odom_lidar, is_tracked)
  FROM old_scans;
INSERT INTO edges SELECT *, checksum(from_frame, to_frame, T_from_to, information, score, inlier_ratio, rmse_m,
  probability) FROM old_edges;
INSERT INTO answers SELECT * FROM old_answers;
)";
constexpr std::array kTablesOf2 = {"notes", "keyframes", "scans", "edges", "answers"};

void checksum(sqlite3_context* context, int count, sqlite3_value** values) {
  XXH3_state_t state;
  XXH3_64bits_reset(&state);
  for (sqlite3_value* value : std::span(values, static_cast<std::size_t>(count))) {
    const int type = sqlite3_value_type(value);
    XXH3_64bits_update(&state, &type, sizeof type);
    if (type == SQLITE_INTEGER) {
      const sqlite3_int64 number = sqlite3_value_int64(value);
      XXH3_64bits_update(&state, &number, sizeof number);
    } else if (type == SQLITE_FLOAT) {
      const double number = sqlite3_value_double(value) + 0.0;  // SQLite keeps no -0.0
      XXH3_64bits_update(&state, &number, sizeof number);
    } else if (type != SQLITE_NULL) {
      const void* const bytes = sqlite3_value_blob(value);
      const int size = sqlite3_value_bytes(value);
      XXH3_64bits_update(&state, &size, sizeof size);
      if (size > 0) XXH3_64bits_update(&state, bytes, static_cast<std::size_t>(size));
    }
  }
  sqlite3_result_int64(context, static_cast<sqlite3_int64>(XXH3_64bits_digest(&state)));
}

Status run_all(sqlite3* database, const std::string& file, const std::string& sql) {
  if (sqlite3_exec(database, sql.c_str(), nullptr, nullptr, nullptr) == SQLITE_OK) return ok();
  return Error{file + ": " + sqlite3_errmsg(database)};
}

std::string numbers_of_the_file() {
  return "PRAGMA application_id=" + std::to_string(kApplication) + ";PRAGMA user_version=" + std::to_string(kVersion) +
         ";";
}

}  // namespace

// Big-endian, at these offsets of the header: https://www.sqlite.org/fileformat.html, section 1.3.
Status check_length(const std::string& file) {
  std::error_code failure;
  const auto length = std::filesystem::file_size(file, failure);
  std::array<unsigned char, 100> header{};
  std::ifstream stream(file, std::ios::binary);
  if (failure || std::filesystem::exists(file + "-wal", failure) ||
      !stream.read(reinterpret_cast<char*>(header.data()), header.size()))
    return ok();  // whoever opens it says what is wrong
  const auto number = [&](std::size_t at, std::size_t bytes) {
    std::uint64_t value = 0;
    for (std::size_t i = 0; i < bytes; ++i) value = value << 8 | header[at + i];
    return value;
  };
  const std::uint64_t page = number(16, 2) == 1 ? 65536 : number(16, 2), pages = number(28, 4);
  const bool is_known = number(24, 4) == number(92, 4);
  if (!is_known || length >= page * pages) return ok();
  return Error{file + ": " + std::to_string(length) + " bytes of " + std::to_string(page * pages) +
               ": the map was cut off; restore it from a copy"};
}

Status add_checksum_function(sqlite3* database, const std::string& file) {
  if (sqlite3_create_function(database, "checksum", -1, SQLITE_UTF8 | SQLITE_DETERMINISTIC, nullptr, checksum, nullptr,
                              nullptr) == SQLITE_OK)
    return ok();
  return Error{file + ": " + sqlite3_errmsg(database)};
}

Status create_schema(sqlite3* database, const std::string& file) {
  return run_all(database, file,
                 "BEGIN;" + std::string(kSchema) + kSinceVersion4 + kSinceVersion5 + numbers_of_the_file() + "COMMIT;");
}

Result<int> version_of(sqlite3* database, const std::string& file) {
  std::array<int, 2> numbers{};
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    Statement statement(database, file, i == 0 ? "PRAGMA application_id" : "PRAGMA user_version");
    if (!statement.step()) return statement.status() ? Error{file + ": is no map"} : statement.status().error();
    numbers[i] = static_cast<int>(statement.integer(0));
  }
  const auto [application, version] = numbers;
  if (application != kApplication) return Error{file + ": is an SQLite file, but no map of revisit"};
  constexpr int kOldest = 2;
  if (version < kOldest || version > kVersion)
    return Error{file + ": is a map of version " + std::to_string(version) + "; this program reads versions " +
                 std::to_string(kOldest) + " to " + std::to_string(kVersion) +
                 (version > kVersion ? ": a newer program is needed" : "")};
  return version;
}

Status upgrade(sqlite3* database, const std::string& file, int version) {
  if (version == kVersion) return ok();
  std::string sql = "BEGIN IMMEDIATE;";
  if (version == 2) {
    for (const char* table : kTablesOf2)
      sql += "ALTER TABLE " + std::string(table) + " RENAME TO old_" + std::string(table) + ";";
    sql += std::string(kSchema) + kFrom2To3;
    for (const char* table : kTablesOf2) sql += "DROP TABLE old_" + std::string(table) + ";";
  }
  if (version < 4) sql += kSinceVersion4;
  if (version < 5) sql += kSinceVersion5;
  sql += numbers_of_the_file() + "COMMIT;";  // since version 6 places may hold what was seen before
  Status status = run_all(database, file, sql);
  if (!status && sqlite3_get_autocommit(database) == 0) (void)run_all(database, file, "ROLLBACK");
  return status;
}

}  // namespace revisit::store_internal
