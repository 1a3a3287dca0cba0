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

/// Where the evidence of a map lies: evidence.csv beside a folder's map.revisit, NAME.evidence.csv beside NAME.revisit.
std::filesystem::path evidence_of_map(const std::filesystem::path& map_file);

/// evidence.csv: the measures of every candidate that was registered (docs/formats.md).
class EvidenceFile {
 public:
  /// Of a recording, by its frames: candidates of other sessions of a map are left out. `last`: rows follow those that
  /// are there of queries up to this one; without, the file begins anew.
  explicit EvidenceFile(const std::filesystem::path& file, std::optional<FrameId> last = std::nullopt);
  /// Of all sessions of a map, by its frames; rows follow those of queries up to `last`.
  static EvidenceFile of_map(const std::filesystem::path& map_file, FrameId last);

  Status add(const Detection& detection);
  /// The rows of another map, whose sessions are numbered from `first_session` on here; none where it has no file.
  Status add_rows_of(const std::filesystem::path& map_file, int first_session);

 private:
  bool is_of_map_ = false;
  std::string file_;
  std::ofstream stream_;
};

}  // namespace revisit::cli
