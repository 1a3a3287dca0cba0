// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <map>
#include <mutex>

#include <sqlite3.h>

#include <revisit/io/internal/bag_file.hpp>

namespace revisit::io_internal {
namespace {

struct CloseDatabase {
  void operator()(sqlite3* database) const { sqlite3_close(database); }
  void operator()(sqlite3_stmt* statement) const { sqlite3_finalize(statement); }
};
using Database = std::unique_ptr<sqlite3, CloseDatabase>;
using Statement = std::unique_ptr<sqlite3_stmt, CloseDatabase>;

std::string text_at(const Statement& statement, int column) {
  const auto* text = reinterpret_cast<const char*>(sqlite3_column_text(statement.get(), column));
  return text == nullptr ? std::string()
                         : std::string(text, static_cast<std::size_t>(sqlite3_column_bytes(statement.get(), column)));
}

// A bag of ROS 2 in SQLite: a row a message, with topic, time and serialised data.
class Db3File final : public BagFile {
 public:
  explicit Db3File(std::filesystem::path path) : path_(std::move(path)) {}

  Status open(const LogSink& log) {
    std::error_code failure;
    // A recorder that crashed leaves a log beside the file; without one, nothing beside it is looked for or written.
    const std::uintmax_t log_size = std::filesystem::file_size(path_.string() + "-wal", failure);
    const bool has_log = !failure && log_size > 0;
    std::string uri = "file:";
    for (const char c : std::filesystem::absolute(path_).string())
      uri += c == '%' ? "%25" : c == '?' ? "%3f" : c == '#' ? "%23" : std::string(1, c);
    sqlite3* raw = nullptr;
    const int code = sqlite3_open_v2((uri + (has_log ? "?mode=ro" : "?immutable=1")).c_str(), &raw,
                                     SQLITE_OPEN_READONLY | SQLITE_OPEN_URI | SQLITE_OPEN_NOMUTEX, nullptr);
    database_.reset(raw);
    if (code != SQLITE_OK) return error("cannot be opened");
    if (const Status status = check_tables(); !status) return status;
    if (const Status status = read_topics(); !status) return status;
    return read_rows(log);
  }

  const std::vector<BagTopic>& topics() const override { return topics_; }
  std::int64_t first_ns() const override { return first_ns_; }
  std::int64_t last_ns() const override { return last_ns_; }

  Result<BagMessage> read(std::size_t topic, std::uint64_t index) const override {
    const Row& row = rows_.at(topic).at(index);
    const std::lock_guard lock(mutex_);
    auto statement = prepare("SELECT data FROM messages WHERE id = ?");
    if (!statement) return statement.error();
    sqlite3_bind_int64(statement->get(), 1, row.id);
    if (sqlite3_step(statement->get()) != SQLITE_ROW)
      return error("message " + std::to_string(row.id) + " cannot be read");
    const auto size = static_cast<std::size_t>(sqlite3_column_bytes(statement->get(), 0));
    std::uint8_t* target = nullptr;
    BagMessage message{row.time_ns, allocate(size, target)};
    if (target == nullptr)
      return Error{path_.string() + ": no memory for a message of " + std::to_string(size) + " bytes"};
    if (size > 0) std::copy_n(static_cast<const std::uint8_t*>(sqlite3_column_blob(statement->get(), 0)), size, target);
    return message;
  }

  Status visit(std::size_t topic, std::int64_t from_ns, std::int64_t to_ns,
               const std::function<bool(const BagMessage&)>& use) const override {
    const std::vector<Row>& rows = rows_.at(topic);
    const auto first = std::lower_bound(rows.begin(), rows.end(), from_ns,
                                        [](const Row& row, std::int64_t time_ns) { return row.time_ns < time_ns; });
    for (auto it = first; it != rows.end() && it->time_ns <= to_ns; ++it) {
      const auto message = read(topic, static_cast<std::uint64_t>(it - rows.begin()));
      if (!message) return message.error();
      if (!use(*message)) break;
    }
    return ok();
  }

 private:
  struct Row {
    std::int64_t time_ns, id;
  };

  Error error(const std::string& what) const {
    return {path_.string() + ": " + what + ": " + (database_ ? sqlite3_errmsg(database_.get()) : "no memory")};
  }

  Result<Statement> prepare(const char* sql) const {
    sqlite3_stmt* raw = nullptr;
    if (sqlite3_prepare_v2(database_.get(), sql, -1, &raw, nullptr) != SQLITE_OK)
      return error("is no bag of ROS 2 (.db3)");
    return Statement(raw);
  }

  // Tables, not views: those may be without end.
  Status check_tables() {
    auto statement =
        prepare("SELECT COUNT(*) FROM sqlite_master WHERE type = 'table' AND name IN ('messages', 'topics')");
    if (!statement) return statement.error();
    if (sqlite3_step(statement->get()) != SQLITE_ROW || sqlite3_column_int(statement->get(), 0) != 2)
      return Error{path_.string() + ": is no bag of ROS 2 (.db3): no tables 'messages' and 'topics'"};
    return ok();
  }

  Status read_topics() {
    std::map<std::string, std::string> definitions;  // only newer bags have them
    if (auto statement = prepare("SELECT topic_type, encoded_message_definition FROM message_definitions WHERE "
                                 "encoding = 'ros2msg'"))
      while (sqlite3_step(statement->get()) == SQLITE_ROW) definitions[text_at(*statement, 0)] = text_at(*statement, 1);
    auto statement = prepare("SELECT id, name, type, serialization_format FROM topics ORDER BY id");
    if (!statement) return statement.error();
    int code = SQLITE_OK;
    while ((code = sqlite3_step(statement->get())) == SQLITE_ROW) {
      topic_of_id_[sqlite3_column_int64(statement->get(), 0)] = topics_.size();
      const std::string type = text_at(*statement, 2);
      topics_.push_back({text_at(*statement, 1), type, text_at(*statement, 3), definitions[type], 0});
    }
    if (code != SQLITE_DONE) return error("its topics cannot be read");
    rows_.resize(topics_.size());
    return ok();
  }

  // Where each message is. A file that was cut off gives those before the cut.
  Status read_rows(const LogSink& log) {
    auto statement = prepare("SELECT id, topic_id, timestamp FROM messages");
    if (!statement) return statement.error();
    std::size_t count = 0;
    int code = SQLITE_OK;
    for (; (code = sqlite3_step(statement->get())) == SQLITE_ROW; ++count) {
      const auto topic = topic_of_id_.find(sqlite3_column_int64(statement->get(), 1));
      if (topic == topic_of_id_.end()) continue;
      constexpr std::int64_t kFarthest_ns = std::int64_t{1} << 61;  // some 73 years either way
      const std::int64_t time_ns = sqlite3_column_int64(statement->get(), 2);
      const Row row{std::clamp(time_ns, -kFarthest_ns, kFarthest_ns), sqlite3_column_int64(statement->get(), 0)};
      rows_[topic->second].push_back(row);
      first_ns_ = count == 0 ? row.time_ns : std::min(first_ns_, row.time_ns);
      last_ns_ = count == 0 ? row.time_ns : std::max(last_ns_, row.time_ns);
    }
    if (code != SQLITE_DONE) {
      const Error problem = error("only " + std::to_string(count) + " messages can be read");
      if (count == 0) return problem;
      log_to(log, LogLevel::kWarning, problem.message);
    }
    for (std::size_t i = 0; i < rows_.size(); ++i) {
      std::sort(rows_[i].begin(), rows_[i].end(),
                [](const Row& a, const Row& b) { return std::pair(a.time_ns, a.id) < std::pair(b.time_ns, b.id); });
      topics_[i].messages = rows_[i].size();
    }
    return ok();
  }

  std::filesystem::path path_;
  Database database_;
  std::vector<BagTopic> topics_;
  std::map<std::int64_t, std::size_t> topic_of_id_;
  std::vector<std::vector<Row>> rows_;
  std::int64_t first_ns_ = 0, last_ns_ = 0;
  mutable std::mutex mutex_;
};

}  // namespace

Result<std::unique_ptr<BagFile>> open_db3(const std::filesystem::path& file, const LogSink& log) {
  auto bag = std::make_unique<Db3File>(file);
  if (const Status status = bag->open(log); !status) return status.error();
  return std::unique_ptr<BagFile>(std::move(bag));
}

}  // namespace revisit::io_internal
