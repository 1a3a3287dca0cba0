// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include <revisit/core/result.hpp>

namespace revisit::store_internal {

/// That one program at a time writes a map: SQLite keeps single commits apart, but a session is thousands of them. It
/// is the system's lock on a file NAME.lock beside the map: gone with the program, however that ends.
class WriterLock {
 public:
  /// Waits for a short time; an error where another program goes on writing.
  static Result<WriterLock> take(const std::filesystem::path& map);
  WriterLock(WriterLock&& other) noexcept;
  WriterLock& operator=(WriterLock&&) = delete;
  WriterLock(const WriterLock&) = delete;
  WriterLock& operator=(const WriterLock&) = delete;
  ~WriterLock();

 private:
  WriterLock(std::filesystem::path file, int descriptor);
  std::filesystem::path file_;
  int descriptor_ = -1;
};

}  // namespace revisit::store_internal
