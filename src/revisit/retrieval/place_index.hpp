// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include <revisit/config/parameters.hpp>
#include <revisit/core/loop.hpp>
#include <revisit/descriptors/intensity_scan_context.hpp>

namespace revisit {

/// Every place seen so far, by its descriptor, searched in the paper's two stages (section III-C): geometry over the
/// whole allowed past, then intensity for those of best geometry score.
/// Reading from several threads is safe while nobody adds.
class PlaceIndex {
 public:
  explicit PlaceIndex(const RetrievalOptions& options) : options_(options) {}

  /// Frames and stamps must not decrease; a frame that is already there, or a descriptor of another grid than the
  /// first, throws std::invalid_argument.
  void add(FrameId frame, double stamp_s, IntensityScanContext descriptor);

  /// The best places for a query at `frame` and `stamp_s`, best first by geometry plus intensity score (ties: the
  /// earlier frame). Searched are places at least exclude_frames frames and exclude_s seconds before the query.
  std::vector<LoopCandidate> search(FrameId frame, double stamp_s, const IntensityScanContext& query) const;

  /// The same over all places, whatever their age: a query that is no part of the recording.
  std::vector<LoopCandidate> search_all(const IntensityScanContext& query) const;

  /// Whether any place is old enough for a query at this frame and time.
  bool has_searchable_past(FrameId frame, double stamp_s) const;

  /// The descriptor of a frame, or nullptr; valid until the next add.
  const IntensityScanContext* find(FrameId frame) const;
  std::size_t size() const { return places_.size(); }

 private:
  struct Place {
    FrameId frame;
    double stamp_s;
    IntensityScanContext descriptor;
  };
  std::vector<LoopCandidate> rank(const std::vector<const Place*>& places, const IntensityScanContext& query) const;
  bool may_match(const Place& place, FrameId frame, double stamp_s) const;

  RetrievalOptions options_;
  std::vector<Place> places_;  // by increasing frame
};

}  // namespace revisit
