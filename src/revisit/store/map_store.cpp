// SPDX-License-Identifier: Apache-2.0
#include <revisit/store/map_store.hpp>

#include <array>
#include <cmath>
#include <cstring>

#include <revisit/store/internal/database.hpp>

namespace revisit {
namespace {

using store_internal::Statement;

constexpr int kApplication = 0x52565354, kVersion = 2;
constexpr const char* kSchema = R"(
CREATE TABLE notes(name TEXT PRIMARY KEY, text TEXT NOT NULL);
CREATE TABLE keyframes(frame INTEGER PRIMARY KEY, stamp_s REAL NOT NULL, T_odom_lidar BLOB NOT NULL,
  starts_anew INTEGER NOT NULL, descriptor BLOB NOT NULL, place BLOB NOT NULL, cloud BLOB NOT NULL);
CREATE TABLE scans(frame INTEGER PRIMARY KEY, keyframe INTEGER NOT NULL, stamp_s REAL NOT NULL,
  T_keyframe_lidar BLOB NOT NULL, T_odom_lidar BLOB NOT NULL, is_tracked INTEGER NOT NULL);
CREATE TABLE edges(id INTEGER PRIMARY KEY, from_frame INTEGER NOT NULL, to_frame INTEGER NOT NULL,
  T_from_to BLOB NOT NULL, information BLOB NOT NULL, score REAL, inlier_ratio REAL, rmse_m REAL, probability REAL);
CREATE TABLE answers(query INTEGER PRIMARY KEY, match INTEGER, score REAL NOT NULL, accepted INTEGER NOT NULL,
  reason TEXT NOT NULL);
)";

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
    return database;
  }
  // A commit is with the system when it returns: it survives the end of the program, whatever ends it.
  Status journal() const {
    for (const char* sql : {"PRAGMA journal_mode=WAL", "PRAGMA synchronous=NORMAL", "PRAGMA cache_size=-8000"})
      if (const Status status = run(sql); !status) return status;
    return ok();
  }
};

MapStore::MapStore(std::unique_ptr<Database> database) : database_(std::move(database)) {}
MapStore::MapStore(MapStore&&) noexcept = default;
MapStore& MapStore::operator=(MapStore&&) noexcept = default;
MapStore::~MapStore() = default;

// SQLite takes an empty name for a temporary file that goes with its handle.
Result<MapStore> MapStore::create_temporary() { return create({}); }

Result<MapStore> MapStore::create(const std::filesystem::path& file) {
  std::error_code failure;
  if (!file.empty() && std::filesystem::exists(file, failure)) return Error{file.string() + ": exists already"};
  auto database = Database::connect(file, SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE);
  if (!database) return database.error();
  if (const Status status = (*database)->journal(); !status) return status.error();
  const std::string sql = "BEGIN;" + std::string(kSchema) + "PRAGMA application_id=" + std::to_string(kApplication) +
                          ";PRAGMA user_version=" + std::to_string(kVersion) + ";COMMIT;";
  if (sqlite3_exec((*database)->handle.get(), sql.c_str(), nullptr, nullptr, nullptr) != SQLITE_OK)
    return Error{file.string() + ": " + sqlite3_errmsg((*database)->handle.get())};
  return MapStore(*std::move(database));
}

Result<MapStore> MapStore::open(const std::filesystem::path& file) {
  auto database = Database::connect(file, SQLITE_OPEN_READWRITE);
  if (!database) return database.error();
  const auto number = [&](const char* sql) -> Result<std::int64_t> {
    Statement statement = (*database)->prepare(sql);
    const bool found = statement.step();
    if (!found) return statement.status() ? Error{file.string() + ": is no map"} : statement.status().error();
    return statement.integer(0);
  };
  const auto application = number("PRAGMA application_id"), version = number("PRAGMA user_version");
  for (const auto* each : {&application, &version})
    if (!*each) return each->error();
  if (*application != kApplication) return Error{file.string() + ": is an SQLite file, but no map of revisit"};
  if (*version != kVersion)
    return Error{file.string() + ": is a map of version " + std::to_string(*version) + "; this program reads version " +
                 std::to_string(kVersion)};
  if (const Status status = (*database)->journal(); !status) return status.error();
  return MapStore(*std::move(database));
}

Status MapStore::add(const StoredKeyframe& keyframe) {
  if (const Status begun = database_->begin(); !begun) return begun;
  const auto pose = numbers_of(keyframe.T_odom_lidar);
  return database_->prepare("INSERT INTO keyframes VALUES(?,?,?,?,?,?,?)")
      .bind(keyframe.frame.value)
      .bind(keyframe.stamp_s)
      .bind(std::as_bytes(std::span(pose)))
      .bind(std::int64_t{keyframe.starts_segment})
      .bind(keyframe.descriptor)
      .bind(keyframe.place)
      .bind(keyframe.cloud)
      .run();
}

Status MapStore::add(const StoredScan& scan) {
  if (const Status begun = database_->begin(); !begun) return begun;
  const auto from_keyframe = numbers_of(scan.T_keyframe_lidar), from_odom = numbers_of(scan.T_odom_lidar);
  return database_->prepare("INSERT INTO scans VALUES(?,?,?,?,?,?)")
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
      "INSERT INTO edges(from_frame,to_frame,T_from_to,information,score,inlier_ratio,rmse_m,probability) "
      "VALUES(?,?,?,?,?,?,?,?)");
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

Status MapStore::roll_back() { return database_->is_in_transaction() ? database_->run("ROLLBACK") : ok(); }

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

Result<std::vector<StoredKeyframe>> MapStore::keyframes() const {
  std::vector<StoredKeyframe> rows;
  Statement statement =
      database_->prepare("SELECT frame,stamp_s,T_odom_lidar,starts_anew FROM keyframes ORDER BY frame");
  while (statement.step()) {
    const auto pose = to_pose(statement.bytes(2));
    if (!pose) return database_->damaged("key frames", statement.integer(0));
    rows.push_back({{statement.integer(0)}, statement.real(1), *pose, statement.integer(3) != 0, {}, {}, {}});
  }
  if (const Status status = statement.status(); !status) return status.error();
  return rows;
}

Result<std::vector<StoredScan>> MapStore::scans() const {
  std::vector<StoredScan> rows;
  Statement statement = database_->prepare(
      "SELECT frame,keyframe,stamp_s,T_keyframe_lidar,T_odom_lidar,is_tracked FROM scans ORDER BY frame");
  while (statement.step()) {
    const auto from_keyframe = to_pose(statement.bytes(3)), from_odom = to_pose(statement.bytes(4));
    if (!from_keyframe || !from_odom) return database_->damaged("scans", statement.integer(0));
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
      "SELECT from_frame,to_frame,T_from_to,information,score,inlier_ratio,rmse_m,probability,id FROM edges ORDER BY "
      "id");
  while (statement.step()) {
    const auto pose = to_pose(statement.bytes(2));
    const auto information = to_matrix(statement.bytes(3));
    if (!pose || !information) return database_->damaged("edges", statement.integer(8));
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

Result<Bytes> MapStore::part(FrameId keyframe, Part part) const {
  static constexpr std::array kColumns = {"SELECT descriptor FROM keyframes WHERE frame=?",
                                          "SELECT place FROM keyframes WHERE frame=?",
                                          "SELECT cloud FROM keyframes WHERE frame=?"};
  Statement statement = database_->prepare(kColumns.at(static_cast<std::size_t>(part)));
  if (statement.bind(keyframe.value).step()) {
    const auto bytes = statement.bytes(0);
    return Bytes(bytes.begin(), bytes.end());
  }
  if (const Status status = statement.status(); !status) return status.error();
  return Error{database_->file + ": has no key frame " + std::to_string(keyframe.value)};
}

Error MapStore::damaged(const char* part, FrameId keyframe) const {
  return {database_->file + ": the " + part + " of key frame " + std::to_string(keyframe.value) + " is damaged"};
}

}  // namespace revisit
