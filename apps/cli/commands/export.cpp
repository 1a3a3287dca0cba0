// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <fstream>
#include <iostream>
#include <map>
#include <memory>
#include <optional>
#include <set>

#include <revisit/core/put_in_place.hpp>
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
Status put_on_earth(const SavedMap& map, const ExportOptions& options, const fs::path& folder, Part& part) {
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
  const fs::path file = folder / "utm.json";
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

Status export_points(const SavedMap& map, const Part& part, const ExportOptions& options, const fs::path& folder,
                     double voxel_m) {
  const MapStore& store = *map.store();
  MapInput input{part.poses,
                 [&](std::size_t i) { return read_map_points(store, part.frames[i], options.after_session); }};
  for (const FrameId frame : part.frames) input.sessions.push_back(session_of(frame));
  MapOptions how{.voxel_m = voxel_m, .formats = {}, .las_offset_m = part.offset_m, .las_epsg = part.epsg};
  if (options.as == "ply" || options.as == "png") how.formats = {CloudFormat::kPly};
  if (options.as == "pcd") how.formats = {CloudFormat::kPcd};
  if (options.as == "las") how.formats = {CloudFormat::kLas};
  Progress progress("export", "key frames", part.frames.size());
  const auto report = build_map(input, how, folder, [&](std::size_t done) {
    progress.update(done);
    return !interrupted();
  });
  if (!report) return report.error();
  std::error_code ignored;
  if (options.as != "tiles") fs::remove_all(folder / "tiles", ignored);
  if (options.as != "png" || interrupted()) return ok();
  const Status drawn = draw_map(folder / "map.png", folder / "map.ply", part.poses);
  fs::remove(folder / "map.ply", ignored);
  return drawn;
}

Status export_grid(const SavedMap& map, const Part& part, const ExportOptions& options, const fs::path& folder) {
  Progress progress("export", "key frames", part.frames.size());
  const auto grid =
      grid_of_map(*map.store(), part.frames, part.poses, options.grid, options.after_session, [&](std::size_t done) {
        progress.update(done);
        return !interrupted();
      });
  return grid ? grid->write(folder / "grid.yaml") : Status(grid.error());
}

// A file a session: every scan of it, in the coordinates of the map.
Status export_trajectories(const SavedMap& map, const Part& part, const fs::path& folder) {
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
    if (const Status status = write_tum_poses(folder / ("session_" + std::to_string(session) + ".tum"), trajectory);
        !status)
      return status;
  return ok();
}

Status export_into(const fs::path& folder, const SavedMap& map, Part part, const ExportOptions& options,
                   double voxel_m) {
  if (options.utm)
    if (const Status placed = put_on_earth(map, options, folder, part); !placed) return placed;
  if (options.as == "grid") return export_grid(map, part, options, folder);
  if (options.as == "tum") return export_trajectories(map, part, folder);
  if (options.as == "g2o") return map.graph().write_g2o(folder / "graph.g2o");
  return export_points(map, part, options, folder, voxel_m);
}

// Written beside what is in the folder already, which stays until all is complete.
Status export_part(const SavedMap& map, const Part& part, const ExportOptions& options, double voxel_m) {
  const fs::path out = options.out, scratch = out / ".export.part";
  std::error_code failure;
  if (options.as == "tiles" && fs::exists(out / "tiles", failure) &&
      !fs::exists(out / "tiles" / "tileset.json", failure) &&
      !fs::exists(out / "tiles" / "tiles.json", failure))  // of earlier versions
    return Error{(out / "tiles").string() + ": is there already and holds no tileset.json; name another folder"};
  const auto remove_all = [](const fs::path* folder) {
    std::error_code ignored;
    fs::remove_all(*folder, ignored);
  };
  remove_all(&scratch);  // what a run that was killed has left
  const std::unique_ptr<const fs::path, decltype(remove_all)> at_the_end(&scratch, remove_all);
  fs::create_directories(scratch, failure);
  if (failure) return Error{scratch.string() + ": cannot be created: " + failure.message()};
  if (const Status written = export_into(scratch, map, part, options, voxel_m); !written) return written;
  if (interrupted()) return Error{"interrupted; nothing was written"};
  std::set<fs::path> names;  // in their order: what names another file comes after it
  for (fs::directory_iterator it(scratch, failure), end; !failure && it != end; it.increment(failure))
    names.insert(it->path().filename());
  if (failure) return Error{scratch.string() + ": cannot be read: " + failure.message()};
  for (const fs::path& name : names)
    if (const Status placed = put_in_place(scratch / name, out / name); !placed) return placed;
  return ok();
}

int run_export(const ExportOptions& options) {
  const auto parameters = options.parameters.resolve();
  if (!parameters) return fail(parameters.error(), kUsage);
  if (options.utm && options.as == "g2o")
    return fail({"--utm: a pose graph has coordinates of its own; export tum instead"}, kUsage);
  const auto map = SavedMap::open(options.map);
  if (!map) return fail(map.error());
  const auto part = find_part(*map, options.part, options.after_session);
  if (!part) return fail({options.map + ": " + part.error().message});
  listen_for_interrupt();
  if (const Status status = export_part(*map, *part, options, parameters->slam.map_voxel_m); !status)
    return fail(status.error(), interrupted() ? kInterrupted : kFailed);
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
