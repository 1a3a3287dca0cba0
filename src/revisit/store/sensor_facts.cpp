// SPDX-License-Identifier: Apache-2.0
#include <revisit/store/sensor_facts.hpp>

#include <cmath>
#include <iomanip>
#include <sstream>

namespace revisit {
namespace {

bool is_share(double value) { return value > 0.0 && value <= 1.0; }

}  // namespace

std::string to_text(const SensorFacts& facts) {
  std::ostringstream text;
  text << std::setprecision(17) << facts.intensity_scale.full_scale << ' ' << facts.intensity_scale.is_reflectance
       << ' ' << facts.typical.in_sight_ratio << ' ' << facts.typical.intensity_correlation << ' '
       << facts.typical_pairs << ' ' << facts.look_alikes_log_odds << ' ' << facts.typical.residual;
  return text.str();
}

Result<std::optional<SensorFacts>> to_sensor_facts(const std::string& text) {
  if (text.empty()) return std::optional<SensorFacts>();
  SensorFacts facts;
  std::istringstream stream(text);
  stream >> facts.intensity_scale.full_scale >> facts.intensity_scale.is_reflectance >> facts.typical.in_sight_ratio >>
      facts.typical.intensity_correlation >> facts.typical_pairs;
  const Error damaged{"what the map knows of the sensor is damaged: '" + text + "'"};
  const double full_scale = facts.intensity_scale.full_scale;
  if (!stream || !(full_scale > 0.0) || !std::isfinite(full_scale) || !is_share(facts.typical.in_sight_ratio) ||
      !is_share(facts.typical.intensity_correlation))
    return damaged;
  if (!(stream >> facts.look_alikes_log_odds)) facts.look_alikes_log_odds = 0.0;  // of a map of version 2
  // Nothing where the map was made before residuals were learnt.
  if (stream >> std::ws; !stream.eof() && !(stream >> facts.typical.residual && facts.typical.residual > 0.0))
    return damaged;
  return std::optional(facts);
}

}  // namespace revisit
