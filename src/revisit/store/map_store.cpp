// SPDX-License-Identifier: Apache-2.0
#include <revisit/store/map_store.hpp>

#include <array>
#include <cmath>
#include <cstring>
#include <utility>

#include <revisit/core/text.hpp>
#include <revisit/store/internal/database.hpp>
#include <revisit/store/internal/map_schema.hpp>

namespace revisit {
namespace {

using store_internal::Statement;

std::span<const std::byte> bytes_of(const Matrix6& matrix) { return std::as_bytes(std::span(matrix.data(), 36)); }

// x y z, then the quaternion x y z w.
std::array<double, 7> numbers_of(const Pose& T) {
  const Eigen::Quaterniond q(T.rotation());
  return {T.translation().x(), T.translation().y(), T.translation().z(), q.x(), q.y(), q.z(), q.w()};
}

// What is not finite or no rotation is none of ours.
std::optional<Pose> to_pose(std::span<const std::byte> bytes) {
  std::array<double, 7> v{};
  if (bytes.size() != sizeof v) return std::nullopt;
  std::memcpy(v.data(), bytes.data(), sizeof v);
  const Eigen::Quaterniond q(v[6], v[3], v[4], v[5]);
  constexpr double kFarthest_m = 1e7;
  const auto is_near = [](double metres) { return std::abs(metres) < kFarthest_m; };
  if (!(std::abs(q.norm() - 1.0) < 1e-3) || !is_near(v[0]) || !is_near(v[1]) || !is_near(v[2])) return std::nullopt;
  Pose T = Pose::Identity();
  T.linear() = q.normalized().toRotationMatrix();
  T.translation() << v[0], v[1], v[2];
  return T;
}

std::optional<Matrix6> to_matrix(std::span<const std::byte> bytes) {
  Matrix6 matrix;
  if (bytes.size() != 36 * sizeof(double)) return std::nullopt;
  std::memcpy(matrix.data(), bytes.data(), bytes.size());
  if (!matrix.allFinite() || !matrix.isApprox(matrix.transpose(), 1e-6)) return std::nullopt;
  return matrix;
}

}  // namespace

struct MapStore::Database {
  struct Close {
    void operator()(sqlite3* handle) const { sqlite3_close_v2(handle); }
  };
  std::string file;
  std::unique_ptr<sqlite3, Close> handle;

  Statement prepare(const char* sql) const { return {handle.get(), file, sql}; }
  Status run(const char* sql) const { return prepare(sql).run(); }
  Error damaged(const char* what, std::int64_t row) const {
    return {file + ": row " + std::to_string(row) + " of its " + what + " is damaged"};
  }
  Status begin() {
    // SQLite may end a transaction by itself (a full disk): its own state counts.
    return is_in_transaction() ? ok() : run("BEGIN");
  }
  bool is_in_transaction() const { return sqlite3_get_autocommit(handle.get()) == 0; }
  static Result<std::unique_ptr<Database>> connect(const std::filesystem::path& path, int flags) {
    auto database = std::make_unique<Database>();
    database->file = path.string();
    sqlite3* handle = nullptr;
    const int code = sqlite3_open_v2(path.c_str(), &handle, flags, nullptr);
    database->handle.reset(handle);
    if (code != SQLITE_OK) return Error{path.string() + ": cannot be opened as a map: " + sqlite3_errstr(code)};
    constexpr int kPatience_ms = 2000;  // with another program that writes at the moment
    sqlite3_busy_timeout(handle, kPatience_ms);
    if (const Status status = store_internal::add_checksum_function(handle, database->file); !status)
      return status.error();
    return database;
  }
  // A commit is with the system when it returns: it survives the end of the program, whatever ends it.
  Status journal() {
    writes = true;
    for (const char* sql : {"PRAGMA journal_mode=WAL", "PRAGMA synchronous=NORMAL", "PRAGMA cache_size=-8000"})
      if (const Status status = run(sql); !status) return status;
    return ok();
  }
  // A map that nobody writes is one file, which may be copied, and read where nothing can be written.
  ~Database() { (void)end_writing(); }
  Status end_writing() {
    if (!handle || !std::exchange(writes, false)) return ok();
    if (is_in_transaction()) (void)run("ROLLBACK");
    if (const Status status = run("PRAGMA wal_checkpoint(TRUNCATE)"); !status) return status;
    return run("PRAGMA journal_mode=DELETE");
  }
  bool writes = false;

  Database() = default;
  Database(const Database&) = delete;
  Database& operator=(const Database&) = delete;
};

MapStore::MapStore(std::unique_ptr<Database> database) : database_(std::move(database)) {}
MapStore::MapStore(MapStore&&) noexcept = default;
MapStore& MapStore::operator=(MapStore&&) noexcept = default;
MapStore::~MapStore() = default;

std::filesystem::path MapStore::file_of(const std::filesystem::path& path) {
  std::error_code failure;
  if (!std::filesystem::is_directory(path, failure)) return path;
  constexpr const char* kNameOfVersion2 = "map.sqlite";
  const bool is_old =
      !std::filesystem::exists(path / kFileName, failure) && std::filesystem::exists(path / kNameOfVersion2, failure);
  return path / (is_old ? kNameOfVersion2 : kFileName);
}

const std::string& MapStore::file() const { return database_->file; }

// SQLite takes an empty name for a temporary file that goes with its handle.
Result<MapStore> MapStore::create_temporary() { return create({}); }

Result<MapStore> MapStore::create(const std::filesystem::path& file) {
  std::error_code failure;
  if (!file.empty() && std::filesystem::exists(file, failure)) return Error{file.string() + ": exists already"};
  auto database = Database::connect(file, SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE);
  if (!database) return database.error();
  if (const Status status = (*database)->journal(); !status) return status.error();
  if (const Status status = store_internal::create_schema((*database)->handle.get(), file.string()); !status)
    return status.error();
  return MapStore(*std::move(database));
}

Result<MapStore> MapStore::open(const std::filesystem::path& file, Access access) {
  auto database = Database::connect(file, access == Access::kRead ? SQLITE_OPEN_READONLY : SQLITE_OPEN_READWRITE);
  if (!database) return database.error();
  sqlite3* const handle = (*database)->handle.get();
  if (const Status status = store_internal::check_length(file.string()); !status) return status.error();
  const auto version = store_internal::version_of(handle, file.string());
  if (!version) return version.error();
  if (*version == store_internal::kVersion) {
    if (access == Access::kWrite)
      if (const Status status = (*database)->journal(); !status) return status.error();
    return MapStore(*std::move(database));
  }
  if (access == Access::kRead) {
    database->reset();  // it would keep the upgraded file from becoming one
    if (const auto upgraded = open(file, Access::kWrite); !upgraded)
      return Error{file.string() + ": is a map of version " + std::to_string(*version) +
                   ", which cannot be upgraded: " + upgraded.error().message};
    return open(file, access);
  }
  if (const Status status = store_internal::upgrade(handle, file.string(), *version); !status) return status.error();
  if (const Status status = (*database)->journal(); !status) return status.error();
  return MapStore(*std::move(database));
}

Status MapStore::add(const StoredKeyframe& keyframe) {
  if (const Status begun = database_->begin(); !begun) return begun;
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

Status MapStore::commit() { return database_->is_in_transaction() ? database_->run("COMMIT") : ok(); }

Status MapStore::hold() const { return database_->is_in_transaction() ? ok() : database_->run("BEGIN"); }

Status MapStore::release() const { return is_held() ? database_->run("COMMIT") : ok(); }
bool MapStore::is_held() const { return database_->is_in_transaction(); }

Status MapStore::close() {
  Status status = database_->end_writing();
  std::error_code failure;
  if (!status || !std::filesystem::exists(database_->file + "-wal", failure)) return status;
  return Error{database_->file + ": cannot be written whole (a full disk, or another program reads it)"};
}

Status MapStore::roll_back() { return database_->is_in_transaction() ? database_->run("ROLLBACK") : ok(); }

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

Status MapStore::set_note(const std::string& name, const std::string& text) {
  if (const Status begun = database_->begin(); !begun) return begun;
  return database_->prepare("INSERT OR REPLACE INTO notes VALUES(?,?)").bind(name).bind(text).run();
}

Result<std::optional<std::string>> MapStore::note(const std::string& name) const {
  Statement statement = database_->prepare("SELECT text FROM notes WHERE name=?");
  if (statement.bind(name).step()) return std::optional(statement.text(0));
  if (const Status status = statement.status(); !status) return status.error();
  return std::optional<std::string>();
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

Result<std::vector<StoredScan>> MapStore::scans() const { return last_scans(-1); }

// SQLite takes a negative limit for none.
Result<std::vector<StoredScan>> MapStore::last_scans(int count) const {
  std::vector<StoredScan> rows;
  Statement statement = database_->prepare(
      "SELECT * FROM (SELECT frame,keyframe,stamp_s,T_keyframe_lidar,T_odom_lidar,is_tracked,"
      "sum=checksum(frame,keyframe,stamp_s,T_keyframe_lidar,T_odom_lidar,is_tracked) FROM scans ORDER BY frame DESC "
      "LIMIT ?) ORDER BY frame");
  statement.bind(std::int64_t{count});
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

namespace {

struct PartTable {
  const char* name;
  const char* select;
  const char* count_damaged;
};
constexpr std::array<PartTable, 3> kParts = {
    {{"descriptor", "SELECT bytes,sum=checksum(frame,bytes) FROM descriptors WHERE frame=?",
      "SELECT frame FROM descriptors WHERE sum<>checksum(frame,bytes) LIMIT 1"},
     {"place", "SELECT bytes,sum=checksum(frame,bytes) FROM places WHERE frame=?",
      "SELECT frame FROM places WHERE sum<>checksum(frame,bytes) LIMIT 1"},
     {"cloud", "SELECT bytes,sum=checksum(frame,bytes) FROM clouds WHERE frame=?",
      "SELECT frame FROM clouds WHERE sum<>checksum(frame,bytes) LIMIT 1"}}};

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
  Statement known = database_->prepare("SELECT 1 FROM keyframes WHERE frame=?");
  if (known.bind(keyframe.value).step()) return Bytes();
  return Error{database_->file + ": has no key " + to_text(keyframe)};
}

Status MapStore::check() const {
  Statement whole = database_->prepare("PRAGMA integrity_check(1)");
  if (!whole.step()) return whole.status() ? Status(Error{database_->file + ": cannot be checked"}) : whole.status();
  if (whole.text(0) != "ok") return Error{database_->file + ": is damaged: " + whole.text(0)};
  const auto status_of = [](const auto& rows) { return rows ? ok() : Status(rows.error()); };
  for (const Status& status :
       {status_of(sessions()), status_of(keyframes()), status_of(map_poses()), status_of(scans()), status_of(edges())})
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
