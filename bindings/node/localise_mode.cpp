// SPDX-License-Identifier: Apache-2.0
#include <utility>
#include <vector>

#include <revisit/mapping/build_map.hpp>
#include <revisit/pipeline/localiser.hpp>
#include <revisit/pipeline/map_grid.hpp>
#include <revisit/store/keyframe_bytes.hpp>

#include "mode.hpp"

namespace revisit::node {
namespace {

class LocaliseMode final : public Mode {
 public:
  LocaliseMode(Settings settings, const Parameters& parameters, Outlet& outlet, LogSink log, Localiser localiser)
      : settings_(std::move(settings)),
        parameters_(parameters),
        outlet_(outlet),
        log_(std::move(log)),
        localiser_(std::move(localiser)) {}

  Status process(Scan scan, const Moment& moment) override {
    const auto found = localiser_.follow(std::move(scan), moment.T_odom_lidar);
    if (!found) return found.error();
    state_ = to_string(found->status) + (found->reason.empty() ? std::string() : ": " + found->reason);
    if (!found->T_map_lidar) return ok();
    if (const auto frame = map_frame_of(settings_, moment, *found->T_map_lidar)) outlet_.send(*frame);
    outlet_.send(MapPose{moment.stamp_ns, settings_.map_frame, *found->T_map_lidar,
                         turned(*found->T_map_lidar, covariance_of(found->information))});
    return ok();
  }
  Status expect(const Pose& T_map_lidar) override {
    localiser_.expect(T_map_lidar);
    return ok();
  }
  Result<std::string> load(const std::string& path) override {
    auto localiser = Localiser::open(path, parameters_, log_);
    if (!localiser) return localiser.error();
    localiser_ = *std::move(localiser);
    state_ = kNothingYet;
    return path + ": " + std::to_string(localiser_.places()) + " places";
  }
  // The points as they are now, of the part in which it is placed.
  Result<std::string> publish() override {
    const Placed placed = keyframes();
    const MapStore& store = *localiser_.map().store();
    const auto points =
        collect_map({placed.poses, [&](std::size_t i) { return read_map_points(store, placed.frames[i]); }},
                    {.voxel_m = parameters_.slam.map_voxel_m});
    if (!points) return points.error();
    outlet_.send(to_map_cloud(settings_, *points));
    return std::to_string(points->size()) + " points";
  }
  Result<MapGrid> grid() override {
    const Placed placed = keyframes();
    return to_map_grid(settings_, grid_of_map(*localiser_.map().store(), placed.frames, placed.poses, {}));
  }
  void set_verification(const Parameters& parameters) override {
    parameters_ = parameters;
    localiser_.set_verification(parameters);
  }
  std::string state() const override { return state_; }

 private:
  struct Placed {
    std::vector<FrameId> frames;
    std::vector<Pose> poses;
  };
  Placed keyframes() const {
    Placed placed;
    for (const StoredMapPose& each : localiser_.map().poses()) {
      if (each.part != 0) continue;
      placed.frames.push_back(each.keyframe);
      placed.poses.push_back(each.T_map_lidar);
    }
    return placed;
  }
  static constexpr const char* kNothingYet = "no scan yet";
  Settings settings_;
  Parameters parameters_;
  Outlet& outlet_;
  LogSink log_;
  Localiser localiser_;
  std::string state_ = kNothingYet;
};

}  // namespace

Result<std::unique_ptr<Mode>> make_localise_mode(const Settings& settings, const Parameters& parameters, Outlet& outlet,
                                                 const LogSink& log) {
  if (settings.map.empty()) return Error{"localise needs the parameter map: what `revisit slam --out` wrote"};
  auto localiser = Localiser::open(settings.map, parameters, log);
  if (!localiser) return localiser.error();
  return std::unique_ptr<Mode>(new LocaliseMode(settings, parameters, outlet, log, *std::move(localiser)));
}

}  // namespace revisit::node
