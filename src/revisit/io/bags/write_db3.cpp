// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include <sqlite3.h>

#include <revisit/io/internal/bag_file_writer.hpp>

namespace revisit::io_internal {
namespace {

// As rosbag2 writes it (schema 4), which embeds the definitions.
constexpr const char* kDb3Schema = R"(
PRAGMA journal_mode = MEMORY;
CREATE TABLE schema(schema_version INTEGER PRIMARY KEY,ros_distro TEXT NOT NULL);
CREATE TABLE metadata(id INTEGER PRIMARY KEY,metadata_version INTEGER NOT NULL,metadata TEXT NOT NULL);
CREATE TABLE topics(id INTEGER PRIMARY KEY,name TEXT NOT NULL,type TEXT NOT NULL,serialization_format TEXT NOT NULL,offered_qos_profiles TEXT NOT NULL,type_description_hash TEXT NOT NULL);
CREATE TABLE message_definitions(id INTEGER PRIMARY KEY,topic_type TEXT NOT NULL,encoding TEXT NOT NULL,encoded_message_definition TEXT NOT NULL,type_description_hash TEXT NOT NULL);
CREATE TABLE messages(id INTEGER PRIMARY KEY,topic_id INTEGER NOT NULL,timestamp INTEGER NOT NULL, data BLOB NOT NULL);
INSERT INTO schema VALUES (4, 'jazzy');
BEGIN;
)";

class Db3Writer final : public BagFileWriter {
 public:
  explicit Db3Writer(const std::filesystem::path& file) : path_(file) {}
  ~Db3Writer() override {
    sqlite3_finalize(insert_);
    sqlite3_close(database_);
  }
  Db3Writer(const Db3Writer&) = delete;
  Db3Writer& operator=(const Db3Writer&) = delete;

  Status open() {
    if (sqlite3_open(path_.c_str(), &database_) != SQLITE_OK) return error();
    if (const Status status = run(kDb3Schema); !status) return status;
    return prepare("INSERT INTO messages (topic_id, timestamp, data) VALUES (?, ?, ?)", insert_);
  }

  Serialisation serialisation() const override { return Serialisation::kCdr; }

  Status add_topic(const std::string& name, const std::string& type) override {
    const std::string full = type.substr(0, type.find('/')) + "/msg" + type.substr(type.find('/'));
    if (const Status status =
            insert_texts("INSERT INTO topics (name, type, serialization_format, offered_qos_profiles, "
                         "type_description_hash) VALUES (?, ?, 'cdr', '', '')",
                         {name, full});
        !status)
      return status;
    return insert_texts(
        "INSERT INTO message_definitions (topic_type, encoding, encoded_message_definition, "
        "type_description_hash) VALUES (?, 'ros2msg', ?, '')",
        {full, definition_for_bag(type, false)});
  }

  Status write(std::size_t topic, std::int64_t log_time_ns, const std::string& message) override {
    sqlite3_reset(insert_);
    sqlite3_bind_int64(insert_, 1, static_cast<sqlite3_int64>(topic) + 1);
    sqlite3_bind_int64(insert_, 2, log_time_ns);
    sqlite3_bind_blob64(insert_, 3, message.data(), message.size(), SQLITE_STATIC);
    if (sqlite3_step(insert_) != SQLITE_DONE) return error();
    constexpr int kPerTransaction = 100;
    return ++written_ % kPerTransaction == 0 ? run("COMMIT; BEGIN;") : ok();
  }

  Status finish() override { return run("COMMIT; CREATE INDEX timestamp_idx ON messages (timestamp ASC);"); }

 private:
  Error error() const {
    return {path_.string() +
            ": cannot be written: " + (database_ != nullptr ? sqlite3_errmsg(database_) : "no memory")};
  }
  Status run(const char* sql) {
    return sqlite3_exec(database_, sql, nullptr, nullptr, nullptr) == SQLITE_OK ? ok() : Status(error());
  }
  Status prepare(const char* sql, sqlite3_stmt*& statement) {
    return sqlite3_prepare_v2(database_, sql, -1, &statement, nullptr) == SQLITE_OK ? ok() : Status(error());
  }
  Status insert_texts(const char* sql, std::initializer_list<std::string> texts) {
    sqlite3_stmt* statement = nullptr;
    if (const Status status = prepare(sql, statement); !status) return status;
    int column = 0;
    for (const std::string& text : texts)
      sqlite3_bind_text(statement, ++column, text.data(), static_cast<int>(text.size()), SQLITE_TRANSIENT);
    const bool is_done = sqlite3_step(statement) == SQLITE_DONE;
    sqlite3_finalize(statement);
    return is_done ? ok() : Status(error());
  }

  std::filesystem::path path_;
  sqlite3* database_ = nullptr;
  sqlite3_stmt* insert_ = nullptr;
  int written_ = 0;
};

}  // namespace

Result<std::unique_ptr<BagFileWriter>> create_db3(const std::filesystem::path& file) {
  auto writer = std::make_unique<Db3Writer>(file);
  if (const Status status = writer->open(); !status) return status.error();
  return std::unique_ptr<BagFileWriter>(std::move(writer));
}

}  // namespace revisit::io_internal
