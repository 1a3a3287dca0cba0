// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <fstream>
#include <iostream>
#include <map>
#include <memory>
#include <optional>
#include <set>

#include <revisit/core/text.hpp>
#include <revisit/io/pose_file.hpp>
#include <revisit/localisation/saved_map.hpp>
#include <revisit/mapping/build_map.hpp>
#include <revisit/pipeline/map_grid.hpp>
#include <revisit/pipeline/map_on_earth.hpp>
#include <revisit/store/keyframe_bytes.hpp>

#include "common.hpp"
#include "pictures/map_picture.hpp"
#include "progress.hpp"

namespace revisit::cli {
namespace {

namespace fs = std::filesystem;

struct ExportOptions {
  std::string map, out, as;
  int part = 0;
  std::optional<int> after_session;
  bool utm = false;
  OccupancyGrid::Options grid;
  ParameterFlags parameters;
};

// The key frames of one part of the map.
struct Part {
  std::vector<FrameId> frames;
  std::vector<Pose> poses;
  Eigen::Vector3d offset_m = Eigen::Vector3d::Zero();  ///< what the poses are to be moved by
  int epsg = 0;                                        ///< of the UTM zone, where they are in one
};

// On the grid of a UTM zone; points have an offset beside them.
Status put_on_earth(const SavedMap& map, const ExportOptions& options, Part& part) {
  const auto on_earth = MapOnEarth::of(*map.store(), options.part);
  if (!on_earth) return on_earth.error();
  if (!*on_earth)
    return Error{options.map +
                 ": does not know where on the earth it is: it was made without --gps, or with too few "
                 "fixes (see info)"};
  const EarthFrame& frame = (*on_earth)->frame();
  for (Pose& T : part.poses) {
    const auto utm = (*on_earth)->to_utm(T);
    if (!utm) return Error{options.map + ": reaches too far out of UTM zone " + frame.utm_zone()};
    T = *utm;
  }
  const bool is_points = options.as != "tum" && options.as != "grid";
  if (is_points) {
    part.offset_m = MapOnEarth::round_offset_m(part.poses.front());
    for (Pose& T : part.poses) T.translation() -= part.offset_m;
  }
  const fs::path file = fs::path(options.out) / "utm.json";
  part.epsg = frame.epsg();
  const bool is_in_file = options.as == "las";
  std::ofstream json(file);
  json << format("{\"epsg\": %d, \"zone\": \"%s\", \"add_to_xyz_m\": [%.1f, %.1f, 0.0]}\n", frame.epsg(),
                 frame.utm_zone().c_str(), is_in_file ? 0.0 : part.offset_m.x(), is_in_file ? 0.0 : part.offset_m.y());
  json.close();
  return json ? ok() : Status(Error{file.string() + ": cannot be written"});
}

Result<Part> find_part(const SavedMap& map, int number, std::optional<int> after_session) {
  Part part;
  std::set<int> others;
  for (const auto& each : map.stored().keyframes) {
    const FrameId frame = each.frame.frame;
    others.insert(map.part(frame));
    if (map.part(frame) != number || (after_session && session_of(frame) > *after_session)) continue;
    part.frames.push_back(frame);
    part.poses.push_back(map.T_map_lidar(frame));
  }
  if (!part.frames.empty()) return part;
  std::string known;
  for (const int each : others) known += " " + std::to_string(each);
  return Error{"the map has no part " + std::to_string(number) + "; it has" + known};
}

Status export_points(const SavedMap& map, const Part& part, const ExportOptions& options, double voxel_m) {
  const MapStore& store = *map.store();
  MapInput input{part.poses,
                 [&](std::size_t i) { return read_map_points(store, part.frames[i], options.after_session); }};
  for (const FrameId frame : part.frames) input.sessions.push_back(session_of(frame));
  MapOptions how{.voxel_m = voxel_m, .formats = {}, .las_offset_m = part.offset_m, .las_epsg = part.epsg};
  if (options.as == "ply" || options.as == "png") how.formats = {CloudFormat::kPly};
  if (options.as == "pcd") how.formats = {CloudFormat::kPcd};
  if (options.as == "las") how.formats = {CloudFormat::kLas};
  // Beside what is in the folder already, which stays.
  const fs::path out = options.out, scratch = out / ".export.part";
  std::error_code failure;
  if (options.as == "tiles" && fs::exists(out / "tiles", failure) &&
      !fs::exists(out / "tiles" / "tileset.json", failure) &&
      !fs::exists(out / "tiles" / "tiles.json", failure))  // of earlier versions
    return Error{(out / "tiles").string() + ": is there already and holds no tileset.json; name another folder"};
  fs::create_directories(scratch, failure);
  if (failure) return Error{scratch.string() + ": cannot be created: " + failure.message()};
  Progress progress("export", "key frames", part.frames.size());
  const auto report = build_map(input, how, scratch, [&](std::size_t done) {
    progress.update(done);
    return !interrupted();
  });
  Status status = report ? ok() : Status(report.error());
  if (status && interrupted()) status = Error{"interrupted; nothing was written"};
  if (status && options.as == "png") status = draw_map(scratch / "map.png", scratch / "map.ply", part.poses);
  if (status) {
    const std::string name = options.as == "tiles" ? "tiles" : "map." + options.as;
    if (options.as == "tiles") fs::remove_all(out / name, failure);
    fs::rename(scratch / name, out / name, failure);
    if (failure) status = Error{(out / name).string() + ": cannot be written: " + failure.message()};
  }
  std::error_code ignored;
  fs::remove_all(scratch, ignored);
  return status;
}

Status export_grid(const SavedMap& map, const Part& part, const ExportOptions& options) {
  Progress progress("export", "key frames", part.frames.size());
  const auto grid =
      grid_of_map(*map.store(), part.frames, part.poses, options.grid, options.after_session, [&](std::size_t done) {
        progress.update(done);
        return !interrupted();
      });
  return grid ? grid->write(fs::path(options.out) / "grid.yaml") : Status(grid.error());
}

// A file a session: every scan of it, in the coordinates of the map.
Status export_trajectories(const SavedMap& map, const Part& part, const ExportOptions& options) {
  std::map<FrameId, Pose> T_out_keyframe;
  for (std::size_t i = 0; i < part.frames.size(); ++i) T_out_keyframe[part.frames[i]] = part.poses[i];
  const auto scans = map.store()->scans();
  if (!scans) return scans.error();
  std::map<int, Trajectory> sessions;
  for (const StoredScan& scan : *scans)
    if (const auto T = T_out_keyframe.find(scan.keyframe); T != T_out_keyframe.end())
      sessions[session_of(scan.frame)].entries[in_recording(scan.frame)] = {scan.stamp_s,
                                                                            T->second * scan.T_keyframe_lidar};
  for (const auto& [session, trajectory] : sessions)
    if (const Status status =
            write_tum_poses(fs::path(options.out) / ("session_" + std::to_string(session) + ".tum"), trajectory);
        !status)
      return status;
  return ok();
}

int run_export(const ExportOptions& options) {
  const auto parameters = options.parameters.resolve();
  if (!parameters) return fail(parameters.error(), kUsage);
  const auto map = SavedMap::open(options.map);
  if (!map) return fail(map.error());
  auto part = find_part(*map, options.part, options.after_session);
  if (!part) return fail({options.map + ": " + part.error().message});
  std::error_code failure;
  fs::create_directories(options.out, failure);
  if (failure) return fail({options.out + ": cannot be created: " + failure.message()});
  if (options.utm && options.as == "g2o")
    return fail({"--utm: a pose graph has coordinates of its own; export tum instead"}, kUsage);
  if (options.utm)
    if (const Status placed = put_on_earth(*map, options, *part); !placed) return fail(placed.error());
  listen_for_interrupt();
  const Status status = options.as == "grid"  ? export_grid(*map, *part, options)
                        : options.as == "tum" ? export_trajectories(*map, *part, options)
                        : options.as == "g2o" ? map->graph().write_g2o(fs::path(options.out) / "graph.g2o")
                                              : export_points(*map, *part, options, parameters->slam.map_voxel_m);
  if (!status) return fail(status.error(), interrupted() ? kInterrupted : kFailed);
  std::cout << part->frames.size() << " key frames as " << options.as << ": " << options.out << '\n';
  return kDone;
}

}  // namespace

Run add_export(CLI::App& program) {
  auto options = std::make_shared<ExportOptions>();
  CLI::App* command = program.add_subcommand("export", "Write a map in a form that other programs read.");
  command->footer(
      "  ply, pcd, las  the points: map.ply, map.pcd, map.las\n"
      "  png            a picture of the map from above\n"
      "  tiles          the points for viewers that stream: OGC 3D Tiles 1.1 with levels of detail, "
      "tiles/tileset.json\n"
      "  grid           grid.pgm and grid.yaml: what is free, occupied and unknown, for navigation in two dimensions\n"
      "  tum            the trajectory of each session: session_0.tum, ...\n"
      "  g2o            the pose graph of all sessions: graph.g2o\n\n"
      "Example: revisit export maps/00 --as grid --out nav");
  command->add_option("map", options->map, "Map: the file, or the folder of `revisit slam --out`")->required();
  command->add_option("--as", options->as, "Form")
      ->required()
      ->check(CLI::IsMember({"ply", "pcd", "las", "png", "tiles", "grid", "tum", "g2o"}));
  command->add_option("--out", options->out, "Folder for the files")->required();
  command->add_option("--part", options->part, "Of a map whose sessions are not all joined: which part (see info)");
  command->add_option(
      "--after-session", options->after_session,
      "Points and grid as the map was after this session: with what was gone later, and without what was "
      "new (default: as it is now)");
  command->add_flag("--utm", options->utm,
                    "Of a map made with --gps: in the UTM zone that it lies in, heights above the ellipsoid; utm.json "
                    "names the zone, and what is to be added to the points of ply, pcd and tiles");
  command->add_option("--cell", options->grid.cell_m, "grid: edge of a cell, m")->check(CLI::Range(0.02, 5.0));
  command->add_option("--clearance", options->grid.clearance_m, "grid: what is lower is driven over, m")
      ->check(CLI::Range(0.0, 2.0));
  command->add_option("--height", options->grid.height_m, "grid: what is higher is driven under, m")
      ->check(CLI::Range(0.1, 20.0));
  options->parameters.add_to(*command, {"slam"});
  return [options] { return run_export(*options); };
}

}  // namespace revisit::cli
