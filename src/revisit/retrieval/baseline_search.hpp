// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <deque>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include <revisit/core/candidate_row.hpp>
#include <revisit/core/exclusion.hpp>
#include <revisit/core/scan.hpp>
#include <revisit/descriptors/baseline.hpp>

namespace revisit {

/// Places by a published descriptor: answers each scan with the place most like it, however little that is (but
/// with none where all have nothing in common with it), and adds the scan. Frames increase.
/// Belongs to one thread at a time.
class BaselineSearch {
 public:
  BaselineSearch(std::unique_ptr<Baseline> method, const ExclusionRule& exclusion)
      : method_(std::move(method)), index_(method_->make_index()), exclusion_(exclusion) {}

  /// `points`: prepared, as Baseline::describe() takes them. None where no place is old enough. Every answer counts as
  /// refused: there is no threshold.
  struct Answer {
    CandidateRow row;
    Pose T_match_query = Pose::Identity();  ///< as far as the method gives it
  };
  std::optional<Answer> process(const FrameTime& query, std::span<const Point> points, double ground_z_m);

  /// How like the place of an earlier frame the last scan is; nothing where that frame is no place.
  std::optional<double> similarity_to(FrameId frame) const;

  const Baseline& method() const { return *method_; }
  /// What the method keeps, in the mean.
  std::size_t bytes_a_place() const {
    return places_.empty() ? 0 : (bytes_ + (index_ ? index_->bytes() : 0)) / places_.size();
  }

 private:
  struct Place {
    FrameTime frame;  ///< with the latest stamp until here
    Baseline::Signature signature;
    Eigen::VectorXf key;
  };
  /// The places that are compared, out of the first `searchable`.
  std::vector<std::size_t> shortlist(const Place& query, std::size_t searchable) const;
  Answer answer(const Place& query, std::size_t searchable) const;

  std::unique_ptr<Baseline> method_;
  std::unique_ptr<BaselineIndex> index_;  ///< null: places are compared by their keys, or all of them
  ExclusionRule exclusion_;
  std::deque<Place> places_;
  Baseline::Signature last_;  ///< the whole signature of the last scan
  std::size_t bytes_ = 0;     ///< of all signatures and keys
};

}  // namespace revisit
