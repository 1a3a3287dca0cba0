// SPDX-License-Identifier: Apache-2.0
#include <revisit/pipeline/prepare.hpp>
#include <revisit/retrieval/place_index.hpp>

#include "bind.hpp"

namespace revisit::python {
namespace {

// Descriptors keep columns together; arrays have rings before sectors, as pictures have rows before columns.
void put_intensity(const DescriptorView& of, std::uint8_t* to) {
  for (int ring = 0; ring < of.rings; ++ring)
    for (int sector = 0; sector < of.sectors; ++sector) *to++ = of.intensity[sector * of.rings + ring];
}

void put_occupancy(const DescriptorView& of, bool* to) {
  const auto rows = static_cast<std::size_t>(of.rows()), sectors = static_cast<std::size_t>(of.sectors);
  for (std::size_t row = 0; row < rows; ++row)
    for (std::size_t sector = 0; sector < sectors; ++sector) {
      const std::size_t bit = sector * rows + row;
      *to++ = (of.occupancy[bit / 64] >> (bit % 64) & 1u) != 0;
    }
}

py::array_t<std::uint8_t> intensity(const IntensityScanContext& of) {
  py::array_t<std::uint8_t> array({of.rings, of.sectors});
  put_intensity(of, array.mutable_data());
  return array;
}

py::array_t<bool> occupancy(const IntensityScanContext& of) {
  py::array_t<bool> array({std::max(1, of.levels), of.rings, of.sectors});
  put_occupancy(of, array.mutable_data());
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
  py::array_t<std::int64_t> frames() const {
    py::array_t<std::int64_t> array(static_cast<py::ssize_t>(size()));
    for (py::ssize_t i = 0; i < array.size(); ++i)
      array.mutable_at(i) = index_.frame(static_cast<std::size_t>(i)).value;
    return array;
  }
  py::array_t<std::uint8_t> intensities() const {
    return of_places<std::uint8_t>(
        [](const DescriptorView& of) {
          return std::vector<py::ssize_t>{of.rings, of.sectors};
        },
        put_intensity);
  }
  py::array_t<bool> occupancies() const {
    return of_places<bool>(
        [](const DescriptorView& of) {
          return std::vector<py::ssize_t>{std::max(1, of.levels), of.rings, of.sectors};
        },
        put_occupancy);
  }

 private:
  template <typename Value>
  py::array_t<Value> of_places(std::vector<py::ssize_t> (*shape_of)(const DescriptorView&),
                               void (*put)(const DescriptorView&, Value*)) const {
    const std::size_t places = size();
    std::vector<py::ssize_t> shape{0};
    std::optional<py::array_t<Value>> array;
    for (std::size_t i = 0; i < places; ++i) {
      const auto descriptor = index_.find(index_.frame(i));
      if (!descriptor) throw py::value_error("place " + std::to_string(i) + " of the index: its file was altered");
      if (!array) {
        shape = shape_of(*descriptor);
        shape.insert(shape.begin(), static_cast<py::ssize_t>(places));
        array.emplace(shape);
      }
      put(*descriptor, array->mutable_data(static_cast<py::ssize_t>(i)));
    }
    return array ? *std::move(array) : py::array_t<Value>(shape);
  }

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
      .def_property_readonly("frames", &Index::frames)
      .def_property_readonly("intensities", &Index::intensities)
      .def_property_readonly("occupancies", &Index::occupancies)
      .def("__len__", &Index::size);
}

}  // namespace revisit::python
