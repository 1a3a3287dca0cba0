// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cerrno>
#include <filesystem>
#include <fstream>
#include <string>

#include <revisit/core/result.hpp>
#include <revisit/io/internal/bytes.hpp>

namespace revisit::io_internal {

/// A text file whose every failure is noticed (a full disk shows only when the buffer is flushed).
class TextWriter {
 public:
  explicit TextWriter(const std::filesystem::path& file) : file_(file) {
    errno = 0;
    stream_.open(file, std::ios::binary | std::ios::trunc);
    note_failure();
  }

  std::ostream& stream() { return stream_; }

  /// Everything written so far is with the system when this returns without an error.
  Status flush() {
    if (stream_) errno = 0;  // a write that failed before has left its reason there
    stream_.flush();
    note_failure();
    return status();
  }
  Status finish() {
    if (const Status flushed = flush(); !flushed) return flushed;
    stream_.close();
    note_failure();
    return status();
  }

 private:
  void note_failure() {
    if (!stream_ && reason_.empty()) reason_ = system_reason();
  }
  Status status() const {
    if (reason_.empty()) return ok();
    return Error{file_.string() + ": cannot be written: " + reason_};
  }

  std::filesystem::path file_;
  std::ofstream stream_;
  std::string reason_;
};

}  // namespace revisit::io_internal
