// SPDX-License-Identifier: Apache-2.0
// What is added to a map.
#include <array>

#include <revisit/store/internal/map_database.hpp>
#include <revisit/store/internal/row_bytes.hpp>

namespace revisit {

using store_internal::bytes_of;
using store_internal::numbers_of;
using store_internal::Statement;

Status MapStore::add(const StoredKeyframe& keyframe) {
  if (const Status begun = database_->begin(); !begun) return begun;
  if (const Status dropped = database_->drop_index(); !dropped) return dropped;
  const auto pose = numbers_of(keyframe.T_odom_lidar);
  const Status added = database_->prepare("INSERT INTO keyframes VALUES(?1,?2,?3,?4,checksum(?1,?2,?3,?4))")
                           .bind(keyframe.frame.value)
                           .bind(keyframe.stamp_s)
                           .bind(std::as_bytes(std::span(pose)))
                           .bind(std::int64_t{keyframe.starts_segment})
                           .run();
  if (!added) return added;
  for (const auto& [sql, bytes] :
       {std::pair{"INSERT INTO descriptors VALUES(?1,?2,checksum(?1,?2))", &keyframe.descriptor},
        {"INSERT INTO places VALUES(?1,?2,checksum(?1,?2))", &keyframe.place},
        {"INSERT INTO clouds VALUES(?1,?2,checksum(?1,?2))", &keyframe.cloud}})
    if (!bytes->empty())
      if (const Status status = database_->prepare(sql).bind(keyframe.frame.value).bind(*bytes).run(); !status)
        return status;
  return ok();
}

Status MapStore::add_visit(FrameId keyframe, const Bytes& cloud) {
  if (const Status begun = database_->begin(); !begun) return begun;
  return database_->prepare("INSERT INTO visits VALUES(?1,?2,checksum(?1,?2))").bind(keyframe.value).bind(cloud).run();
}

Status MapStore::set_cloud(FrameId keyframe, const Bytes& cloud, const Bytes& changes) {
  if (const Status begun = database_->begin(); !begun) return begun;
  for (const auto& [sql, bytes] : {std::pair{"INSERT OR REPLACE INTO clouds VALUES(?1,?2,checksum(?1,?2))", &cloud},
                                   {"INSERT OR REPLACE INTO changes VALUES(?1,?2,checksum(?1,?2))", &changes}})
    if (const Status status = database_->prepare(sql).bind(keyframe.value).bind(*bytes).run(); !status) return status;
  return ok();
}

Status MapStore::forget_visits() {
  if (const Status begun = database_->begin(); !begun) return begun;
  return database_->run("DELETE FROM visits");
}

Status MapStore::remove(std::span<const FrameId> keyframes, std::span<const Joint> joints) {
  if (const Status begun = database_->begin(); !begun) return begun;
  if (const Status dropped = database_->drop_index(); !dropped) return dropped;
  Status listed = database_->run("CREATE TEMP TABLE IF NOT EXISTS removed(frame INTEGER PRIMARY KEY)");
  if (!listed) return listed;
  Statement list = database_->prepare("INSERT OR IGNORE INTO removed VALUES(?)");
  for (const FrameId frame : keyframes) {
    if (Status status = list.bind(frame.value).run(); !status) return status;
    list.reset();
  }
  for (const char* of : {"keyframes WHERE frame", "map_poses WHERE frame", "fixes WHERE frame", "gravity WHERE frame",
                         "descriptors WHERE frame", "places WHERE frame", "clouds WHERE frame", "changes WHERE frame",
                         "visits WHERE frame", "scans WHERE keyframe", "answers WHERE query", "edges WHERE from_frame",
                         "edges WHERE to_frame"}) {
    const std::string sql = "DELETE FROM " + std::string(of) + " IN (SELECT frame FROM removed)";
    if (Status status = database_->run(sql.c_str()); !status) return status;
  }
  if (Status status = database_->run("DELETE FROM removed"); !status) return status;
  for (const Joint& each : joints) {
    if (const Status status = add(each.edge); !status) return status;
    if (!each.starts_segment) continue;
    const Status status = database_
                              ->prepare(
                                  "UPDATE keyframes SET starts_anew=1,sum=checksum(frame,stamp_s,T_odom_lidar,1) "
                                  "WHERE frame=?")
                              .bind(each.edge.to.value)
                              .run();
    if (!status) return status;
  }
  return ok();
}

Status MapStore::add(const StoredScan& scan) {
  if (const Status begun = database_->begin(); !begun) return begun;
  const auto from_keyframe = numbers_of(scan.T_keyframe_lidar), from_odom = numbers_of(scan.T_odom_lidar);
  return database_->prepare("INSERT INTO scans VALUES(?1,?2,?3,?4,?5,?6,checksum(?1,?2,?3,?4,?5,?6))")
      .bind(scan.frame.value)
      .bind(scan.keyframe.value)
      .bind(scan.stamp_s)
      .bind(std::as_bytes(std::span(from_keyframe)))
      .bind(std::as_bytes(std::span(from_odom)))
      .bind(std::int64_t{scan.is_tracked})
      .run();
}

Status MapStore::add(const StoredEdge& edge) {
  if (const Status begun = database_->begin(); !begun) return begun;
  const auto pose = numbers_of(edge.T_from_to);
  std::array<std::optional<double>, 4> of_loop{};
  if (edge.loop) of_loop = {edge.loop->score, edge.loop->inlier_ratio, edge.loop->rmse_m, edge.loop->probability};
  Statement statement = database_->prepare(
      "INSERT INTO edges(from_frame,to_frame,T_from_to,information,score,inlier_ratio,rmse_m,probability,sum) "
      "VALUES(?1,?2,?3,?4,?5,?6,?7,?8,checksum(?1,?2,?3,?4,?5,?6,?7,?8))");
  statement.bind(edge.from.value).bind(edge.to.value).bind(std::as_bytes(std::span(pose)));
  statement.bind(bytes_of(edge.information));
  for (const auto& value : of_loop) statement.bind(value);
  return statement.run();
}

Status MapStore::add(const CandidateRow& answer) {
  if (const Status begun = database_->begin(); !begun) return begun;
  Statement statement = database_->prepare("INSERT INTO answers VALUES(?,?,?,?,?)");
  statement.bind(answer.query.value);
  if (answer.match)
    statement.bind(answer.match->value);
  else
    statement.bind_null();
  return statement.bind(answer.score).bind(std::int64_t{answer.accepted}).bind(answer.reason).run();
}

Status MapStore::add(const StoredFix& fix) {
  if (const Status begun = database_->begin(); !begun) return begun;
  const Eigen::Vector3d& deviation_m = fix.fix.deviation_m;
  return database_->prepare("INSERT INTO fixes VALUES(?1,?2,?3,?4,?5,checksum(?1,?2,?3,?4,?5))")
      .bind(fix.keyframe.value)
      .bind(fix.fix.latitude_deg)
      .bind(fix.fix.longitude_deg)
      .bind(fix.fix.altitude_m)
      .bind(std::as_bytes(std::span(deviation_m.data(), 3)))
      .run();
}

Status MapStore::add(const StoredUp& up) {
  if (const Status begun = database_->begin(); !begun) return begun;
  return database_->prepare("INSERT INTO gravity VALUES(?1,?2,checksum(?1,?2))")
      .bind(up.keyframe.value)
      .bind(std::as_bytes(std::span(up.up.data(), 3)))
      .run();
}

Status MapStore::set_earth(std::span<const StoredEarth> parts) {
  if (const Status begun = database_->begin(); !begun) return begun;
  if (const Status status = database_->run("DELETE FROM earth"); !status) return status;
  for (const StoredEarth& each : parts) {
    const auto pose = numbers_of(each.T_earth_map);
    const Status status = database_->prepare("INSERT INTO earth VALUES(?1,?2,?3,?4,?5,checksum(?1,?2,?3,?4,?5))")
                              .bind(std::int64_t{each.part})
                              .bind(each.latitude_deg)
                              .bind(each.longitude_deg)
                              .bind(each.altitude_m)
                              .bind(std::as_bytes(std::span(pose)))
                              .run();
    if (!status) return status;
  }
  return ok();
}

Status MapStore::set(const StoredSession& session) {
  if (const Status begun = database_->begin(); !begun) return begun;
  return database_->prepare("INSERT OR REPLACE INTO sessions VALUES(?1,?2,?3,?4,checksum(?1,?2,?3,?4))")
      .bind(std::int64_t{session.id})
      .bind(session.recording)
      .bind(session.parameters)
      .bind(session.sensor)
      .run();
}

Status MapStore::set_map_poses(std::span<const StoredMapPose> poses) {
  if (const Status begun = database_->begin(); !begun) return begun;
  if (const Status dropped = database_->drop_index(); !dropped) return dropped;
  if (const Status status = database_->run("DELETE FROM map_poses"); !status) return status;
  Statement statement = database_->prepare("INSERT INTO map_poses VALUES(?1,?2,?3,checksum(?1,?2,?3))");
  for (const StoredMapPose& each : poses) {
    const auto pose = numbers_of(each.T_map_lidar);
    const Status status =
        statement.bind(each.keyframe.value).bind(std::as_bytes(std::span(pose))).bind(std::int64_t{each.part}).run();
    if (!status) return status;
    statement.reset();
  }
  return ok();
}

Status MapStore::add_index(std::size_t offset, std::span<const std::byte> piece) {
  if (const Status begun = database_->begin(); !begun) return begun;
  return database_->prepare("INSERT INTO place_index VALUES(?,?)")
      .bind(static_cast<std::int64_t>(offset))
      .bind(piece)
      .run();
}

Status MapStore::set_place_poses(std::span<const StoredMapPose> poses) {
  if (const Status begun = database_->begin(); !begun) return begun;
  Bytes rows;
  rows.reserve(poses.size() * sizeof(store_internal::PoseRow));
  for (const StoredMapPose& each : poses) {
    const store_internal::PoseRow row{each.keyframe.value, each.part, numbers_of(each.T_map_lidar)};
    const auto bytes = std::as_bytes(std::span(&row, 1));
    rows.insert(rows.end(), bytes.begin(), bytes.end());
  }
  return database_->prepare("INSERT OR REPLACE INTO place_poses VALUES(0,?1,checksum(?1))").bind(rows).run();
}

Status MapStore::set_state(std::span<const std::byte> bytes) {
  if (const Status begun = database_->begin(); !begun) return begun;
  return database_->prepare("INSERT OR REPLACE INTO state VALUES(0,?1,checksum(?1))").bind(bytes).run();
}

}  // namespace revisit
