// SPDX-License-Identifier: Apache-2.0
#include <revisit/pipeline/prepare.hpp>
#include <revisit/retrieval/place_index.hpp>

#include "bind.hpp"

namespace revisit::python {
namespace {

py::array_t<std::uint8_t> intensity(const IntensityScanContext& of) {
  py::array_t<std::uint8_t> array({of.rings, of.sectors});
  auto values = array.mutable_unchecked<2>();
  for (int ring = 0; ring < of.rings; ++ring)
    for (int sector = 0; sector < of.sectors; ++sector)
      values(ring, sector) = of.intensity[static_cast<std::size_t>(sector) * static_cast<std::size_t>(of.rings) +
                                          static_cast<std::size_t>(ring)];
  return array;
}

py::array_t<bool> occupancy(const IntensityScanContext& of) {
  const int layers = std::max(1, of.levels);
  py::array_t<bool> array({layers, of.rings, of.sectors});
  auto values = array.mutable_unchecked<3>();
  for (int layer = 0; layer < layers; ++layer)
    for (int ring = 0; ring < of.rings; ++ring)
      for (int sector = 0; sector < of.sectors; ++sector)
        values(layer, ring, sector) = of.occupied(ring, sector, layer);
  return array;
}

// Adding and searching may go on side by side; adding from several threads may not.
class Index {
 public:
  explicit Index(PlaceIndex index) : index_(std::move(index)) {}

  void add(std::int64_t frame, const IntensityScanContext& descriptor, double stamp_s) {
    without_lock([&] {
      const std::lock_guard lock(adding_);
      index_.add(FrameId{frame}, stamp_s, descriptor);
    });
  }
  py::array search(const IntensityScanContext& query, std::optional<std::size_t> places) const {
    const std::size_t all = index_.size();
    if (places && *places > all)
      throw py::value_error("places is " + std::to_string(*places) + "; allowed: up to " + std::to_string(all));
    return to_array(unwrap(without_lock([&] { return index_.search(query, places.value_or(all)); })));
  }
  void save(const std::string& path) {
    unwrap(without_lock([&] {
      const std::lock_guard lock(adding_);
      return index_.save(path);
    }));
  }
  std::size_t size() const { return index_.size(); }

 private:
  PlaceIndex index_;
  std::mutex adding_;
};

}  // namespace

void bind_retrieval(py::module_& module) {
  py::class_<IntensityScanContext>(module, "Descriptor", "Intensity scan context of a scan (paper, section III-B).")
      .def_property_readonly("intensity", &intensity, "rings x sectors, uint8: largest intensity, 255 is 1.")
      .def_property_readonly("occupancy", &occupancy, "layers x rings x sectors, bool: what stands there.")
      .def_readonly("rings", &IntensityScanContext::rings)
      .def_readonly("sectors", &IntensityScanContext::sectors);
  module.def("describe", [](Scan& scan, const Parameters& parameters, const std::optional<IntensityScale>& scale) {
    return unwrap(without_lock([&]() -> Result<IntensityScanContext> {
      ScanPreparation preparation(require_valid(parameters), scale, {}, {});
      auto prepared = preparation.prepare(std::move(scan));
      if (!prepared) return prepared.error();
      return std::move(prepared->descriptor);
    }));
  });
  py::class_<Index>(module, "PlaceIndex")
      .def(py::init([](const Parameters& parameters) {
             return std::make_unique<Index>(PlaceIndex(require_valid(parameters).retrieval));
           }),
           py::arg("parameters") = Parameters{})
      .def_static(
          "open",
          [](const std::string& path, const Parameters& parameters) {
            return std::make_unique<Index>(
                unwrap(without_lock([&] { return PlaceIndex::open(path, parameters.retrieval); })));
          },
          py::arg("path"), py::arg("parameters") = Parameters{})
      .def("add", &Index::add, py::arg("frame"), py::arg("descriptor"), py::arg("stamp") = 0.0,
           "Frames increase; otherwise ValueError.")
      .def("search", &Index::search, py::arg("descriptor"), py::arg("places") = py::none(),
           "The best of the first `places` (all), best first: a structured array of match, geometry_score, "
           "intensity_score, yaw_rad.")
      .def("save", &Index::save, py::arg("path"))
      .def("__len__", &Index::size);
}

}  // namespace revisit::python
