// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstddef>
#include <string>

namespace revisit::cli {

/// Progress of long work on standard error: a bar with rate and remaining time on a terminal, a line every tenth of the
/// work elsewhere.
class Progress {
 public:
  Progress(std::string what, std::string unit, std::size_t total);
  /// Ends the bar's line.
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  void update(std::size_t done);
  /// Clears the bar so that a message can be printed; the next update draws it again.
  void clear();

 private:
  std::string what_, unit_;
  std::size_t total_, tenths_printed_ = 0;
  bool is_terminal_, is_drawn_ = false;
  std::chrono::steady_clock::time_point start_, last_drawn_;
};

}  // namespace revisit::cli
