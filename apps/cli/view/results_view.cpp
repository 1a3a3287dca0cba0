// SPDX-License-Identifier: Apache-2.0
#include "view/results_view.hpp"

#include <cstdlib>
#include <utility>

#include <revisit/core/text.hpp>
#include <revisit/mapping/build_map.hpp>
#include <revisit/pipeline/prepare.hpp>
#include <revisit/pipeline/recording_scale.hpp>
#include <revisit/store/keyframe_bytes.hpp>

#include "common.hpp"
#include "reports/evidence_file.hpp"
#include "reports/run_file.hpp"
#include "view/view_data.hpp"

namespace revisit::cli {
namespace fs = std::filesystem;

Result<std::shared_ptr<ResultsView>> ResultsView::open(const fs::path& path) {
  std::shared_ptr<ResultsView> view(new ResultsView);
  std::error_code failure;
  const fs::path map = MapStore::file_of(path);
  view->folder_ = fs::is_directory(path, failure) ? path : path.parent_path();
  if (view->folder_.empty()) view->folder_ = ".";
  view->tiles_ = view->folder_ / "tiles";
  if (fs::is_regular_file(map, failure))
    view->map_file_ = map;
  else if (!fs::exists(view->folder_ / "candidates.csv", failure))
    return Error{path.string() + ": holds no results; name a map, or a folder that `revisit slam` or `detect` wrote"};
  return view;
}

ResultsView::~ResultsView() {
  std::error_code ignored;
  if (!temporary_.empty()) fs::remove_all(temporary_, ignored);
}

bool ResultsView::has_tiles() const {
  std::error_code failure;
  return fs::exists(tiles_ / "tileset.json", failure);
}

Status ResultsView::make_tiles(const std::function<bool(std::size_t, std::size_t)>& progress) {
  const auto map = SavedMap::open(map_file_);
  if (!map) return map.error();
  std::vector<FrameId> frames;
  MapInput input{{}, [&](std::size_t i) { return read_map_points(*map->store(), frames[i]); }, {}};
  for (const auto& keyframe : map->stored().keyframes) {
    const FrameId frame = keyframe.frame.frame;
    if (map->part(frame) != map->part(map->stored().keyframes.front().frame.frame)) continue;  // has other coordinates
    frames.push_back(frame);
    input.T_world_keyframes.push_back(map->T_map_lidar(frame));
    input.sessions.push_back(session_of(frame));
  }
  std::error_code failure;
  std::string name = (fs::temp_directory_path(failure) / "revisit_view_XXXXXX").string();
  if (mkdtemp(name.data()) == nullptr) return Error{name + ": cannot be created"};
  temporary_ = name;
  tiles_ = temporary_ / "tiles";
  const auto report = build_map(input, {.voxel_m = parameters_.slam.map_voxel_m, .formats = {}}, temporary_,
                                [&](std::size_t done) { return progress(done, frames.size()); });
  return report ? ok() : Status(report.error());
}

Result<std::string> ResultsView::json() {
  const std::lock_guard lock(mutex_);
  auto data = has_map() ? read_map_view(map_file_) : read_detect_view(folder_);
  if (!data) return data.error();
  data->title = (has_map() && map_file_.filename() != MapStore::kFileName ? map_file_ : fs::absolute(folder_))
                    .lexically_normal()
                    .string();
  if (const auto run = read_run(folder_ / "run.json"); run && data->input.empty()) data->input = run->input;
  data->has_tiles = has_tiles();
  return to_view_json(*data, folder_, has_map() ? evidence_of_map(map_file_) : folder_ / "evidence.csv");
}

// The one that was worked on, where it is still there.
Result<const Recording*> ResultsView::recording() {
  if (is_recording_forbidden_) return Error{"scans are shown on the machine of the recording only"};
  if (!recording_) {
    const auto run = read_run(folder_ / "run.json");
    if (!run) return run.error();
    auto opened = open_input(run->input, {.topic = run->topic});
    if (!opened) return opened.error();
    auto calibration = load_calibration(run->calibration);
    if (!calibration) return calibration.error();
    recording_ = *std::move(opened);
    parameters_ = run->parameters;
    calibration_ = *calibration;
  }
  return recording_.get();
}

namespace {

Result<Scan> scan_of(const Recording& recording, FrameId frame) {
  for (std::size_t i = 0; i < recording.size(); ++i)
    if (recording.frame(i) == frame) return recording.read(i);
  return Error{to_text(frame) + " is not in the recording"};
}

}  // namespace

Result<std::vector<Point>> ResultsView::points(FrameId frame) {
  const std::lock_guard lock(mutex_);
  if (has_map()) {
    if (!store_) {
      auto store = open_map(map_file_);
      if (!store) return store.error();
      store_ = std::make_shared<const MapStore>(*std::move(store));
    }
    const auto is_there = store_->has(frame);
    if (!is_there) return is_there.error();
    return *is_there ? read_map_points(*store_, frame) : Error{to_text(frame) + " is no key frame of the map"};
  }
  const auto source = recording();
  if (!source) return source.error();
  auto scan = scan_of(**source, frame);
  if (!scan) return scan.error();
  return std::move(scan->points);
}

Result<std::optional<IntensityScanContext>> ResultsView::descriptor(FrameId frame) {
  const std::lock_guard lock(mutex_);
  if (has_map()) {
    const auto store = open_map(map_file_);
    if (!store) return store.error();
    const auto bytes = store->part(frame, MapStore::Part::kDescriptor);
    if (!bytes) return bytes.error();
    if (bytes->empty()) return std::optional<IntensityScanContext>();
    auto descriptor = to_descriptor(*bytes);
    if (!descriptor) return store->damaged("descriptor", frame);
    return descriptor;
  }
  const auto source = recording();
  if (!source) return source.error();
  auto scan = scan_of(**source, frame);
  if (!scan) return scan.error();
  const auto scale = intensity_scale_of(**source, parameters_.intensity);
  if (!scale) return scale.error();
  auto prepared = prepare_scan(*std::move(scan), parameters_, *scale, calibration_);
  if (!prepared) return prepared.error();
  return std::optional(std::move(prepared->descriptor));
}

}  // namespace revisit::cli
