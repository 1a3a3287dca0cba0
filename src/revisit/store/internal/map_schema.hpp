// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include <sqlite3.h>

#include <revisit/core/result.hpp>

namespace revisit::store_internal {

/// How a map lies in its file (docs/maps.md), and how files of earlier versions become it.
inline constexpr int kApplication = 0x52565354, kVersion = 6;
/// A map of this version is read as it is: it lacks what may be empty.
inline constexpr int kOldestReadable = 3;

/// Whether the file is as long as its header says, as far as no other program's changes wait beside it.
Status check_length(const std::string& file);
/// Teaches this connection `checksum(...)`: of all its arguments' bytes together. Rows bear it as `sum`.
Status add_checksum_function(sqlite3* database, const std::string& file);
/// All tables of a new map.
Status create_schema(sqlite3* database, const std::string& file);
/// Refused are files that are no map, or of a version that this program does not know.
Result<int> version_of(sqlite3* database, const std::string& file);
/// Makes the file one of this version, at once or not at all.
Status upgrade(sqlite3* database, const std::string& file, int version);

}  // namespace revisit::store_internal
