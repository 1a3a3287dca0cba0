// SPDX-License-Identifier: Apache-2.0
// What is read of a map, each row checked.
#include <array>

#include <revisit/core/text.hpp>
#include <revisit/store/internal/map_database.hpp>
#include <revisit/store/internal/row_bytes.hpp>

namespace revisit {

using store_internal::Statement;
using store_internal::to_matrix;
using store_internal::to_pose;

Result<Bytes> MapStore::state() const {
  if (database_->version < 5) return Bytes();  // none of them had any
  Statement statement = database_->prepare("SELECT bytes,sum=checksum(bytes) FROM state");
  Bytes state;
  if (statement.step()) {
    if (statement.integer(1) == 0)
      return Error{database_->file + ": the state of its run is damaged: restore the file from a copy"};
    const auto bytes = statement.bytes(0);
    state.assign(bytes.begin(), bytes.end());
  }
  if (const Status status = statement.status(); !status) return status.error();
  return state;
}

Result<std::vector<StoredSession>> MapStore::sessions() const {
  std::vector<StoredSession> rows;
  Statement statement = database_->prepare(
      "SELECT id,recording,parameters,sensor,sum=checksum(id,recording,parameters,sensor) FROM sessions ORDER BY id");
  while (statement.step()) {
    if (statement.integer(4) == 0) return database_->damaged("sessions", statement.integer(0));
    rows.push_back({static_cast<int>(statement.integer(0)), statement.text(1), statement.text(2), statement.text(3)});
  }
  if (const Status status = statement.status(); !status) return status.error();
  return rows;
}

Result<std::vector<StoredMapPose>> MapStore::map_poses() const {
  std::vector<StoredMapPose> rows;
  Statement statement = database_->prepare(
      "SELECT frame,T_map_lidar,part,sum=checksum(frame,T_map_lidar,part) FROM map_poses ORDER BY frame");
  while (statement.step()) {
    const auto pose = to_pose(statement.bytes(1));
    if (!pose || statement.integer(3) == 0) return database_->damaged("map poses", statement.integer(0));
    rows.push_back({{statement.integer(0)}, *pose, static_cast<int>(statement.integer(2))});
  }
  if (const Status status = statement.status(); !status) return status.error();
  return rows;
}

Result<std::vector<StoredKeyframe>> MapStore::keyframes() const {
  std::vector<StoredKeyframe> rows;
  Statement statement = database_->prepare(
      "SELECT frame,stamp_s,T_odom_lidar,starts_anew,sum=checksum(frame,stamp_s,T_odom_lidar,starts_anew) FROM "
      "keyframes ORDER BY frame");
  while (statement.step()) {
    const auto pose = to_pose(statement.bytes(2));
    if (!pose || statement.integer(4) == 0) return database_->damaged("key frames", statement.integer(0));
    rows.push_back({{statement.integer(0)}, statement.real(1), *pose, statement.integer(3) != 0, {}, {}, {}});
  }
  if (const Status status = statement.status(); !status) return status.error();
  return rows;
}

Result<std::vector<StoredScan>> MapStore::scans() const {
  std::vector<StoredScan> rows;
  Statement statement = database_->prepare(
      "SELECT frame,keyframe,stamp_s,T_keyframe_lidar,T_odom_lidar,is_tracked,"
      "sum=checksum(frame,keyframe,stamp_s,T_keyframe_lidar,T_odom_lidar,is_tracked) FROM scans ORDER BY frame");
  while (statement.step()) {
    const auto from_keyframe = to_pose(statement.bytes(3)), from_odom = to_pose(statement.bytes(4));
    if (!from_keyframe || !from_odom || statement.integer(6) == 0)
      return database_->damaged("scans", statement.integer(0));
    rows.push_back({{statement.integer(0)},
                    {statement.integer(1)},
                    statement.real(2),
                    *from_keyframe,
                    *from_odom,
                    statement.integer(5) != 0});
  }
  if (const Status status = statement.status(); !status) return status.error();
  return rows;
}

Result<std::vector<StoredEdge>> MapStore::edges() const {
  std::vector<StoredEdge> rows;
  Statement statement = database_->prepare(
      "SELECT from_frame,to_frame,T_from_to,information,score,inlier_ratio,rmse_m,probability,id,sum=checksum("
      "from_frame,to_frame,T_from_to,information,score,inlier_ratio,rmse_m,probability) FROM edges ORDER BY id");
  while (statement.step()) {
    const auto pose = to_pose(statement.bytes(2));
    const auto information = to_matrix(statement.bytes(3));
    if (!pose || !information || statement.integer(9) == 0) return database_->damaged("edges", statement.integer(8));
    StoredEdge edge{{statement.integer(0)}, {statement.integer(1)}, *pose, *information, {}};
    if (!statement.is_null(4))
      edge.loop = LoopConstraint{edge.to,           edge.from,         edge.T_from_to,    statement.real(5),
                                 statement.real(6), statement.real(7), statement.real(4), edge.information};
    rows.push_back(edge);
  }
  if (const Status status = statement.status(); !status) return status.error();
  return rows;
}

Result<std::vector<CandidateRow>> MapStore::answers() const {
  std::vector<CandidateRow> rows;
  Statement statement = database_->prepare("SELECT query,match,score,accepted,reason FROM answers ORDER BY query");
  while (statement.step()) {
    CandidateRow row{{statement.integer(0)}, {}, statement.real(2), statement.integer(3) != 0, statement.text(4)};
    if (!statement.is_null(1)) row.match = FrameId{statement.integer(1)};
    rows.push_back(std::move(row));
  }
  if (const Status status = statement.status(); !status) return status.error();
  return rows;
}

Result<std::vector<StoredFix>> MapStore::fixes() const {
  std::vector<StoredFix> rows;
  Statement statement = database_->prepare(
      "SELECT f.frame,k.stamp_s,latitude_deg,longitude_deg,altitude_m,deviation_m,"
      "f.sum=checksum(f.frame,latitude_deg,longitude_deg,altitude_m,deviation_m) FROM fixes f JOIN keyframes k ON "
      "k.frame=f.frame ORDER BY f.frame");
  while (statement.step()) {
    StoredFix row{{statement.integer(0)},
                  {statement.real(1), statement.real(2), statement.real(3), statement.real(4), {}}};
    const auto deviation = statement.bytes(5);
    bool is_good = statement.integer(6) != 0 && deviation.size() == 3 * sizeof(double);
    if (is_good) std::memcpy(row.fix.deviation_m.data(), deviation.data(), deviation.size());
    is_good = is_good && row.fix.deviation_m.allFinite() && row.fix.deviation_m.minCoeff() > 0.0 &&
              std::abs(row.fix.latitude_deg) <= 90.0 && std::abs(row.fix.longitude_deg) <= 180.0 &&
              std::isfinite(row.fix.altitude_m);
    if (!is_good) return database_->damaged("fixes", row.keyframe.value);
    rows.push_back(row);
  }
  if (const Status status = statement.status(); !status) return status.error();
  return rows;
}

Result<std::vector<StoredUp>> MapStore::ups() const {
  std::vector<StoredUp> rows;
  if (database_->version < 4) return rows;  // none of them had any
  Statement statement = database_->prepare("SELECT frame,up,sum=checksum(frame,up) FROM gravity ORDER BY frame");
  while (statement.step()) {
    StoredUp row{{statement.integer(0)}};
    const auto up = statement.bytes(1);
    bool is_good = statement.integer(2) != 0 && up.size() == 3 * sizeof(double);
    if (is_good) std::memcpy(row.up.data(), up.data(), up.size());
    constexpr double kLengthOff = 1e-3;
    is_good = is_good && std::abs(row.up.norm() - 1.0) < kLengthOff;
    if (!is_good) return database_->damaged("gravity", row.keyframe.value);
    rows.push_back(row);
  }
  if (const Status status = statement.status(); !status) return status.error();
  return rows;
}

Result<std::vector<StoredEarth>> MapStore::earth() const {
  std::vector<StoredEarth> rows;
  Statement statement = database_->prepare(
      "SELECT part,latitude_deg,longitude_deg,altitude_m,T_earth_map,"
      "sum=checksum(part,latitude_deg,longitude_deg,altitude_m,T_earth_map) FROM earth ORDER BY part");
  while (statement.step()) {
    const auto pose = to_pose(statement.bytes(4));
    const StoredEarth row{static_cast<int>(statement.integer(0)), statement.real(1), statement.real(2),
                          statement.real(3), pose.value_or(Pose::Identity())};
    const bool is_place =
        std::abs(row.latitude_deg) <= 90.0 && std::abs(row.longitude_deg) <= 180.0 && std::isfinite(row.altitude_m);
    if (!pose || !is_place || statement.integer(5) == 0) return database_->damaged("earth", statement.integer(0));
    rows.push_back(row);
  }
  if (const Status status = statement.status(); !status) return status.error();
  return rows;
}

Result<std::size_t> MapStore::index_size() const {
  Statement statement = database_->prepare("SELECT offset+length(bytes) FROM place_index ORDER BY offset DESC LIMIT 1");
  if (statement.step()) return static_cast<std::size_t>(statement.integer(0));
  if (const Status status = statement.status(); !status) return status.error();
  return std::size_t{0};
}

Status MapStore::read_index(std::size_t offset, std::span<std::byte> piece) const {
  Statement statement = database_->prepare("SELECT bytes FROM place_index WHERE offset=?");
  if (statement.bind(static_cast<std::int64_t>(offset)).step() && statement.bytes(0).size() == piece.size()) {
    std::memcpy(piece.data(), statement.bytes(0).data(), piece.size());
    return ok();
  }
  if (const Status status = statement.status(); !status) return status.error();
  return Error{database_->file + ": its place index is damaged: restore the file from a copy"};
}

Result<std::vector<StoredMapPose>> MapStore::place_poses() const {
  std::vector<StoredMapPose> poses;
  Statement statement = database_->prepare("SELECT bytes,sum=checksum(bytes) FROM place_poses");
  if (statement.step()) {
    const auto bytes = statement.bytes(0);
    const Error damaged{database_->file + ": the poses of its places are damaged: restore the file from a copy"};
    if (statement.integer(1) == 0 || bytes.size() % sizeof(store_internal::PoseRow) != 0) return damaged;
    poses.reserve(bytes.size() / sizeof(store_internal::PoseRow));
    for (std::size_t at = 0; at < bytes.size(); at += sizeof(store_internal::PoseRow)) {
      store_internal::PoseRow row;
      std::memcpy(&row, bytes.data() + at, sizeof row);
      const auto T = to_pose(std::as_bytes(std::span(row.T_map_lidar)));
      if (!T) return damaged;
      poses.push_back({{row.keyframe}, *T, static_cast<int>(row.part)});
    }
  }
  if (const Status status = statement.status(); !status) return status.error();
  return poses;
}

namespace {

struct PartTable {
  const char* name;
  const char* select;
  const char* count_damaged;
};
constexpr std::array<PartTable, 5> kParts = {
    {{"descriptor", "SELECT bytes,sum=checksum(frame,bytes) FROM descriptors WHERE frame=?",
      "SELECT frame FROM descriptors WHERE sum<>checksum(frame,bytes) LIMIT 1"},
     {"place", "SELECT bytes,sum=checksum(frame,bytes) FROM places WHERE frame=?",
      "SELECT frame FROM places WHERE sum<>checksum(frame,bytes) LIMIT 1"},
     {"cloud", "SELECT bytes,sum=checksum(frame,bytes) FROM clouds WHERE frame=?",
      "SELECT frame FROM clouds WHERE sum<>checksum(frame,bytes) LIMIT 1"},
     {"visit", "SELECT bytes,sum=checksum(frame,bytes) FROM visits WHERE frame=?",
      "SELECT frame FROM visits WHERE sum<>checksum(frame,bytes) LIMIT 1"},
     {"changes", "SELECT bytes,sum=checksum(frame,bytes) FROM changes WHERE frame=?",
      "SELECT frame FROM changes WHERE sum<>checksum(frame,bytes) LIMIT 1"}}};

}  // namespace

Result<Bytes> MapStore::part(FrameId keyframe, Part part) const {
  const PartTable& table = kParts.at(static_cast<std::size_t>(part));
  Statement statement = database_->prepare(table.select);
  if (statement.bind(keyframe.value).step()) {
    if (statement.integer(1) == 0) return damaged(table.name, keyframe);
    const auto bytes = statement.bytes(0);
    return Bytes(bytes.begin(), bytes.end());
  }
  if (const Status status = statement.status(); !status) return status.error();
  const auto known = has(keyframe);
  if (!known) return known.error();
  if (*known) return Bytes();
  return Error{database_->file + ": has no key " + to_text(keyframe)};
}

Result<bool> MapStore::has(FrameId keyframe) const {
  Statement statement = database_->prepare("SELECT 1 FROM keyframes WHERE frame=?");
  if (statement.bind(keyframe.value).step()) return true;
  if (const Status status = statement.status(); !status) return status.error();
  return false;
}

namespace {

Result<std::vector<FrameId>> frames_of(Statement statement) {
  std::vector<FrameId> frames;
  while (statement.step()) frames.push_back({statement.integer(0)});
  if (const Status status = statement.status(); !status) return status.error();
  return frames;
}

}  // namespace

Result<std::vector<FrameId>> MapStore::visits() const {
  return frames_of(database_->prepare("SELECT frame FROM visits ORDER BY frame"));
}

Result<std::vector<FrameId>> MapStore::places() const {
  return frames_of(database_->prepare("SELECT frame FROM descriptors ORDER BY frame"));
}

Status MapStore::check() const {
  Statement whole = database_->prepare("PRAGMA integrity_check(1)");
  if (!whole.step()) return whole.status() ? Status(Error{database_->file + ": cannot be checked"}) : whole.status();
  if (whole.text(0) != "ok") return Error{database_->file + ": is damaged: " + whole.text(0)};
  const auto status_of = [](const auto& rows) { return rows ? ok() : Status(rows.error()); };
  for (const Status& status : {status_of(sessions()), status_of(keyframes()), status_of(map_poses()),
                               status_of(place_poses()), status_of(scans()), status_of(edges()), status_of(fixes()),
                               status_of(ups()), status_of(earth()), status_of(state())})
    if (!status) return status;
  for (const PartTable& table : kParts) {
    Statement statement = database_->prepare(table.count_damaged);
    if (statement.step()) return damaged(table.name, {statement.integer(0)});
    if (const Status status = statement.status(); !status) return status;
  }
  return ok();
}

Error MapStore::damaged(const char* part, FrameId keyframe) const {
  return {database_->file + ": the " + part + " of key " + to_text(keyframe) +
          " is damaged: restore the file from a copy"};
}

}  // namespace revisit
