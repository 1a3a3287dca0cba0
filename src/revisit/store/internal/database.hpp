// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include <sqlite3.h>

#include <revisit/core/result.hpp>

namespace revisit::store_internal {

/// An SQLite statement: bound, stepped and read in order. The first failure stays; status() names file and reason.
class Statement {
 public:
  Statement(sqlite3* database, const std::string& file, const char* sql);

  Statement& bind(std::int64_t value);
  Statement& bind(double value);
  Statement& bind(const std::string& text);
  Statement& bind(std::span<const std::byte> bytes);
  Statement& bind_null();
  Statement& bind(const std::optional<double>& value) { return value ? bind(*value) : bind_null(); }

  /// True while there is a row; false at the end or where it failed.
  bool step();
  /// To be bound and run once more.
  void reset();
  /// For statements that give no rows.
  Status run();
  Status status() const;

  std::int64_t integer(int column) const { return sqlite3_column_int64(handle(), column); }
  double real(int column) const { return sqlite3_column_double(handle(), column); }
  bool is_null(int column) const { return sqlite3_column_type(handle(), column) == SQLITE_NULL; }
  std::string text(int column) const;
  /// Valid until the next step.
  std::span<const std::byte> bytes(int column) const;

 private:
  struct Finalize {
    void operator()(sqlite3_stmt* statement) const { sqlite3_finalize(statement); }
  };
  sqlite3_stmt* handle() const { return statement_.get(); }
  void check(int code);

  sqlite3* database_;
  std::string file_, reason_;
  int next_ = 1;
  std::unique_ptr<sqlite3_stmt, Finalize> statement_;
};

}  // namespace revisit::store_internal
