// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <fstream>
#include <string>

#include <revisit/core/result.hpp>
#include <revisit/pipeline/detection.hpp>

namespace revisit::cli {

/// evidence.csv: the measures of every candidate that was registered (docs/formats.md).
class EvidenceFile {
 public:
  /// `goes_on`: rows follow those that are there.
  explicit EvidenceFile(const std::filesystem::path& folder, bool goes_on = false);
  /// By the frames of the recording; candidates of other sessions of a map are left out.
  Status add(const Detection& detection);

 private:
  std::string file_;
  std::ofstream stream_;
};

}  // namespace revisit::cli
