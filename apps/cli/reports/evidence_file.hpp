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
  /// Of a recording, by its frames: candidates of other sessions of a map are left out. `last`: rows follow those that
  /// are there of queries up to this one; without, the file begins anew.
  explicit EvidenceFile(const std::filesystem::path& folder, std::optional<FrameId> last = std::nullopt);
  /// Of all sessions of the map in `folder`, by the frames of the map; rows follow those of queries up to `last`.
  static EvidenceFile of_map(const std::filesystem::path& folder, FrameId last);

  Status add(const Detection& detection);

 private:
  bool is_of_map_ = false;
  std::string file_;
  std::ofstream stream_;
};

}  // namespace revisit::cli
