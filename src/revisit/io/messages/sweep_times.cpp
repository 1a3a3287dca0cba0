// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>

#include <revisit/io/internal/sweep_times.hpp>

namespace revisit::io_internal {
namespace {

constexpr double kShortestSweep_s = 1e-3, kLongestSweep_s = 2.0;
constexpr std::array kUnits_s{1.0, 1e-3, 1e-6, 1e-9};
// Counters begin again at 0: 32 bits; an hour in micro- and nanoseconds, and in seconds.
constexpr std::array kRollsOverAt{4294967296.0, 3.6e9, 3.6e12, 3600.0};
constexpr double kMostStragglers = 0.01;  // of the points

struct Span {
  double first = 0.0, last = 0.0;
};

std::optional<double> unit_of(const Span& span) {
  for (const double unit_s : kUnits_s)
    if (const double sweep_s = (span.last - span.first) * unit_s;
        sweep_s >= kShortestSweep_s && sweep_s <= kLongestSweep_s)
      return unit_s;
  return std::nullopt;
}

Span span_of(const std::vector<double>& values) {
  const auto [first, last] = std::minmax_element(values.begin(), values.end());
  return {*first, *last};
}

// The unit, where a counter began again within the sweep; of several that it may be, the one of the shortest sweep.
std::optional<double> roll_on(std::vector<double>& raw, Span& span) {
  std::optional<double> best;
  double shortest_s = kLongestSweep_s;
  std::vector<double> best_values;
  for (const double modulus : kRollsOverAt) {
    if (span.first < 0.0 || span.last >= modulus || span.last - span.first < 0.5 * modulus) continue;
    std::vector<double> rolled = raw;
    for (double& value : rolled) value += value < 0.5 * modulus ? modulus : 0.0;
    const Span here = span_of(rolled);
    const auto unit_s = unit_of(here);
    if (!unit_s || (here.last - here.first) * *unit_s >= shortest_s) continue;
    best = unit_s;
    shortest_s = (here.last - here.first) * *unit_s;
    best_values = std::move(rolled);
  }
  if (!best) return std::nullopt;
  raw = std::move(best_values);
  span = span_of(raw);
  return best;
}

// The unit, once what rolled over goes on and the few that stand alone are brought near. `raw` is finite and not empty.
std::optional<double> settle(std::vector<double>& raw, Span& span) {
  span = span_of(raw);
  if (const auto unit_s = unit_of(span)) return unit_s;
  if (const auto rolled = roll_on(raw, span)) return rolled;
  std::vector<double> sorted = raw;
  std::sort(sorted.begin(), sorted.end());
  const auto outside = static_cast<std::size_t>(0.5 * kMostStragglers * static_cast<double>(sorted.size()));
  const Span most{sorted[outside], sorted[sorted.size() - 1 - outside]};
  const auto unit_s = unit_of(most);
  if (!unit_s) return std::nullopt;
  for (double& value : raw) value = std::clamp(value, most.first, most.last);
  span = most;
  return unit_s;
}

}  // namespace

std::vector<float> to_sweep_times(std::vector<double> raw, const std::optional<double>& stamp_s, PointTimes& times) {
  if (raw.empty() || !std::all_of(raw.begin(), raw.end(), [](double value) { return std::isfinite(value); })) return {};
  Span span;
  const auto unit_s = settle(raw, span);
  if (!unit_s) return {};
  times.unit_s = *unit_s;
  double origin = span.first;  // of the result, in the unit
  times.meaning = PointTimes::Meaning::kFromFirstPoint;
  constexpr double kSameClock_s = 10.0;
  if (stamp_s) {
    if (std::max(std::abs(span.first), std::abs(span.last)) * *unit_s <= kLongestSweep_s) {
      origin = 0.0;
      times.meaning = PointTimes::Meaning::kFromStamp;
    } else if (std::abs(span.first * *unit_s - *stamp_s) < kSameClock_s) {
      origin = *stamp_s / *unit_s;
      times.meaning = PointTimes::Meaning::kAbsolute;
    }
  }
  times.first_s = (span.first - origin) * *unit_s;
  times.last_s = (span.last - origin) * *unit_s;
  std::vector<float> result;
  result.reserve(raw.size());
  for (const double value : raw) result.push_back(static_cast<float>((value - origin) * *unit_s));
  return result;
}

}  // namespace revisit::io_internal
