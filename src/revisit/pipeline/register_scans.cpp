// SPDX-License-Identifier: Apache-2.0
#include <revisit/pipeline/register_scans.hpp>

#include <revisit/pipeline/place_recognition.hpp>

namespace revisit {

// The target as the only place of a map, and the source as the query.
Result<Registration> register_scans(const Scan& source, const Scan& target, const Parameters& parameters) {
  if (const Status status = validate(parameters); !status) return status.error();
  ScanPreparation preparation(parameters, std::nullopt, {}, {});
  auto place = preparation.prepare(target), query = preparation.prepare(source);
  for (const auto* each : {&place, &query})
    if (!*each) return each->error();
  place->scan.frame = FrameId{0};
  query->scan.frame = FrameId{1};
  PlaceRecognition recognition(parameters, clouds_in_memory());
  if (const Status status = recognition.add(*std::move(place)); !status) return status.error();
  const auto detection = recognition.find(*query, 1, {});
  if (!detection) return detection.error();
  Registration result;
  result.refusal = detection->refusal;
  if (const auto& found = detection->geometric) {
    result.T_target_source = found->T_match_query;
    result.information = found->information;
    result.probability = found->probability;
    result.inlier_ratio = found->evidence.inlier_ratio;
    result.rmse_m = found->evidence.rmse_m;
  }
  return result;
}

}  // namespace revisit
