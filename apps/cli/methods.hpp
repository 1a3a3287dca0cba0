// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <oneapi/tbb/task_arena.h>

#include <revisit/evaluation/given_pose_table.hpp>
#include <revisit/io/result_files.hpp>
#include <revisit/pipeline/detection_front_end.hpp>
#include <revisit/pipeline/loop_detector.hpp>
#include <revisit/pipeline/place_recognition.hpp>
#include <revisit/pipeline/recent_scans.hpp>
#include <revisit/retrieval/baseline_search.hpp>

#include "reports/comparison.hpp"

namespace revisit::cli {

/// A method of `revisit compare` at work, on one thread: what it answers goes into a folder of its own, in the form of
/// `revisit detect`.
class Method {
 public:
  MethodReport report;  ///< what it cost is added up meanwhile
  std::vector<GivenPose> given_poses;

  /// `raw` as the recording has it; `prepared`: null where the scan describes no place; `recent`: up to it.
  Status answer(const Scan& raw, const PreparedScan* prepared, const RecentScans& recent,
                const TypicalAgreement& typical);
  Status open(const std::filesystem::path& folder, ResultWriter::Existing existing);
  Status finish() { return writer_->finish(); }

 private:
  friend class Methods;
  Status retrieve(const PreparedScan& scan, const RecentScans& recent);
  Status search(const PreparedScan& scan);
  Status recognise(const PreparedScan& scan, const TypicalAgreement& typical);
  Status write(const Detection& detection, const std::optional<CandidateRow>& row);

  // What it is made of: a baseline, and this program's places to verify its answers; either alone; this program's index
  // alone; or a whole detector.
  std::unique_ptr<BaselineSearch> baseline_;
  std::unique_ptr<PlaceRecognition> places_;
  std::unique_ptr<PlaceIndex> index_;
  std::unique_ptr<LoopDetector> detector_;
  std::optional<CandidateRow> row_;  ///< of the baseline
  std::optional<ResultWriter> writer_;
  std::unique_ptr<tbb::task_arena> one_thread_ = std::make_unique<tbb::task_arena>(1);
};

/// Those that are wanted, and what comes before all of them.
class Methods {
 public:
  struct Options {
    std::vector<std::string> wanted;  ///< empty: all
    bool verifies_all = false;        ///< what baselines answer is registered as this program does
  };
  static std::vector<std::string> names();
  Methods(const Options& options, const Parameters& parameters, const IntensityScale& scale);

  /// Gives the scan to each, several at once.
  Status answer(const Scan& scan);
  std::vector<std::unique_ptr<Method>>& all() { return all_; }

 private:
  Method& add(const std::string& name, const std::string& source);

  DetectionFrontEnd front_end_;
  RecentScans recent_{0};
  std::vector<std::unique_ptr<Method>> all_;
};

}  // namespace revisit::cli
