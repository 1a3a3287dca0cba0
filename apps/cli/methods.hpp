// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <oneapi/tbb/task_arena.h>

#include <revisit/evaluation/given_pose_table.hpp>
#include <revisit/evaluation/pair_table.hpp>
#include <revisit/io/result_files.hpp>
#include <revisit/pipeline/detection_front_end.hpp>
#include <revisit/pipeline/loop_detector.hpp>
#include <revisit/pipeline/place_recognition.hpp>
#include <revisit/pipeline/recent_scans.hpp>
#include <revisit/retrieval/baseline_search.hpp>
#include <revisit/simulation/simulated_recording.hpp>
#include <revisit/vision/visual_words.hpp>

#include "reports/comparison.hpp"

namespace revisit::cli {

/// A method of `revisit compare` at work, on one thread: what it answers goes into a folder of its own, in the form of
/// `revisit detect`.
class Method {
 public:
  MethodReport report;  ///< what it cost is added up meanwhile
  std::vector<GivenPose> given_poses;
  std::vector<ScoredPair> pairs;  ///< of `wanted_pairs`
  const PairLists* wanted_pairs = nullptr;

  /// Of a method that looks at images.
  Status answer(const FrameTime& frame, const Image& image);
  /// A scan as the recording has it and as it was prepared, with the last ones laid together, by how many.
  struct Query {
    const Scan& raw;
    const PreparedScan* prepared;  ///< null where the scan describes no place
    const std::map<std::size_t, std::vector<Point>>& together;
    const TypicalAgreement& typical;
  };
  Status answer(const Query& query);
  Status open(const std::filesystem::path& folder, ResultWriter::Existing existing);
  Status finish() { return writer_->finish(); }

 private:
  friend class Methods;
  Status retrieve(const Query& query);
  Status search(const PreparedScan& scan);
  void score_pairs(const Query& query);
  std::optional<double> similarity_to(FrameId frame, const PreparedScan& scan) const;
  Status recognise(const PreparedScan& scan, const TypicalAgreement& typical);
  Status write(const Detection& detection, const std::optional<CandidateRow>& row);

  // What it is made of: a baseline, and this program's places to verify its answers; either alone; this program's index
  // alone; a whole detector; or words of images.
  std::unique_ptr<BaselineSearch> baseline_;
  std::unique_ptr<PlaceRecognition> places_;
  std::unique_ptr<PlaceIndex> index_;
  std::unique_ptr<LoopDetector> detector_;
  std::unique_ptr<VisualWords> words_;
  std::optional<CandidateRow> row_;                      ///< of the baseline
  std::map<FrameId, IntensityScanContext> descriptors_;  ///< of this program's index, where pairs are compared
  std::optional<ResultWriter> writer_;
  std::unique_ptr<tbb::task_arena> one_thread_ = std::make_unique<tbb::task_arena>(1);
};

/// The published methods: make_baselines(), and those that need OpenCV.
std::vector<std::unique_ptr<Baseline>> all_baselines();

/// Words from images of another drive through another world of the same kind, by day and by night.
Result<std::shared_ptr<const Vocabulary>> vocabulary_beside(const SimulatedRecording& recording);

/// Those that are wanted, and what comes before all of them.
class Methods {
 public:
  struct Options {
    std::vector<std::string> wanted;  ///< empty: all
    bool wants(const std::string& name) const;
    bool verifies_all = false;  ///< what baselines answer is registered as this program does
    /// Of vision_names(): whose camera they look through, which must outlive this, and their words; null: without them.
    const SimulatedRecording* camera = nullptr;
    std::shared_ptr<const Vocabulary> vocabulary = nullptr;
    const PairLists* pairs = nullptr;       ///< which the methods score beside their answers; must outlive this
    std::vector<std::string> plugins = {};  ///< methods from shared libraries (load_baseline()), wanted all of them
  };
  static std::vector<std::string> names();
  static std::vector<std::string> vision_names();  ///< only where they are wanted by name
  /// An error where a shared library is no method.
  static Result<std::unique_ptr<Methods>> make(const Options& options, const Parameters& parameters,
                                               const IntensityScale& scale);

  /// Gives the scan, number `index` of the recording, to each, several at once.
  Status answer(const Scan& scan, std::size_t index);
  std::vector<std::unique_ptr<Method>>& all() { return all_; }

 private:
  Methods(const Options& options, const Parameters& parameters, const IntensityScale& scale,
          std::vector<std::unique_ptr<Baseline>> baselines);
  Method& add(const std::string& name, const std::string& source);
  void add_vision(const Options& options, const ExclusionRule& exclusion);
  Status look(const FrameTime& frame, std::size_t index);

  DetectionFrontEnd front_end_;
  RecentScans recent_{0};
  std::map<std::size_t, std::vector<Point>> together_;  ///< the last scans, by how many: of the scan at hand
  const SimulatedRecording* camera_ = nullptr;
  struct Look {
    Method* method;
    bool by_night_first, by_night_then;  ///< in the first half of the drive, and in the second
  };
  std::vector<Look> looks_;
  std::vector<std::unique_ptr<Method>> all_;
};

}  // namespace revisit::cli
