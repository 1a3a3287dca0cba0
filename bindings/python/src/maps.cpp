// SPDX-License-Identifier: Apache-2.0
#include <revisit/pipeline/localiser.hpp>
#include <revisit/pipeline/slam.hpp>

#include "bind.hpp"

namespace revisit::python {
namespace {

using SharedSlam = Shared<Slam>;
using SharedLocaliser = Shared<Localiser>;

std::unique_ptr<SharedSlam> make_slam(const std::string& folder, const Parameters& parameters,
                                      const std::optional<IntensityScale>& scale, bool takes_odometry,
                                      bool new_session) {
  SlamSetup setup;
  setup.scale = scale;
  setup.log = log_sink();
  setup.new_session = new_session;
  if (takes_odometry) setup.odometry = Odometry::Source::kExternal;
  return without_lock([&] {
    return std::make_unique<SharedSlam>(folder.empty() ? Slam(parameters, setup)
                                                       : unwrap(Slam::open(folder, parameters, setup)));
  });
}

py::dict trajectory_of(const Trajectory& trajectory) {
  std::vector<std::int64_t> frames;
  std::vector<double> stamps;
  std::vector<Pose> poses;
  for (const auto& [frame, entry] : trajectory.entries) {
    frames.push_back(frame.value);
    stamps.push_back(entry.stamp_s);
    poses.push_back(entry.T_world_lidar);
  }
  py::dict result;
  result["frames"] = py::array_t<std::int64_t>(static_cast<py::ssize_t>(frames.size()), frames.data());
  result["stamps"] = py::array_t<double>(static_cast<py::ssize_t>(stamps.size()), stamps.data());
  result["poses"] = to_array(poses);
  return result;
}

void bind_slam(py::module_& module) {
  py::class_<SlamStep>(module, "SlamStep", "What became of one scan.")
      .def_property_readonly("frame", [](const SlamStep& self) { return self.frame.value; })
      .def_property_readonly(
          "T_world_lidar", [](const SlamStep& self) { return Eigen::Matrix4d(self.T_world_lidar.matrix()); },
          "4 x 4, as known by now; later loops may move it.")
      .def_readonly("is_tracked", &SlamStep::is_tracked)
      .def_readonly("is_keyframe", &SlamStep::is_keyframe)
      .def_readonly("detection", &SlamStep::detection, "Of key frames; None of others.")
      .def_readonly("loops_entered", &SlamStep::loops_entered);
  py::class_<SharedSlam>(module, "Slam")
      .def(py::init(&make_slam))
      .def("process",
           [](SharedSlam& self, Scan& scan, const py::object& odometry) {
             const auto T = to_optional_pose(odometry);
             return unwrap(self.use([&](Slam& slam) { return slam.process(std::move(scan), T); }));
           })
      .def("finish", [](SharedSlam& self) { unwrap(self.use([](Slam& slam) { return slam.finish(); })); })
      .def("last_frame",
           [](SharedSlam& self) -> std::optional<std::int64_t> {
             const auto last = self.use([](Slam& slam) { return slam.last_frame(); });
             return last ? std::optional(last->value) : std::nullopt;
           })
      .def("trajectories",
           [](SharedSlam& self) {
             const auto found = unwrap(self.use([](Slam& slam) { return slam.trajectories(); }));
             return py::make_tuple(trajectory_of(found.corrected), trajectory_of(found.odometry));
           })
      .def("loops",
           [](SharedSlam& self) {
             const auto edges = unwrap(self.use([](Slam& slam) { return slam.store().edges(); }));
             std::vector<LoopConstraint> loops;
             for (const StoredEdge& edge : edges)
               if (edge.loop) loops.push_back(*edge.loop);
             return loops;
           })
      .def("map",
           [](SharedSlam& self, py::object callback) {
             PythonProgress progress(std::move(callback));
             auto points = self.use([&](Slam& slam) { return slam.map(std::ref(progress)); });
             progress.rethrow();
             return to_array(unwrap(std::move(points)));
           })
      .def("write_map", [](SharedSlam& self, const std::filesystem::path& folder, py::object callback) {
        PythonProgress progress(std::move(callback));
        const auto report = self.use([&](Slam& slam) { return slam.write_map(folder, std::ref(progress)); });
        progress.rethrow();
        return unwrap(report).points;
      });
}

}  // namespace

void bind_maps(py::module_& module) {
  bind_slam(module);
  py::class_<Localisation>(module, "Localisation", "Where a scan is in a saved map.")
      .def_property_readonly("frame", [](const Localisation& self) { return self.frame.value; })
      .def_property_readonly(
          "status", [](const Localisation& self) { return std::string(to_string(self.status)); },
          "\"found\", \"followed\", \"predicted\" or \"lost\".")
      .def_property_readonly(
          "T_map_lidar",
          [](const Localisation& self) -> std::optional<Eigen::Matrix4d> {
            return self.T_map_lidar ? std::optional(self.T_map_lidar->matrix()) : std::nullopt;
          },
          "4 x 4; None where it is lost.")
      .def_readonly("probability", &Localisation::probability)
      .def_readonly("information", &Localisation::information, "6 x 6, as of a Loop.")
      .def_property_readonly("match", [](const Localisation& self) { return self.match.value; })
      .def_readonly("reason", &Localisation::reason, "Why it is lost or predicted only.");
  py::class_<SharedLocaliser>(module, "Localiser")
      .def(py::init([](const std::filesystem::path& map, const Parameters& parameters) {
        const LogSink log = log_sink();
        return without_lock(
            [&] { return std::make_unique<SharedLocaliser>(unwrap(Localiser::open(map, parameters, log))); });
      }))
      .def("locate",
           [](SharedLocaliser& self, Scan& scan) {
             return unwrap(self.use([&](Localiser& localiser) { return localiser.locate(std::move(scan)); }));
           })
      .def("follow",
           [](SharedLocaliser& self, Scan& scan, const py::object& odometry) {
             const auto T = to_optional_pose(odometry);
             return unwrap(self.use([&](Localiser& localiser) { return localiser.follow(std::move(scan), T); }));
           })
      .def("expect",
           [](SharedLocaliser& self, const py::object& T_map_lidar) {
             const Pose T = to_pose(T_map_lidar);
             self.use([&](Localiser& localiser) { localiser.expect(T); });
           })
      .def("__len__", [](SharedLocaliser& self) { return self.use([](Localiser& each) { return each.places(); }); });
}

}  // namespace revisit::python
