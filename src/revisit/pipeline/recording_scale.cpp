// SPDX-License-Identifier: Apache-2.0
#include <revisit/pipeline/recording_scale.hpp>

#include <algorithm>

namespace revisit {

Result<IntensityScale> intensity_scale_of(const Recording& recording, const IntensityOptions& options) {
  IntensityScaleLearner learner(options);
  std::optional<Error> first_error;
  bool found = false;
  const std::size_t count = std::min(IntensityScaleLearner::kScans, recording.size());
  // The first readable scan of each tenth of the recording: broken ones must not decide.
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t begin = i * recording.size() / count, end = (i + 1) * recording.size() / count;
    for (std::size_t index = begin; index < end; ++index) {
      const auto scan = recording.read(index);
      if (scan) {
        learner.add(*scan);
        found = true;
        break;
      }
      if (!first_error) first_error = scan.error();
    }
  }
  if (!found) return first_error.value_or(Error{"the recording holds no scan"});
  return learner.scale();
}

}  // namespace revisit
