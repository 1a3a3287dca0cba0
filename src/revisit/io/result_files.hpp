// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <vector>

#include <revisit/core/candidate_row.hpp>
#include <revisit/core/localisation_row.hpp>
#include <revisit/core/loop.hpp>
#include <revisit/core/result.hpp>

namespace revisit {

/// Writes candidates.csv and loops.csv row by row; each row is complete and with the system when `add` returns,
/// so that nothing computed is lost. At the end, loops are in the order of their queries. Not for several threads.
class ResultWriter {
 public:
  enum class Existing { kRefuse, kReplace };  ///< results of an earlier run in the folder
  /// Creates `folder` and both files.
  static Result<ResultWriter> create(const std::filesystem::path& folder, Existing existing);
  ResultWriter(ResultWriter&&) noexcept;
  ResultWriter& operator=(ResultWriter&&) noexcept;
  ~ResultWriter();

  Status add(const CandidateRow& row);
  Status add(const LoopConstraint& loop);
  /// What is known by now of a query whose row was added; finish() puts it in that row's place.
  void replace(const CandidateRow& row);
  Status finish();

 private:
  struct Files;
  explicit ResultWriter(std::unique_ptr<Files> files);
  std::unique_ptr<Files> files_;
};

/// Writes localisation.csv row by row, as ResultWriter does. Not for several threads.
class LocalisationWriter {
 public:
  /// Replaces what is there.
  explicit LocalisationWriter(const std::filesystem::path& file);
  LocalisationWriter(LocalisationWriter&&) noexcept;
  ~LocalisationWriter();

  Status add(const LocalisationRow& row);
  Status finish();

 private:
  struct File;
  std::unique_ptr<File> file_;
};

/// Read what ResultWriter, or any other program that follows the format, wrote (docs/formats.md).
Result<std::vector<CandidateRow>> read_candidates(const std::filesystem::path& file);
Result<std::vector<LoopConstraint>> read_loops(const std::filesystem::path& file);
Result<std::vector<LocalisationRow>> read_localisation(const std::filesystem::path& file);

/// Writes `text` (a report, JSON) whole; a failure names the file and the reason.
Status write_text(const std::filesystem::path& file, const std::string& text);

}  // namespace revisit
