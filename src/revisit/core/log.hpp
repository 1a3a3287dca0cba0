// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <string>

namespace revisit {

enum class LogLevel { kInfo, kWarning, kError };

/// Where messages go. The library never prints: without a sink, messages are dropped.
/// Called from the thread that called the library.
using LogSink = std::function<void(LogLevel, const std::string&)>;

inline void log_to(const LogSink& sink, LogLevel level, const std::string& message) {
  if (sink) sink(level, message);
}

}  // namespace revisit
