// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>

#include <revisit/core/loop.hpp>
#include <revisit/core/refusal.hpp>
#include <revisit/verification/geometric.hpp>
#include <revisit/verification/temporal.hpp>

namespace revisit {

/// "The query shows this place": what was found out about it so far.
struct Hypothesis {
  /// Orders the answers to a query: docs/method.md, section 7.
  double score() const;
  bool is_accepted() const { return geometric && !refusal; }
  /// The log odds of its own evidence, without a prior. It was registered.
  double own_log_odds() const { return geometric->own_log_odds; }
  /// Between query and place. It was registered.
  double distance_m() const { return geometric->T_match_query.translation().norm(); }

  LoopCandidate candidate;
  std::shared_ptr<const ThinCloud> place;
  Pose T_guess_match_query = Pose::Identity();
  double overlap = 0.0;  ///< seen from overhead
  TemporalEvidence temporal;
  std::shared_ptr<const ScanGeometry> geometry;  ///< of the place, where it was registered
  std::optional<GeometricEvidence> geometric;    ///< absent where it was refused before registration
  std::optional<Refusal> refusal;
};

}  // namespace revisit
