// SPDX-License-Identifier: Apache-2.0
#include <revisit/pipeline/keyframe_fixes.hpp>

#include <algorithm>
#include <cmath>

namespace revisit {
namespace {

constexpr double kLongestGap_s = 1.5, kKept_s = 10.0;  // between fixes; of those of a receiver at work
constexpr double kApart_m = 10.0;

// Between two fixes; none where they are too far apart, across the date line, or no place on Earth.
std::optional<GpsFix> between(const GpsFix& a, const GpsFix& b, double stamp_s) {
  const double gap_s = b.stamp_s - a.stamp_s, share = (stamp_s - a.stamp_s) / gap_s;
  const bool crosses = std::abs(a.longitude_deg - b.longitude_deg) > 180.0;
  if (!(gap_s > 0.0 && gap_s < kLongestGap_s) || crosses) return std::nullopt;
  const auto at = [share](double from, double to) { return from + share * (to - from); };
  GpsFix fix{stamp_s, at(a.latitude_deg, b.latitude_deg), at(a.longitude_deg, b.longitude_deg),
             at(a.altitude_m, b.altitude_m), a.deviation_m.cwiseMax(b.deviation_m)};
  if (!(std::abs(fix.latitude_deg) <= 90.0 && std::abs(fix.longitude_deg) <= 180.0 && std::isfinite(fix.altitude_m)))
    return std::nullopt;
  // Receivers that know nothing of their errors say 0, or infinite.
  constexpr double kLeast_m = 1e-3, kUnknown_m = 5.0, kMost_m = 1e4;
  for (double& each : fix.deviation_m)
    each = std::isfinite(each) && each > 0.0 ? std::clamp(each, kLeast_m, kMost_m) : kUnknown_m;
  return fix;
}

}  // namespace

KeyframeFixes::Waiting KeyframeFixes::add(const GpsFix& fix) {
  if (!fixes_.empty() && fix.stamp_s < fixes_.back().stamp_s - kKept_s) {
    fixes_.clear();
    waiting_.clear();
  }
  if (!fixes_.empty() && fix.stamp_s <= fixes_.back().stamp_s) return {};
  fixes_.push_back(fix);
  while (fixes_.front().stamp_s < fix.stamp_s - kKept_s) fixes_.pop_front();
  return std::exchange(waiting_, {});
}

std::optional<GpsFix> KeyframeFixes::fix_of(FrameId keyframe, double stamp_s, const Eigen::Vector3d& at_m) {
  if (last_at_m_ && (at_m - *last_at_m_).norm() < kApart_m) return std::nullopt;
  const auto after = std::lower_bound(fixes_.begin(), fixes_.end(), stamp_s,
                                      [](const GpsFix& each, double time_s) { return each.stamp_s < time_s; });
  if (after == fixes_.end() && !fixes_.empty() && fixes_.back().stamp_s > stamp_s - kLongestGap_s)
    waiting_.emplace_back(keyframe, stamp_s);
  if (after == fixes_.begin() || after == fixes_.end()) return std::nullopt;
  std::optional<GpsFix> fix = between(*(after - 1), *after, stamp_s);
  if (fix) last_at_m_ = at_m;
  return fix;
}

}  // namespace revisit
