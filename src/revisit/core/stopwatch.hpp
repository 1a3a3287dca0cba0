// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>

namespace revisit {

/// Milliseconds of a clock that never jumps.
class Stopwatch {
 public:
  /// Since the previous call, or since construction.
  double lap_ms() {
    const Clock::time_point now = Clock::now();
    const double lap = std::chrono::duration<double, std::milli>(now - last_).count();
    last_ = now;
    return lap;
  }

  /// Likewise, and the lap goes on.
  double elapsed_ms() const { return std::chrono::duration<double, std::milli>(Clock::now() - last_).count(); }

 private:
  using Clock = std::chrono::steady_clock;
  Clock::time_point last_ = Clock::now();
};

}  // namespace revisit
