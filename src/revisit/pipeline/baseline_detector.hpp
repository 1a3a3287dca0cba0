// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include <revisit/core/results.hpp>
#include <revisit/descriptors/baseline.hpp>
#include <revisit/pipeline/prepare.hpp>

namespace revisit {

/// A published descriptor at work on a recording: answers each scan with the place most like it, however little that
/// is, and remembers the scan. Feed frames in increasing order. Belongs to one thread at a time.
class BaselineDetector {
 public:
  explicit BaselineDetector(std::unique_ptr<Baseline> method) : method_(std::move(method)) {}

  /// Places up to `newest_searchable` may answer (Detection has it); none, no answer. Every answer counts as refused:
  /// there is no threshold.
  std::optional<CandidateRow> process(const PreparedScan& scan, const std::optional<FrameId>& newest_searchable);

  const Baseline& method() const { return *method_; }

 private:
  struct Place {
    FrameId frame;
    Baseline::Signature signature;
    Eigen::VectorXf key;
  };
  // The places that are compared, out of the first `searchable`.
  std::vector<std::size_t> shortlist(const Place& query, std::size_t searchable) const;

  std::unique_ptr<Baseline> method_;
  std::vector<Place> places_;
};

}  // namespace revisit
