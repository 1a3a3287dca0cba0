// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <fstream>
#include <optional>
#include <string>

#include <revisit/core/ids.hpp>
#include <revisit/core/result.hpp>
#include <revisit/pipeline/detection.hpp>

namespace revisit::cli {

/// evidence.csv: the measures of every candidate that was registered (docs/formats.md).
class EvidenceFile {
 public:
  /// `last`: rows follow those that are there of queries up to this one; without, the file begins anew.
  explicit EvidenceFile(const std::filesystem::path& folder, std::optional<FrameId> last = std::nullopt);
  /// By the frames of the recording; candidates of other sessions of a map are left out.
  Status add(const Detection& detection);

 private:
  std::string file_;
  std::ofstream stream_;
};

}  // namespace revisit::cli
