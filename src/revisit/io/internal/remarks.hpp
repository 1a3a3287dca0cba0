// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <mutex>
#include <set>
#include <string>

#include <revisit/core/log.hpp>

namespace revisit::io_internal {

/// Remarks about single scans of a recording, each kind of them once: the first scan speaks for the others.
class Remarks : public std::enable_shared_from_this<Remarks> {
 public:
  explicit Remarks(LogSink log) : log_(std::move(log)) {}
  const LogSink& log() const { return log_; }
  /// A sink for what is said about this file. Safe to call from several threads.
  LogSink about(const std::filesystem::path& file) {
    return [self = shared_from_this(), file](LogLevel level, const std::string& message) {
      const std::string prefix = file.string() + ": ";
      const std::string remark = message.starts_with(prefix) ? message.substr(prefix.size()) : message;
      const std::scoped_lock lock(self->mutex_);
      if (self->said_.insert(remark).second)
        log_to(self->log_, level, prefix + remark + " (said once for the recording)");
    };
  }

 private:
  LogSink log_;
  std::mutex mutex_;
  std::set<std::string> said_;
};

}  // namespace revisit::io_internal
