// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <optional>
#include <string>

#include <revisit/core/result.hpp>
#include <revisit/preprocess/intensity.hpp>
#include <revisit/verification/typical_agreement.hpp>

namespace revisit {

/// What a session learnt about its sensor and its places, for runs that continue it or localise in it.
struct SensorFacts {
  IntensityScale intensity_scale;
  TypicalAgreement typical;
  std::size_t typical_pairs = 0;      ///< of consecutive scans that it was learnt from
  double look_alikes_log_odds = 0.0;  ///< LookAlikes

  void archive(auto& fields) { fields(intensity_scale, typical, typical_pairs, look_alikes_log_odds); }
};

/// As StoredSession::sensor holds them.
std::string to_text(const SensorFacts& facts);
/// Nothing where the text is empty; an error where it is damaged.
Result<std::optional<SensorFacts>> to_sensor_facts(const std::string& text);

}  // namespace revisit
