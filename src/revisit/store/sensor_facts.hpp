// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <optional>

#include <revisit/preprocess/intensity.hpp>
#include <revisit/store/map_store.hpp>
#include <revisit/verification/typical_agreement.hpp>

namespace revisit {

/// What a run learnt about the sensor of a map, for runs that continue it or localise in it.
struct SensorFacts {
  IntensityScale intensity_scale;
  TypicalAgreement typical;
  std::size_t typical_pairs = 0;  ///< of consecutive scans that it was learnt from
};

/// Kept with the next commit.
Status write_sensor_facts(MapStore& store, const SensorFacts& facts);
/// Nothing where the map has none yet.
Result<std::optional<SensorFacts>> read_sensor_facts(const MapStore& store);

}  // namespace revisit
