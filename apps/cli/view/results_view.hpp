// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include <revisit/config/parameters.hpp>
#include <revisit/core/intensity_calibration.hpp>
#include <revisit/core/result.hpp>
#include <revisit/core/scan.hpp>
#include <revisit/descriptors/intensity_scan_context.hpp>
#include <revisit/io/recording.hpp>
#include <revisit/localisation/saved_map.hpp>

namespace revisit::cli {

/// What a page shows of a map or of a folder of results (docs/formats.md, "View"). Safe to call from several threads.
class ResultsView {
 public:
  /// `path`: what `revisit slam` or `detect` wrote, or a map alone; it is only read.
  static Result<std::shared_ptr<ResultsView>> open(const std::filesystem::path& path);

  ~ResultsView();
  ResultsView(const ResultsView&) = delete;
  ResultsView& operator=(const ResultsView&) = delete;

  /// view.json, made anew from the files as they are.
  Result<std::string> json();
  /// The points of a key frame, in its LiDAR frame; none where its place was known already. Without a map, of a scan of
  /// the recording that run.json names.
  Result<std::vector<Point>> points(FrameId frame);
  /// Absent where the map keeps none for this frame: its place was known already.
  Result<std::optional<IntensityScanContext>> descriptor(FrameId frame);
  /// Puts the points of a map that has no tiles beside it into a temporary folder, which is gone with this object.
  /// `progress(done, all)` counts key frames and stops the work by returning false. Not beside other calls.
  Status make_tiles(const std::function<bool(std::size_t, std::size_t)>& progress);
  bool has_tiles() const;
  /// Nothing outside the folder is read from here on, not even the recording.
  void forbid_recording() { is_recording_forbidden_ = true; }
  const std::filesystem::path& folder() const { return folder_; }
  const std::filesystem::path& tiles() const { return tiles_; }
  bool has_map() const { return !map_file_.empty(); }
  const std::filesystem::path& map_file() const { return map_file_; }

 private:
  ResultsView() = default;
  Result<const Recording*> recording();

  bool is_recording_forbidden_ = false;
  std::mutex mutex_;
  std::filesystem::path folder_, map_file_, tiles_;
  std::filesystem::path temporary_;        ///< empty where there is none
  std::shared_ptr<const MapStore> store_;  ///< for points and descriptors
  std::unique_ptr<Recording> recording_;
  Parameters parameters_;             ///< of the run, once its recording is open
  IntensityCalibration calibration_;  ///< likewise
};

}  // namespace revisit::cli
