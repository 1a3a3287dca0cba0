// SPDX-License-Identifier: Apache-2.0
#include <revisit/io/recording.hpp>
#include <revisit/pipeline/recording_scale.hpp>
#include <revisit/simulation/simulated_recording.hpp>

#include "bind.hpp"

namespace revisit::python {
namespace {

// A view on what the scan holds; the scan lives as long.
template <typename T>
py::array view(const py::object& owner, const T* data, std::vector<py::ssize_t> shape) {
  py::array_t<T> array(std::move(shape), data, owner);
  array.attr("setflags")(py::arg("write") = false);
  return array;
}

std::size_t index_in(const Recording& recording, py::ssize_t index) {
  const auto size = static_cast<py::ssize_t>(recording.size());
  if (index < -size || index >= size)
    throw py::index_error("scan " + std::to_string(index) + " of a recording of " + std::to_string(size));
  return static_cast<std::size_t>(index < 0 ? index + size : index);
}

std::shared_ptr<Recording> open_any(const std::filesystem::path& path, const std::string& topic,
                                    const std::filesystem::path& poses, const std::string& odometry_topic) {
  RecordingOptions options;
  options.topic = topic;
  options.poses_file = poses;
  options.odometry_topic = odometry_topic;
  const LogSink log = log_sink();
  return unwrap(without_lock([&] { return open_recording(path, log, options); }));
}

}  // namespace

void bind_scans(py::module_& module) {
  py::class_<Scan, std::shared_ptr<Scan>>(module, "Scan", "One sweep of a LiDAR.")
      .def(py::init([](const py::object& points, const py::object& intensity, const py::object& time,
                       const py::object& ring, double stamp, std::int64_t frame) {
             Scan scan = to_scan(points, intensity, time, ring, stamp);
             scan.stamp_s = stamp;
             scan.frame = FrameId{frame};
             return scan;
           }),
           py::arg("points"), py::arg("intensity") = py::none(), py::arg("time") = py::none(),
           py::arg("ring") = py::none(), py::arg("stamp") = 0.0, py::arg("frame") = 0)
      .def_property(
          "frame", [](const Scan& self) { return self.frame.value; },
          [](Scan& self, std::int64_t frame) { self.frame = FrameId{frame}; }, "Number in its recording.")
      .def_readwrite("stamp", &Scan::stamp_s, "Seconds, any epoch.")
      .def_property_readonly(
          "points",
          [](const py::object& self) {
            const auto& scan = self.cast<const Scan&>();
            return view(self, reinterpret_cast<const float*>(scan.points.data()),
                        {static_cast<py::ssize_t>(scan.points.size()), 4});
          },
          "N x 4 float32: x, y, z in metres in the LiDAR's frame (x forward, y left, z up), and raw intensity. A view.")
      .def_property_readonly(
          "times",
          [](const py::object& self) {
            const auto& scan = self.cast<const Scan&>();
            return view(self, scan.times_s.data(), {static_cast<py::ssize_t>(scan.times_s.size())});
          },
          "N float32: seconds from the stamp; empty where they are not known. A view.")
      .def_property_readonly(
          "rings",
          [](const py::object& self) {
            const auto& scan = self.cast<const Scan&>();
            return view(self, scan.rings.data(), {static_cast<py::ssize_t>(scan.rings.size())});
          },
          "N uint16: the laser of each point; empty where it is not known. A view.")
      .def("__len__", [](const Scan& self) { return self.points.size(); });

  py::class_<Recording, std::shared_ptr<Recording>>(
      module, "Recording", "Scans in the order of their frames, read when asked for. Several threads may read.")
      .def("__len__", &Recording::size)
      .def("__getitem__",
           [](const Recording& self, py::ssize_t index) {
             const std::size_t i = index_in(self, index);
             return unwrap(without_lock([&] { return self.read(i); }));
           })
      .def("frame", [](const Recording& self, py::ssize_t i) { return self.frame(index_in(self, i)).value; })
      .def("stamp",
           [](const Recording& self, py::ssize_t i) {
             const std::size_t index = index_in(self, i);
             return without_lock([&] { return self.stamp_s(index); });
           })
      .def(
          "pose",
          [](const Recording& self, py::ssize_t i) -> std::optional<Eigen::Matrix4d> {
            const auto T = self.trajectory().at(self.frame(index_in(self, i)));
            return T ? std::optional(T->matrix()) : std::nullopt;
          },
          "The LiDAR's pose that came with the recording, 4 x 4; None where none did.")
      .def(
          "wheel_pose",
          [](const Recording& self, py::ssize_t i) -> std::optional<Eigen::Matrix4d> {
            const std::size_t index = index_in(self, i);
            const auto T = without_lock([&] { return self.wheel_pose(index); });
            return T ? std::optional(T->matrix()) : std::nullopt;
          },
          "What the wheels or another odometry said, 4 x 4, in a frame of their own; None where there is none.")
      .def_property_readonly("kind", &Recording::kind)
      .def_property_readonly("has_times", &Recording::has_times)
      .def_property_readonly("findings",
                             [](const Recording& self) { return without_lock([&] { return self.findings(); }); });

  py::class_<IntensityScale>(module, "IntensityScale", "How the raw intensity of one sensor becomes [0, 1].")
      .def(py::init([](double full_scale) {
             if (!(full_scale > 0.0 && std::isfinite(full_scale)))
               throw py::value_error("full_scale is " + std::to_string(full_scale) + "; allowed: above 0, finite");
             IntensityScale scale;
             scale.full_scale = full_scale;
             return scale;
           }),
           py::arg("full_scale"))
      .def_readonly("full_scale", &IntensityScale::full_scale, "The reading that becomes 1.")
      .def_readonly("warning", &IntensityScale::warning);
  module.def(
      "intensity_scale_of",
      [](const Recording& recording, const Parameters& parameters) {
        return unwrap(without_lock([&] { return intensity_scale_of(recording, parameters.intensity); }));
      },
      py::arg("recording"), py::arg("parameters") = Parameters{});
  module.def("open_recording", &open_any, py::arg("path"), py::arg("topic") = "", py::arg("poses") = "",
             py::arg("odometry_topic") = "");
  module.def(
      "simulate",
      [](const Parameters& parameters) -> std::shared_ptr<Recording> {
        const LogSink log = log_sink();
        return unwrap(without_lock([&] { return revisit::simulate(parameters.simulation, log); }));
      },
      py::arg("parameters"));
}

}  // namespace revisit::python
