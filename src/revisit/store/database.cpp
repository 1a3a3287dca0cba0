// SPDX-License-Identifier: Apache-2.0
#include <revisit/store/internal/database.hpp>

namespace revisit::store_internal {

Statement::Statement(sqlite3* database, const std::string& file, const char* sql) : database_(database), file_(file) {
  sqlite3_stmt* statement = nullptr;
  check(sqlite3_prepare_v2(database, sql, -1, &statement, nullptr));
  statement_.reset(statement);
}

void Statement::check(int code) {
  if (code != SQLITE_OK && code != SQLITE_ROW && code != SQLITE_DONE && reason_.empty())
    reason_ = sqlite3_errmsg(database_);
}

Statement& Statement::bind(std::int64_t value) {
  if (statement_) check(sqlite3_bind_int64(handle(), next_++, value));
  return *this;
}
Statement& Statement::bind(double value) {
  if (statement_) check(sqlite3_bind_double(handle(), next_++, value));
  return *this;
}
Statement& Statement::bind(const std::string& text) {
  if (statement_)
    check(sqlite3_bind_text64(handle(), next_++, text.data(), text.size(), SQLITE_TRANSIENT, SQLITE_UTF8));
  return *this;
}
Statement& Statement::bind(std::span<const std::byte> bytes) {
  // A null pointer would be stored as NULL: no bytes are bytes, too.
  static constexpr std::byte kNothing{};
  if (statement_)
    check(sqlite3_bind_blob64(handle(), next_++, bytes.empty() ? &kNothing : bytes.data(), bytes.size(),
                              SQLITE_TRANSIENT));
  return *this;
}
Statement& Statement::bind_null() {
  if (statement_) check(sqlite3_bind_null(handle(), next_++));
  return *this;
}

bool Statement::step() {
  if (!reason_.empty() || !statement_) return false;
  const int code = sqlite3_step(handle());
  check(code);
  return code == SQLITE_ROW;
}

void Statement::reset() {
  if (statement_) sqlite3_reset(handle());
  next_ = 1;
}

Status Statement::run() {
  while (step()) {
  }
  return status();
}

Status Statement::status() const {
  if (reason_.empty()) return ok();
  return Error{file_ + ": " + reason_};
}

std::string Statement::text(int column) const {
  const auto* const text = sqlite3_column_text(handle(), column);
  if (text == nullptr) return {};
  return {reinterpret_cast<const char*>(text), static_cast<std::size_t>(sqlite3_column_bytes(handle(), column))};
}

std::span<const std::byte> Statement::bytes(int column) const {
  const void* const data = sqlite3_column_blob(handle(), column);
  return {static_cast<const std::byte*>(data), static_cast<std::size_t>(sqlite3_column_bytes(handle(), column))};
}

}  // namespace revisit::store_internal
