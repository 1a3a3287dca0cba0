// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>

namespace revisit {

/// The whole number at or below, exactly; for |value| < 2^31. std::floor is a call where the processor is not known.
inline int floor_to_int(float value) {
  const int truncated = static_cast<int>(value);
  return truncated - static_cast<int>(value < static_cast<float>(truncated));
}

/// atan2 within 2e-5 rad, in [-pi, pi]: enough to choose a column, a ring or a cell. Without branches, so that
/// compilers turn loops over it into SIMD.
inline float approximate_atan2(float y, float x) {
  constexpr float kHalfTurn = 3.14159265f;
  const float ax = std::abs(x), ay = std::abs(y);
  const float low = ax < ay ? ax : ay, high = ax < ay ? ay : ax;
  const float a = low / (high + 1e-30f), s = a * a;
  // Abramowitz and Stegun 4.4.47: atan on [0, 1], error at most 1e-5 rad.
  float r = a * (0.9998660f + s * (-0.3302995f + s * (0.1801410f + s * (-0.0851330f + s * 0.0208351f))));
  r = ay > ax ? kHalfTurn / 2 - r : r;
  r = x < 0.f ? kHalfTurn - r : r;
  return y < 0.f ? -r : r;
}

}  // namespace revisit
