// SPDX-License-Identifier: Apache-2.0
#include <revisit/store/sensor_facts.hpp>

#include <cmath>
#include <iomanip>
#include <sstream>

namespace revisit {
namespace {

constexpr const char* kNote = "sensor";

bool is_share(double value) { return value > 0.0 && value <= 1.0; }

}  // namespace

Status write_sensor_facts(MapStore& store, const SensorFacts& facts) {
  std::ostringstream text;
  text << std::setprecision(17) << facts.intensity_scale.full_scale << ' ' << facts.intensity_scale.is_reflectance
       << ' ' << facts.typical.inlier_ratio << ' ' << facts.typical.intensity_correlation << ' ' << facts.typical_pairs;
  return store.set_note(kNote, text.str());
}

Result<std::optional<SensorFacts>> read_sensor_facts(const MapStore& store) {
  const auto note = store.note(kNote);
  if (!note) return note.error();
  if (!*note) return std::optional<SensorFacts>();
  SensorFacts facts;
  std::istringstream text(**note);
  text >> facts.intensity_scale.full_scale >> facts.intensity_scale.is_reflectance >> facts.typical.inlier_ratio >>
      facts.typical.intensity_correlation >> facts.typical_pairs;
  const double full_scale = facts.intensity_scale.full_scale;
  if (!text || !(full_scale > 0.0) || !std::isfinite(full_scale) || !is_share(facts.typical.inlier_ratio) ||
      !is_share(facts.typical.intensity_correlation))
    return Error{"the map's note '" + std::string(kNote) + "' is damaged: '" + **note + "'"};
  return std::optional(facts);
}

}  // namespace revisit
