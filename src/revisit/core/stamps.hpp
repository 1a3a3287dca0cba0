// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <cstdint>

namespace revisit {

/// Time stamps as whole nanoseconds, and as seconds: the nearest double, so that a stamp that a file of numbers holds
/// comes to the same.
inline double to_seconds(std::int64_t time_ns) { return static_cast<double>(static_cast<long double>(time_ns) / 1e9L); }
inline std::int64_t to_nanoseconds(double time_s) {
  return static_cast<std::int64_t>(std::llround(static_cast<long double>(time_s) * 1e9L));
}

}  // namespace revisit
