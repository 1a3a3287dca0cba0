// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <cstdint>

namespace revisit::simulation_internal {

// Randomness by key instead of by order: the same key gives the same number on every processor, in any thread, whoever
// drawn before. Only whole numbers and exactly rounded operations are used.

/// A key scattered over all 64 bits (the finaliser of splitmix64).
inline std::uint64_t mix(std::uint64_t x) {
  x += 0x9e3779b97f4a7c15ULL;
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ULL;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebULL;
  return x ^ (x >> 31);
}
inline std::uint64_t mix(std::uint64_t a, std::uint64_t b) { return mix(a ^ mix(b)); }
inline std::uint64_t mix(std::uint64_t a, std::uint64_t b, std::uint64_t c) { return mix(mix(a, b), c); }

/// A whole number, negative ones too, as a key.
inline std::uint64_t as_key(std::int64_t whole) { return static_cast<std::uint64_t>(whole); }

/// Uniform in [0, 1).
inline float uniform(std::uint64_t key) { return static_cast<float>(mix(key) >> 40) * 0x1p-24f; }

/// Close to the standard normal, within +-3.5: the sum of four uniform numbers, which needs no logarithm.
inline float gaussian(std::uint64_t key) {
  const std::uint64_t bits = mix(key);
  std::uint64_t sum = 0;
  for (int i = 0; i < 4; ++i) sum += (bits >> (16 * i)) & 0xffff;
  return (static_cast<float>(sum) * 0x1p-16f - 2.0f) * 1.7320508f;
}

/// The largest whole number at or below x, for |x| < 1e9; faster than std::floor without SSE4.1.
inline int floor_int(float x) {
  const int truncated = static_cast<int>(x);
  return truncated - (static_cast<float>(truncated) > x ? 1 : 0);
}
inline int floor_int(double x) {
  const int truncated = static_cast<int>(x);
  return truncated - (static_cast<double>(truncated) > x ? 1 : 0);
}

/// Smooth noise in [-1, 1], of period about 1 in x.
inline double smooth_noise(std::uint64_t seed, double x) {
  const double cell = std::floor(x), t = x - cell, s = t * t * (3.0 - 2.0 * t);
  const auto at = [&](double c) {
    return 2.0 * static_cast<double>(uniform(mix(seed, as_key(static_cast<std::int64_t>(c))))) - 1.0;
  };
  return (1.0 - s) * at(cell) + s * at(cell + 1.0);
}
inline double smooth_noise(std::uint64_t seed, double x, double y) {
  const double row = std::floor(y), t = y - row, s = t * t * (3.0 - 2.0 * t);
  const auto at = [&](double r) { return smooth_noise(mix(seed, as_key(static_cast<std::int64_t>(r))), x); };
  return (1.0 - s) * at(row) + s * at(row + 1.0);
}

/// A stream of numbers for building things, one after the other.
class Random {
 public:
  explicit Random(std::uint64_t seed) : key_(mix(seed)) {}
  double uniform(double low = 0.0, double high = 1.0) {
    return low + (high - low) * static_cast<double>(simulation_internal::uniform(next()));
  }
  bool chance(double probability) { return uniform() < probability; }
  int whole(int low, int high) { return low + static_cast<int>(next() % static_cast<std::uint64_t>(high - low + 1)); }
  std::uint64_t next() { return mix(key_++); }

 private:
  std::uint64_t key_;
};

}  // namespace revisit::simulation_internal
