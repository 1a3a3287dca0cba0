// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>
#include <vector>

#include <revisit/verification/candidate_registration.hpp>

namespace revisit {

/// Which of the candidates of one query is its place, if any: docs/method.md, section 7. Lives as long as the query and
/// the context. A hypothesis is accepted or refused by decide() (acceptance.hpp); here the best one is chosen.
class LoopVerification {
 public:
  LoopVerification(const VerificationContext& context, const VerificationQuery& query)
      : context_(context), query_(query), registration_(context_, query_) {}

  /// The best hypothesis, accepted or not; none where there are no candidates. An error where a place cannot be read.
  Result<std::optional<Hypothesis>> verify(std::span<const LoopCandidate> candidates);
  /// The same for a query that was refused when it came, and that a later loop leads back to (BackwardFollowing): the
  /// place predicted is tested, against the poses that were registered then. None where no loop reaches it.
  Result<std::optional<Hypothesis>> verify_again(std::span<const RegisteredPose> registered);
  /// The same for a scan that is prepared anew, registered where it fitted best before or nearly so, and nowhere else;
  /// `before` is what was tested then. None where nothing was registered.
  Result<std::optional<Hypothesis>> verify_there(std::span<const Hypothesis> before);
  /// Everything that was tested.
  const std::vector<Hypothesis>& hypotheses() const { return hypotheses_; }
  /// Whether a scan alone was registered with places that fit less well from overhead, too.
  bool has_tried_further() const { return tried_further_; }
  CandidateRegistration& registration() { return registration_; }

 private:
  Result<std::optional<Hypothesis>> test_predicted_place();
  Result<std::optional<Hypothesis>> best_of_tested();
  Status test_nearer_place(Hypothesis& answer);
  void trust_what_stands_out();
  void weigh_against_each_other();
  bool exclude_each_other(const Hypothesis& a, const Hypothesis& b) const;
  bool is_sufficient(const Hypothesis& predicted) const;

  const VerificationContext& context_;
  const VerificationQuery& query_;
  CandidateRegistration registration_;
  std::vector<Hypothesis> hypotheses_;
  bool tried_further_ = false;
};

}  // namespace revisit
