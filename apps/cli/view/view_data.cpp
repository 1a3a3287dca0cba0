// SPDX-License-Identifier: Apache-2.0
#include "view/view_data.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <iterator>
#include <set>
#include <sstream>
#include <utility>

#include <nlohmann/json.hpp>

#include <revisit/evaluation/loop_table.hpp>
#include <revisit/evaluation/reference.hpp>
#include <revisit/evaluation/trajectory_table.hpp>
#include <revisit/io/pose_file.hpp>
#include <revisit/io/recording.hpp>
#include <revisit/io/result_files.hpp>
#include <revisit/localisation/saved_map.hpp>

namespace revisit::cli {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

bool is_there(const fs::path& file) {
  std::error_code failure;
  return fs::exists(file, failure);
}

// To a tenth of a millimetre; as short as JSON can have it.
double rounded(double value) { return std::round(value * 1e4) / 1e4; }

Json position_of(const Pose& T) {
  const auto& t = T.translation();
  return {rounded(t.x()), rounded(t.y()), rounded(t.z())};
}

Json pose_of(const Pose& T) {
  Json pose = position_of(T);
  const Eigen::Quaterniond q(T.rotation());
  for (const double value : {q.x(), q.y(), q.z(), q.w()}) pose.push_back(std::round(value * 1e6) / 1e6);
  return pose;
}

// `revisit evaluate` leaves the reference with what it judged.
Result<std::map<FrameId, Pose>> read_truth(const fs::path& folder) {
  std::map<FrameId, Pose> truth;
  if (!is_there(folder / "reference.txt")) return truth;
  const auto poses = read_poses(folder / "reference.txt");
  if (!poses) return poses.error();
  for (const auto& [frame, entry] : to_trajectory(*poses, std::nullopt, {}).entries) truth[frame] = entry.T_world_lidar;
  return truth;
}

// Rows of numbers by pairs of frames; cells that are empty or no numbers are left out. Rows without both frames are
// named in `problems`; a last one that is still being written is none.
std::map<std::pair<std::int64_t, std::int64_t>, Json> read_evidence(const fs::path& file, Json& problems) {
  std::map<std::pair<std::int64_t, std::int64_t>, Json> evidence;
  std::ifstream stream(file);
  std::string line;
  std::getline(stream, line);
  std::vector<std::string> names;
  std::istringstream head(line);
  for (std::string name; std::getline(head, name, ',');) names.push_back(name);
  std::size_t number = 1, first_bad = 0, bad = 0;
  while (std::getline(stream, line) && !stream.eof()) {
    ++number;
    std::istringstream row(line);
    Json values;
    std::size_t column = 0;
    for (std::string cell; std::getline(row, cell, ',') && column < names.size(); ++column) {
      const Json value = Json::parse(cell, nullptr, false);
      if (value.is_number()) values[names[column]] = value;
    }
    if (!values.contains("query") || !values.contains("match")) {
      if (bad++ == 0) first_bad = number;
      continue;
    }
    const std::pair key{values["query"].get<std::int64_t>(), values["match"].get<std::int64_t>()};
    evidence[key] = std::move(values);
  }
  if (bad > 0)
    problems.push_back(file.filename().string() + ":" + std::to_string(first_bad) + ": no numbers of two frames (" +
                       std::to_string(bad) + " such rows); the evidence of these candidates is not shown");
  return evidence;
}

Json read_run_facts(const fs::path& file, Json& problems) {
  std::ifstream stream(file);
  const Json run = Json::parse(stream, nullptr, false);
  Json facts = Json::object();
  if (!run.is_object()) {
    if (is_there(file))
      problems.push_back(file.filename().string() + ": is no JSON object; times, counts and memory are not shown");
    return facts;
  }
  for (const char* name : {"counts", "ms_per_scan"}) {
    if (!run.contains(name) || !run[name].is_object()) continue;
    for (const auto& [key, value] : run[name].items())
      if (value.is_number()) facts[name][key] = value;
  }
  if (const auto memory = run.find("memory_mb"); memory != run.end() && memory->is_array())
    for (const Json& sample : *memory)
      if (sample.is_array() && sample.size() == 2 && sample[0].is_number() && sample[1].is_number())
        facts["memory_mb"].push_back(sample);
  if (run.contains("version") && run["version"].is_string()) facts["version"] = run["version"];
  facts["interrupted"] =
      run.contains("interrupted") && run["interrupted"].is_boolean() && run["interrupted"].get<bool>();
  return facts;
}

// Frames of other sessions have no reference.
Reference reference_of(const ViewData& data) {
  Trajectory trajectory;
  for (const ViewScan& scan : data.scans)
    if (const auto T = data.truth.find(scan.frame); scan.is_keyframe && T != data.truth.end())
      trajectory.entries[scan.frame] = {scan.stamp_s, T->second};
  return {std::move(trajectory), {}};
}

Json scans_of(const ViewData& data) {
  Trajectory estimate, reference;
  for (const ViewScan& scan : data.scans) {
    estimate.entries[scan.frame] = {scan.stamp_s, scan.T_map_lidar};
    if (const auto T = data.truth.find(scan.frame); T != data.truth.end())
      reference.entries[scan.frame] = {scan.stamp_s, T->second};
  }
  const Pose T_map_reference = evaluate_trajectory(estimate, reference).T_reference_estimate.inverse();
  Json scans = {{"frame", Json::array()}, {"stamp_s", Json::array()},  {"keyframe", Json::array()},
                {"pose", Json::array()},  {"odometry", Json::array()}, {"truth", Json::array()}};
  for (const ViewScan& scan : data.scans) {
    scans["frame"].push_back(scan.frame.value);
    scans["stamp_s"].push_back(scan.stamp_s);
    scans["keyframe"].push_back(scan.is_keyframe ? 1 : 0);
    scans["pose"].push_back(pose_of(scan.T_map_lidar));
    scans["odometry"].push_back(scan.T_odom_lidar ? position_of(*scan.T_odom_lidar) : Json());
    const auto T = data.truth.find(scan.frame);
    scans["truth"].push_back(T == data.truth.end() ? Json() : position_of(T_map_reference * T->second));
  }
  return scans;
}

Json loops_of(const ViewData& data, const Reference& reference, const fs::path& evidence_csv, Json& problems) {
  const auto evidence = read_evidence(evidence_csv, problems);
  std::map<std::pair<FrameId, FrameId>, JudgedLoop> judged;
  for (const JudgedLoop& each : evaluate_loops(data.loops, reference).loops) judged[{each.query, each.match}] = each;
  // The true pose of a query in its match.
  const auto add_truth = [&data](FrameId query, FrameId match, Json& row) {
    const auto T_world_query = data.truth.find(query), T_world_match = data.truth.find(match);
    if (T_world_query == data.truth.end() || T_world_match == data.truth.end()) return;
    row["true_pose"] = pose_of(T_world_match->second.inverse() * T_world_query->second);
  };
  Json loops = Json::array();
  for (const LoopConstraint& loop : data.loops) {
    Json row = {{"query", loop.query.value},           {"match", loop.match.value}, {"accepted", true},
                {"pose", pose_of(loop.T_match_query)}, {"score", loop.score},       {"probability", loop.probability},
                {"inlier_ratio", loop.inlier_ratio},   {"rmse_m", loop.rmse_m}};
    if (const auto verdict = judged.find({loop.query, loop.match}); verdict != judged.end()) {
      row["right"] = verdict->second.right;
      row["error_m"] = verdict->second.translation_error_m;
      row["error_deg"] = verdict->second.rotation_error_deg;
    }
    if (const auto found = evidence.find({loop.query.value, loop.match.value}); found != evidence.end())
      row["evidence"] = found->second;
    add_truth(loop.query, loop.match, row);
    loops.push_back(std::move(row));
  }
  for (const CandidateRow& answer : data.answers) {
    if (answer.accepted || !answer.match) continue;
    Json row = {{"query", answer.query.value},
                {"match", answer.match->value},
                {"accepted", false},
                {"score", answer.score},
                {"reason", answer.reason}};
    if (const auto found = evidence.find({answer.query.value, answer.match->value}); found != evidence.end()) {
      const Json& e = found->second;
      row["evidence"] = e;
      const std::array numbers{"tx", "ty", "tz", "qx", "qy", "qz", "qw"};
      if (std::all_of(numbers.begin(), numbers.end(), [&](const char* name) { return e.contains(name); }))
        row["pose"] = {e["tx"], e["ty"], e["tz"], e["qx"], e["qy"], e["qz"], e["qw"]};
      if (e.contains("log_odds")) row["probability"] = 1.0 / (1.0 + std::exp(-e["log_odds"].get<double>()));
    }
    if (row.contains("pose")) add_truth(answer.query, *answer.match, row);
    loops.push_back(std::move(row));
  }
  return loops;
}

// What a chart of precision and recall needs: each answer, and how far it is from the query in truth.
Json answers_of(const ViewData& data, const Reference& reference) {
  Json answers = Json::array();
  for (const CandidateRow& answer : data.answers) {
    const auto distance_m = answer.match ? reference.distance_m(answer.query, *answer.match) : std::nullopt;
    answers.push_back({answer.query.value, answer.match ? Json(answer.match->value) : Json(), answer.score,
                       distance_m ? Json(rounded(*distance_m)) : Json()});
  }
  return answers;
}

}  // namespace

Result<ViewData> read_map_view(const fs::path& map_file) {
  ViewData data;
  data.command = "slam";
  const auto store = open_map(map_file);
  if (!store) return store.error();
  const auto places = store->places();
  if (!places) return places.error();
  if (places->empty()) return data;  // the run has just begun
  const auto map = SavedMap::open(map_file);
  if (!map) return map.error();
  const auto scans = map->store()->scans();
  const auto sessions = map->store()->sessions();
  const auto answers = map->store()->answers();
  const auto edges = map->store()->edges();
  if (!scans) return scans.error();
  if (!sessions) return sessions.error();
  if (!answers) return answers.error();
  if (!edges) return edges.error();
  for (const StoredSession& session : *sessions) data.sessions.push_back(session.recording);
  if (!sessions->empty()) data.input = sessions->back().recording;
  std::set<FrameId> keyframes;                          // another program may have added some since
  for (const auto& keyframe : map->stored().keyframes)  // other parts have other coordinates
    if (const FrameId frame = keyframe.frame.frame;
        map->part(frame) == map->part(map->stored().keyframes.front().frame.frame))
      keyframes.insert(frame);
  std::map<int, Pose> T_map_odom;  // of each session: laid on where it begins
  for (const StoredScan& scan : *scans) {
    if (!keyframes.contains(scan.keyframe)) continue;
    const Pose T_map_lidar = map->T_map_lidar(scan.keyframe) * scan.T_keyframe_lidar;
    const auto odom = T_map_odom.try_emplace(session_of(scan.frame), T_map_lidar * scan.T_odom_lidar.inverse()).first;
    data.scans.push_back(
        {scan.frame, scan.stamp_s, scan.frame == scan.keyframe, T_map_lidar, odom->second * scan.T_odom_lidar});
  }
  data.answers = *answers;
  for (const StoredEdge& edge : *edges)
    if (edge.loop) data.loops.push_back(*edge.loop);
  const auto earth = map->store()->earth();
  if (!earth) return earth.error();
  for (const StoredEarth& each : *earth) {
    if (keyframes.empty() || each.part != map->part(*keyframes.begin())) continue;
    const Eigen::Vector3d north = each.T_earth_map.linear().transpose() * Eigen::Vector3d::UnitY();
    data.north_deg = to_degrees(std::atan2(-north.x(), north.y()));
  }
  auto truth = read_truth(map_file.parent_path());
  if (!truth) return truth.error();
  data.truth = *std::move(truth);
  return data;
}

Result<ViewData> read_detect_view(const fs::path& folder) {
  auto answers = read_candidates(folder / "candidates.csv");
  if (!answers) return answers.error();
  auto loops = read_loops(folder / "loops.csv");
  if (!loops) return loops.error();
  ViewData data;
  data.command = "detect";
  data.answers = *std::move(answers);
  data.loops = *std::move(loops);
  if (is_there(folder / "poses.txt")) {
    const auto poses = read_poses(folder / "poses.txt");
    if (!poses) return poses.error();
    std::optional<Pose> T_camera_lidar;
    if (is_there(folder / "calib.txt")) {
      const auto calibration = read_camera_calibration(folder / "calib.txt");
      if (!calibration) return calibration.error();
      T_camera_lidar = *calibration;
    }
    for (const auto& [frame, entry] : to_trajectory(*poses, T_camera_lidar, {}).entries)
      data.scans.push_back({frame, entry.stamp_s, true, entry.T_world_lidar, std::nullopt});
  }
  auto truth = read_truth(folder);
  if (!truth) return truth.error();
  data.truth = *std::move(truth);
  return data;
}

Result<std::string> to_view_json(const ViewData& data, const fs::path& folder, const fs::path& evidence) {
  const Reference reference = reference_of(data);
  Json problems = Json::array();
  Json view = {{"format", "revisit view"},
               {"version", 1},
               {"title", data.title},
               {"command", data.command},
               {"input", data.input},
               {"sessions", data.sessions},
               {"run", read_run_facts(folder / "run.json", problems)},
               {"has_truth", !data.truth.empty()},
               {"revisits", reference.revisits().size()},
               {"has_tiles", data.has_tiles},
               {"scans", scans_of(data)},
               {"loops", loops_of(data, reference, evidence, problems)},
               {"answers", answers_of(data, reference)}};
  view["problems"] = std::move(problems);
  if (data.north_deg) view["north_deg"] = rounded(*data.north_deg);
  return view.dump(-1, ' ', false, Json::error_handler_t::replace);
}

}  // namespace revisit::cli
