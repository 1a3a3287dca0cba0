// SPDX-License-Identifier: Apache-2.0
#include "commands/slam_inputs.hpp"

#include <filesystem>
#include <tuple>
#include <utility>
#include <vector>

#include <revisit/core/text.hpp>
#include <revisit/io/nmea_file.hpp>
#include <revisit/io/pose_file.hpp>

namespace revisit::cli {
namespace {

namespace fs = std::filesystem;

// Of --into: a session that was killed before its first checkpoint left nothing to go on with.
Result<bool> begins_session(const MapStore& store, const SlamOptions& options, const std::string& recording) {
  if (options.into.empty() || !options.resume) return !options.into.empty();
  const auto sessions = store.sessions();
  if (!sessions) return sessions.error();
  return sessions->empty() || sessions->back().recording != recording;
}

// A session is not continued with another recording.
Status check_session(const MapStore& store, const std::string& recording, const std::string& parameters) {
  const auto sessions = store.sessions();
  if (!sessions) return sessions.error();
  if (sessions->empty()) return ok();
  const StoredSession& last = sessions->back();
  for (const auto& [what, was, is] :
       {std::tuple{"the recording", &last.recording, &recording}, {"the parameters", &last.parameters, &parameters}})
    if (*was != *is) return Error{store.file() + ": was made with " + what + " '" + *was + "', not '" + *is + "'"};
  return ok();
}

// What must stay as it was when the map was begun.
std::string parameters_text(const Parameters& parameters, const SlamOptions& options) {
  std::string text = "odometry=" + options.odometry + " wheels=" + options.wheels +
                     " calibration=" + options.calibration + " sweep=" + std::to_string(options.sweep_s) +
                     options.recording.text();
  for (const ParameterInfo& info : parameter_infos())
    if (info.name.starts_with("preprocess.") || info.name.starts_with("intensity.") ||
        info.name.starts_with("descriptor."))
      text += " " + info.name + "=" + get_parameter(parameters, info.name);
  return text;
}

Result<std::shared_ptr<MapStore>> shared(Result<MapStore> store) {
  if (!store) return store.error();
  return std::make_shared<MapStore>(*std::move(store));
}

}  // namespace

Result<OtherOdometry> other_odometry(const SlamOptions& options, const Recording& recording) {
  const std::string& file = options.odometry.empty() ? options.wheels : options.odometry;
  if (file == "none") return OtherOdometry([](std::size_t) { return std::nullopt; });
  if (file == "wheels" && !recording.has_wheel_odometry()) return Error{options.input + ": has no wheel odometry"};
  if (file.empty() || file == "wheels")
    return OtherOdometry([&recording](std::size_t index) { return recording.wheel_pose(index); });
  const auto poses = read_poses(file);
  if (!poses) return poses.error();
  auto trajectory = to_trajectory(*poses, recording.T_camera_lidar(), stamps_of(recording));
  if (trajectory.empty()) return Error{file + ": no pose belongs to a frame of the recording"};
  return OtherOdometry([&recording, poses_of = std::move(trajectory)](std::size_t index) {
    return poses_of.at(recording.frame(index));
  });
}

Result<std::vector<GpsFix>> gps_fixes(const SlamOptions& options, const Recording& recording) {
  if (!options.gps) return std::vector<GpsFix>();
  std::error_code failure;
  const bool is_file = fs::is_regular_file(*options.gps, failure);
  auto fixes = is_file ? read_nmea(*options.gps) : recording.gps_fixes(*options.gps);
  if (!fixes) return fixes.error();
  const std::string what = is_file ? *options.gps : options.input;
  if (fixes->empty()) return Error{what + ": holds no GPS fix; name an NMEA log, or a topic of NavSatFix"};
  const double first_s = recording.stamp_s(0), last_s = recording.stamp_s(recording.size() - 1);
  if (fixes->back().stamp_s < first_s || fixes->front().stamp_s > last_s)
    return Error{what +
                 format(": its fixes are of %.1f to %.1f s, the scans of %.1f to %.1f s", fixes->front().stamp_s,
                        fixes->back().stamp_s, first_s, last_s) +
                 ": one of the clocks must be set to the other"};
  return fixes;
}

Result<std::shared_ptr<MapStore>> open_store(const SlamOptions& options) {
  std::error_code failure;
  fs::create_directories(options.out, failure);
  if (failure) return Error{options.out + ": cannot be created: " + failure.message()};
  if (!options.into.empty()) {
    const fs::path map = MapStore::file_of(options.into);
    if (!fs::exists(map, failure))
      return Error{map.string() + ": no such map; `revisit slam` without --into makes one"};
    return shared(MapStore::open(map));
  }
  const fs::path file = MapStore::file_of(options.out);
  const bool exists = fs::exists(file, failure);
  if (exists && options.overwrite && !options.resume) {
    if (const Status removed = MapStore::remove_file(file); !removed) return removed.error();
  } else if (exists && !options.resume) {
    return Error{options.out +
                 ": already holds a map; continue it with --resume, replace it with --overwrite, or name another "
                 "folder"};
  }
  return shared(fs::exists(file, failure) ? MapStore::open(file)
                                          : MapStore::create(fs::path(options.out) / MapStore::kFileName));
}

Result<SlamSetup> slam_setup(const SlamOptions& options, const Parameters& parameters, const IntensityScale& scale,
                             const IntensityCalibration& calibration, std::vector<GpsFix> gps,
                             const std::string& recording_name, const MapStore& store) {
  const auto is_new = begins_session(store, options, recording_name);
  if (!is_new) return is_new.error();
  SlamSetup setup{scale,
                  calibration,
                  options.odometry.empty() ? Odometry::Source::kLidar : Odometry::Source::kExternal,
                  print_log(),
                  std::move(gps),
                  *is_new,
                  recording_name,
                  parameters_text(parameters, options),
                  options.checkpoint_s};
  if (!setup.new_session)
    if (const Status status = check_session(store, setup.recording, setup.parameters); !status) return status.error();
  return setup;
}

}  // namespace revisit::cli
