// SPDX-License-Identifier: Apache-2.0
#include <filesystem>
#include <utility>
#include <vector>

#include <revisit/core/stamps.hpp>
#include <revisit/pipeline/map_grid.hpp>
#include <revisit/pipeline/slam.hpp>

#include "mode.hpp"

namespace revisit::node {
namespace {

class SlamMode final : public Mode {
 public:
  SlamMode(Settings settings, Outlet& outlet, Slam slam)
      : settings_(std::move(settings)), outlet_(outlet), slam_(std::move(slam)) {
    if (slam_.last_frame()) first_ = FrameId{slam_.last_frame()->value + 1};
    const auto earlier = slam_.store().scans();
    if (!earlier) return;  // then process() says so
    for (const StoredScan& scan : *earlier)
      if (session_of(scan.frame) == slam_.session())
        stamps_ns_[in_recording(scan.frame)] = to_nanoseconds(scan.stamp_s);
  }

  Status process(Scan scan, const Moment& moment) override {
    scan.frame = FrameId{scan.frame.value + first_.value};
    stamps_ns_[scan.frame] = moment.stamp_ns;
    const auto step = slam_.process(std::move(scan), moment.T_odom_lidar);
    if (!step) {
      if (slam_.has_failed()) return Error{step.error().message + "; the map is what was committed before"};
      return step.error();
    }
    if (const auto frame = map_frame_of(settings_, moment, step->T_world_lidar)) outlet_.send(*frame);
    outlet_.send(
        MapPose{moment.stamp_ns, settings_.map_frame, step->T_world_lidar, Eigen::Matrix<double, 6, 6>::Zero()});
    if (step->detection && step->detection->loop) {
      const LoopConstraint& loop = *step->detection->loop;
      const auto stamp = stamps_ns_.find(in_recording(loop.match));
      outlet_.send(message_of(loop, moment, stamp != stamps_ns_.end() ? stamp->second : 0));
    }
    loops_ += step->loops_entered;
    constexpr int kKeyframesAPath = 10;
    if (step->is_keyframe && (step->loops_entered > 0 || ++keyframes_ % kKeyframesAPath == 0)) send_graph();
    return ok();
  }

  Status add(const revisit::GpsFix& fix) override { return slam_.add(fix); }
  Result<std::string> save(const std::string& folder) override {
    const std::string& into = settings_.map.empty() ? folder : settings_.map;
    if (into.empty()) return Error{"no folder: set the parameter map before the node starts"};
    if (!folder.empty() && folder != into)
      return Error{folder + ": the map is kept in " + into + ", where it was begun; copy it, or `revisit export` it"};
    if (const Status finished = slam_.finish(); !finished) return finished.error();
    send_graph();
    const auto report = slam_.write_map(into);
    if (!report) return report.error();
    return into + ": " + std::to_string(report->points) + " points" +
           (settings_.map.empty() ? "; the points alone: set the parameter map before the node starts to keep a map"
                                  : "");
  }
  Result<std::string> publish() override {
    auto points = slam_.map();
    if (!points) return points.error();
    outlet_.send(to_map_cloud(settings_, *points));
    send_graph();
    return std::to_string(points->size()) + " points";
  }
  Result<MapGrid> grid() override {
    const KeyframeGraph& graph = slam_.graph();
    std::vector<FrameId> frames;
    std::vector<Pose> poses;
    for (const FrameId frame : graph.keyframes())
      if (graph.part(frame) == graph.part(graph.keyframes().back())) {  // where the robot is
        frames.push_back(frame);
        poses.push_back(graph.T_world_lidar(frame));
      }
    return to_map_grid(settings_, grid_of_map(slam_.store(), frames, poses, {}));
  }
  Status finish() override {
    const Status finished = slam_.finish();
    send_graph();
    return finished;
  }
  void set_verification(const Parameters& parameters) override { slam_.set_verification(parameters); }
  std::string state() const override {
    return std::to_string(slam_.graph().keyframes().size()) + " key frames, " + std::to_string(loops_) + " loops";
  }

 private:
  void send_graph() {
    const KeyframeGraph& graph = slam_.graph();
    Graph message{settings_.map_frame, {}, {}};
    for (const FrameId frame : graph.keyframes()) {
      const auto stamp = stamps_ns_.find(in_recording(frame));
      message.path.emplace_back(stamp != stamps_ns_.end() ? stamp->second : 0, graph.T_world_lidar(frame));
    }
    for (const PoseEdge& edge : graph.graph().edges())
      if (edge.is_loop && edge.weight > 0.5) message.loops.emplace_back(edge.from, edge.to);
    outlet_.send(message);
  }

  Settings settings_;
  Outlet& outlet_;
  Slam slam_;
  FrameId first_{0};
  std::map<FrameId, std::int64_t> stamps_ns_;
  std::size_t loops_ = 0;
  int keyframes_ = 0;
};

// A start that saw no scan leaves an empty map.
bool holds_places(const std::string& folder) {
  std::error_code failure;
  const auto file = MapStore::file_of(folder);
  if (!std::filesystem::exists(file, failure)) return false;
  const auto map = MapStore::open(file, MapStore::Access::kRead);
  const auto keyframes = map ? map->keyframes() : Result<std::vector<StoredKeyframe>>(map.error());
  return !keyframes || !keyframes->empty();
}

}  // namespace

Result<std::unique_ptr<Mode>> make_slam_mode(const Settings& settings, const Parameters& parameters, Outlet& outlet,
                                             const LogSink& log) {
  SlamSetup setup;
  setup.log = log;
  if (settings.map.empty()) return std::unique_ptr<Mode>(new SlamMode(settings, outlet, Slam(parameters, setup)));
  std::error_code failure;
  if (!settings.resume && holds_places(settings.map))
    return Error{settings.map + ": holds a map already; set resume to continue it, or name another folder"};
  std::filesystem::create_directories(settings.map, failure);
  auto slam = Slam::open(settings.map, parameters, setup);
  if (!slam) return slam.error();
  return std::unique_ptr<Mode>(new SlamMode(settings, outlet, *std::move(slam)));
}

}  // namespace revisit::node
