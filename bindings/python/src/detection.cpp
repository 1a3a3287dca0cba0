// SPDX-License-Identifier: Apache-2.0
#include <revisit/core/refusal_text.hpp>
#include <revisit/pipeline/loop_detector.hpp>
#include <revisit/pipeline/register_scans.hpp>
#include <revisit/store/stored_clouds.hpp>

#include "bind.hpp"

namespace revisit::python {
namespace {

py::dict milliseconds(const Detection& detection) {
  py::dict ms;
  ms["odometry"] = detection.odometry_ms;
  ms["filter"] = detection.preparation_ms.filter;
  ms["ground"] = detection.preparation_ms.ground;
  ms["intensity"] = detection.preparation_ms.intensity;
  ms["describe"] = detection.preparation_ms.describe;
  ms["thin"] = detection.preparation_ms.thin;
  ms["search"] = detection.search_ms;
  ms["temporal"] = detection.temporal_ms;
  ms["geometric"] = detection.geometric_ms;
  return ms;
}

}  // namespace

void bind_detection(py::module_& module) {
  py::class_<LoopConstraint>(module, "Loop", "Two scans of one place, and how they lie to each other.")
      .def_property_readonly("query", [](const LoopConstraint& self) { return self.query.value; })
      .def_property_readonly("match", [](const LoopConstraint& self) { return self.match.value; })
      .def_property_readonly(
          "T_match_query", [](const LoopConstraint& self) { return Eigen::Matrix4d(self.T_match_query.matrix()); },
          "4 x 4: maps the query's LiDAR frame into the match's, metres.")
      .def_readonly("information", &LoopConstraint::information,
                    "6 x 6, inverse covariance: metres, then radians, in the query's frame.")
      .def_readonly("probability", &LoopConstraint::probability, "That the pose is right, [0, 1].")
      .def_readonly("score", &LoopConstraint::score, "Orders loops by confidence.")
      .def_readonly("inlier_ratio", &LoopConstraint::inlier_ratio)
      .def_readonly("rmse_m", &LoopConstraint::rmse_m);

  py::class_<Detection>(module, "Detection", "Everything found out about one scan.")
      .def_property_readonly("frame", [](const Detection& self) { return self.frame.value; })
      .def_readonly("loop", &Detection::loop, "Loop, or None.")
      .def_property_readonly("reason", &Detection::reason, "Why there is no loop; empty where there is one.")
      .def_readonly("searchable_places", &Detection::searchable_places)
      .def_property_readonly(
          "candidates", [](const Detection& self) { return to_array(self.candidates); },
          "Structured array, best first: match, geometry_score, intensity_score, yaw_rad.")
      .def_readonly("score", &Detection::score)
      .def_property_readonly("probability",
                             [](const Detection& self) -> std::optional<double> {
                               return self.geometric ? std::optional(self.geometric->probability) : std::nullopt;
                             })
      .def_property_readonly("loops", &Detection::loops,
                             "All found with this scan: its own, and those of earlier scans.")
      .def_readonly("earlier", &Detection::earlier,
                    "Scans of the last metres without a loop, to which one found since has led back: as they are now.")
      .def_property_readonly("milliseconds", &milliseconds, "By stage.");

  using Detector = Shared<LoopDetector>;
  py::class_<Detector>(module, "LoopDetector")
      .def(py::init([](const Parameters& parameters, const std::optional<IntensityScale>& scale) {
             return std::make_unique<Detector>(LoopDetector(parameters, scale, {}, log_sink(), clouds_in_file()));
           }),
           py::arg("parameters"), py::arg("scale"))
      .def("process",
           [](Detector& self, Scan& scan, const py::object& pose) {
             const auto T = to_optional_pose(pose);
             return unwrap(self.use([&](LoopDetector& detector) { return detector.process(std::move(scan), T); }));
           })
      .def("localise",
           [](Detector& self, Scan& scan) {
             return unwrap(self.use([&](LoopDetector& detector) { return detector.localise(std::move(scan)); }));
           })
      .def("__len__", [](Detector& self) { return self.use([](LoopDetector& each) { return each.index().size(); }); });

  py::class_<Registration>(module, "Registration", "How two scans lie to each other.")
      .def_property_readonly(
          "T_target_source", [](const Registration& self) { return Eigen::Matrix4d(self.T_target_source.matrix()); },
          "4 x 4: maps the source's LiDAR frame into the target's, metres.")
      .def_readonly("information", &Registration::information, "6 x 6, as of a Loop.")
      .def_readonly("probability", &Registration::probability)
      .def_readonly("inlier_ratio", &Registration::inlier_ratio)
      .def_readonly("rmse_m", &Registration::rmse_m)
      .def_property_readonly("is_accepted", &Registration::is_accepted)
      .def_property_readonly(
          "reason", [](const Registration& self) { return self.refusal ? to_text(*self.refusal) : std::string(); });
  module.def("register_scans", [](const Scan& source, const Scan& target, const Parameters& parameters) {
    return unwrap(without_lock([&] { return register_scans(source, target, require_valid(parameters)); }));
  });
}

}  // namespace revisit::python
