// SPDX-License-Identifier: Apache-2.0
#include <revisit/pipeline/settle_map.hpp>

#include <algorithm>
#include <optional>
#include <string>
#include <vector>

#include <revisit/mapping/earth_frame.hpp>

namespace revisit {
namespace {

// About the middle one of each coordinate: a fix that is wrong altogether is no origin.
EarthFrame frame_around(const std::vector<StoredFix>& fixes) {
  const auto middle = [&](double GpsFix::*member) {
    std::vector<double> values;
    values.reserve(fixes.size());
    for (const StoredFix& each : fixes) values.push_back(each.fix.*member);
    std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2), values.end());
    return values[values.size() / 2];
  };
  return {middle(&GpsFix::latitude_deg), middle(&GpsFix::longitude_deg), middle(&GpsFix::altitude_m)};
}

}  // namespace

Status settle_map(MapStore& store, KeyframeGraph& graph, const LogSink& log) {
  const auto fixes = store.fixes();
  if (!fixes) return fixes.error();
  const auto ups = store.ups();
  if (!ups) return ups.error();
  if (fixes->empty() && ups->empty()) {
    const Status settled = graph.settle();
    return settled ? store.set_earth({}) : settled;
  }
  std::vector<KeyframeGraph::Up> up_at;
  up_at.reserve(ups->size());
  for (const StoredUp& each : *ups) up_at.push_back({each.keyframe, each.up});
  std::optional<EarthFrame> earth;
  std::vector<KeyframeGraph::Fix> on_earth;
  if (!fixes->empty()) earth.emplace(frame_around(*fixes));
  on_earth.reserve(fixes->size());
  for (const StoredFix& each : *fixes)
    on_earth.push_back({each.keyframe, earth->east_north_up_m(each.fix), each.fix.deviation_m});
  const auto placed = graph.settle_on_earth(on_earth, up_at);
  if (!placed) return placed.error();
  std::vector<StoredEarth> parts;
  for (const auto& [part, T_earth_map] : *placed)
    parts.push_back({part, earth->latitude_deg(), earth->longitude_deg(), earth->altitude_m(), T_earth_map});
  if (earth && parts.empty())
    log_to(log, LogLevel::kWarning,
           "GPS: " + std::to_string(fixes->size()) +
               " fixes do not tell how the map lies on the earth: too few, or too near "
               "to each other");
  return store.set_earth(parts);
}

}  // namespace revisit
