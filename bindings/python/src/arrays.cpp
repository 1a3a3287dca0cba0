// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cstring>
#include <span>
#include <sstream>

#include <revisit/io/point_cloud.hpp>

#include "bind.hpp"

namespace revisit::python {
namespace {

std::string shape_of(const py::array& array) {
  std::ostringstream text;
  text << "(";
  for (py::ssize_t i = 0; i < array.ndim(); ++i) text << (i > 0 ? ", " : "") << array.shape(i);
  text << ") of " << py::str(array.dtype()).cast<std::string>();
  return text.str();
}

// One value a point, or none.
template <typename T>
std::vector<T> column(const py::object& values, const char* name, std::size_t points) {
  if (values.is_none()) return {};
  const auto array = py::array_t<T, py::array::c_style | py::array::forcecast>::ensure(values);
  if (!array) throw py::value_error(std::string(name) + " holds no numbers");
  if (array.ndim() != 1 || static_cast<std::size_t>(array.shape(0)) != points)
    throw py::value_error(std::string(name) + " has shape " + shape_of(array) + "; allowed: one value a point, " +
                          std::to_string(points));
  return {array.data(), array.data() + points};
}

std::vector<float> times_of(const py::object& values, std::size_t points) {
  constexpr double kMost_s = 10.0;
  const std::vector<double> times = column<double>(values, "time", points);
  for (const double each : times)
    if (!(std::abs(each) <= kMost_s))
      throw py::value_error("time holds " + std::to_string(each) +
                            "; allowed: seconds from the stamp, within 10 s of it");
  return {times.begin(), times.end()};
}

std::vector<std::uint16_t> rings_of(const py::object& values, std::size_t points) {
  const std::vector<double> rings = column<double>(values, "ring", points);
  for (const double each : rings)
    if (!(each >= 0.0 && each <= UINT16_MAX && each == std::floor(each)))
      throw py::value_error("ring holds " + std::to_string(each) + "; allowed: whole numbers from 0 to 65535");
  return {rings.begin(), rings.end()};
}

struct Columns {
  std::vector<float> intensity, time;
  std::vector<std::uint16_t> ring;
};

// Reads each value where it lies, whatever the strides.
template <typename T>
std::vector<Point> read_strided(const char* data, std::size_t count, py::ssize_t row, py::ssize_t step, int columns) {
  std::vector<Point> points;
  points.reserve(count);
  for (std::size_t i = 0; i < count; ++i) {
    const auto at = [&](py::ssize_t column) {
      T value;
      std::memcpy(&value, data + static_cast<py::ssize_t>(i) * row + column * step, sizeof value);
      return static_cast<float>(value);
    };
    points.push_back({at(0), at(1), at(2), columns == 4 ? at(3) : 0.f});
  }
  return points;
}

bool is_finite(const Point& p) { return std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z); }

bool is_none(const Point& p) {
  return !is_finite(p) || !std::isfinite(p.intensity) || (p.x == 0.f && p.y == 0.f && p.z == 0.f);
}

// Four points at a time, which are alright where all values are finite and no x is 0; else one by one.
bool any_is_none(std::span<const Point> points) {
  using FourPoints = Eigen::Array<float, 16, 1>;
  FourPoints nan_if_not_finite = FourPoints::Zero(), least = FourPoints::Ones();
  const std::size_t in_fours = points.size() / 4 * 4;
  for (std::size_t i = 0; i < in_fours; i += 4) {
    const Eigen::Map<const FourPoints, Eigen::Aligned16> four(&points[i].x);
    nan_if_not_finite += four * 0.f;
    least = least.min(four.abs());
  }
  const bool are_alright =
      (nan_if_not_finite == 0.f).all() && least[0] > 0.f && least[4] > 0.f && least[8] > 0.f && least[12] > 0.f;
  return std::any_of(points.begin() + static_cast<std::ptrdiff_t>(are_alright ? in_fours : 0), points.end(), is_none);
}

// Copies, and says whether any of them is none, by blocks that stay in the first cache.
bool copy_and_look(std::span<const Point> from, std::vector<Point>& to) {
  constexpr std::size_t kBlock = 1024;
  bool some_are_none = false;
  to.reserve(from.size());
  for (std::size_t first = 0; first < from.size(); first += kBlock) {
    const auto block = from.subspan(first, std::min(kBlock, from.size() - first));
    to.insert(to.end(), block.begin(), block.end());
    some_are_none = some_are_none || any_is_none(std::span(to).last(block.size()));
  }
  return some_are_none;
}

void leave_out_points_that_are_none(Scan& scan) {
  keep_points(scan, [&](std::size_t i) {
    Point& p = scan.points[i];
    if (!std::isfinite(p.intensity)) p.intensity = 0.f;
    const bool is_at_origin = p.x == 0.f && p.y == 0.f && p.z == 0.f;
    scan.dropped_non_finite += is_finite(p) ? 0 : 1;
    scan.dropped_at_origin += is_at_origin ? 1 : 0;
    return is_finite(p) && !is_at_origin;
  });
}

Scan read_points(const py::array& array, Columns columns) {
  const auto count = static_cast<std::size_t>(array.shape(0));
  const int width = static_cast<int>(array.shape(1));
  const py::ssize_t row = array.strides(0), step = array.strides(1);
  const bool is_float = array.itemsize() == sizeof(float);
  const bool lies_as_points = is_float && width == 4 && step == sizeof(float) && row == sizeof(Point) &&
                              reinterpret_cast<std::uintptr_t>(array.data()) % alignof(Point) == 0;
  const auto* data = static_cast<const char*>(array.data());
  return without_lock([&] {
    Scan scan;
    bool some_are_none = false;
    if (lies_as_points) {
      some_are_none = copy_and_look({reinterpret_cast<const Point*>(data), count}, scan.points);
    } else {
      scan.points = is_float ? read_strided<float>(data, count, row, step, width)
                             : read_strided<double>(data, count, row, step, width);
      some_are_none = any_is_none(scan.points);
    }
    for (std::size_t i = 0; i < columns.intensity.size(); ++i) scan.points[i].intensity = columns.intensity[i];
    scan.times_s = std::move(columns.time);
    scan.rings = std::move(columns.ring);
    if (some_are_none || !columns.intensity.empty()) leave_out_points_that_are_none(scan);
    return scan;
  });
}

// sensor_msgs/PointField's number of a type of numpy; 0 for others.
std::uint8_t field_type(const py::dtype& type) {
  const std::string kinds = "iuiuiuff", sizes = "11224448";
  for (std::size_t i = 0; i < kinds.size(); ++i)
    if (type.kind() == kinds[i] && type.itemsize() == sizes[i] - '0') return static_cast<std::uint8_t>(i + 1);
  return 0;
}

Scan read_records(const py::array& records, double stamp_s) {
  PointCloudView view;
  const auto fields = records.dtype().attr("fields").cast<py::dict>();
  for (const auto& [name, description] : fields) {
    const auto parts = description.cast<py::tuple>();
    const auto type = parts[0].cast<py::dtype>();
    const bool is_number = type.kind() == 'i' || type.kind() == 'u' || type.kind() == 'f';
    if (is_number && (field_type(type) == 0 || !type.attr("isnative").cast<bool>()))
      throw py::value_error("field " + name.cast<std::string>() + " is " +
                            py::str(py::object(type)).cast<std::string>() +
                            "; allowed: 8 to 32 bit integers, float32 and float64 of this machine's byte order");
    if (const std::uint8_t number = field_type(type); number != 0)
      view.fields.push_back({name.cast<std::string>(), parts[1].cast<std::uint32_t>(), number});
  }
  const auto flat = py::array::ensure(records.attr("ravel")(), py::array::c_style);
  view.width = static_cast<std::size_t>(flat.size());
  view.point_step = static_cast<std::size_t>(flat.itemsize());
  view.data = {static_cast<const std::uint8_t*>(flat.data()), view.width * view.point_step};
  const LogSink log = log_sink();
  auto scan = without_lock([&] { return revisit::to_scan(view, stamp_s, "an array of points", log); });
  if (!scan) throw py::value_error(scan.error().message);
  return *std::move(scan);
}

struct CandidateRecord {
  std::int64_t match;
  double geometry_score, intensity_score, yaw_rad;
};

}  // namespace

void register_dtypes() { PYBIND11_NUMPY_DTYPE(CandidateRecord, match, geometry_score, intensity_score, yaw_rad); }

py::array to_array(const std::vector<LoopCandidate>& candidates) {
  std::vector<CandidateRecord> records;
  records.reserve(candidates.size());
  for (const LoopCandidate& each : candidates)
    records.push_back({each.match.value, each.geometry_score, each.intensity_score, each.yaw_rad});
  return py::array_t<CandidateRecord>(static_cast<py::ssize_t>(records.size()), records.data());
}

Scan to_scan(const py::object& points, const py::object& intensity, const py::object& time, const py::object& ring,
             double stamp_s) {
  if (!std::isfinite(stamp_s)) throw py::value_error("stamp is not finite; allowed: seconds");
  const bool has_columns = !intensity.is_none() || !time.is_none() || !ring.is_none();
  if (py::isinstance<Scan>(points)) {
    if (has_columns) throw py::value_error("a Scan has its own intensities, times and rings");
    return points.cast<Scan>();
  }
  const auto array = py::array::ensure(points);
  if (!array) throw py::value_error("points are no array; allowed: (N, 3) or (N, 4) of float32 or float64");
  if (array.dtype().has_fields()) {
    if (has_columns) throw py::value_error("a structured array has its own intensities, times and rings");
    return read_records(array, stamp_s);
  }
  const bool is_float = array.dtype().kind() == 'f' && (array.itemsize() == 4 || array.itemsize() == 8);
  if (array.ndim() != 2 || (array.shape(1) != 3 && array.shape(1) != 4) || !is_float ||
      !array.dtype().attr("isnative").cast<bool>())
    throw py::value_error("points have shape " + shape_of(array) +
                          "; allowed: (N, 3) or (N, 4) of float32 or float64, or a structured array with x, y, z");
  const auto count = static_cast<std::size_t>(array.shape(0));
  Columns columns{column<float>(intensity, "intensity", count), times_of(time, count), rings_of(ring, count)};
  return read_points(array, std::move(columns));
}

Pose to_pose(const py::object& values) {
  const auto array = py::array_t<double, py::array::c_style | py::array::forcecast>::ensure(values);
  if (!array) throw py::value_error("a pose holds no numbers; allowed: a 4 x 4 matrix");
  if (array.ndim() != 2 || array.shape(0) != 4 || array.shape(1) != 4)
    throw py::value_error("a pose has shape " + shape_of(array) + "; allowed: a 4 x 4 matrix");
  const Eigen::Matrix4d matrix = Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(array.data());
  const Eigen::Matrix3d R = matrix.topLeftCorner<3, 3>();
  constexpr double kTolerance = 1e-3;
  const bool is_pose = matrix.allFinite() && (R * R.transpose() - Eigen::Matrix3d::Identity()).norm() < kTolerance &&
                       R.determinant() > 0.0 && matrix.row(3).isApprox(Eigen::RowVector4d(0, 0, 0, 1), kTolerance);
  if (!is_pose) {
    std::ostringstream text;
    text << "a pose is\n" << matrix << "\nallowed: a finite 4 x 4 matrix [R t; 0 0 0 1] with a rotation R";
    throw py::value_error(text.str());
  }
  Pose T = Pose::Identity();
  T.translation() = matrix.topRightCorner<3, 1>();
  T.linear() = R;
  return T;
}

std::optional<Pose> to_optional_pose(const py::object& matrix) {
  return matrix.is_none() ? std::nullopt : std::optional(to_pose(matrix));
}

py::array_t<double> to_array(const std::vector<Pose>& poses) {
  py::array_t<double> array({static_cast<py::ssize_t>(poses.size()), py::ssize_t{4}, py::ssize_t{4}});
  auto values = array.mutable_unchecked<3>();
  for (std::size_t i = 0; i < poses.size(); ++i)
    for (int row = 0; row < 4; ++row)
      for (int c = 0; c < 4; ++c) values(static_cast<py::ssize_t>(i), row, c) = poses[i].matrix()(row, c);
  return array;
}

py::array_t<float> to_array(const std::vector<Point>& points) {
  py::array_t<float> array({static_cast<py::ssize_t>(points.size()), py::ssize_t{4}});
  if (!points.empty()) std::memcpy(array.mutable_data(), points.data(), points.size() * sizeof(Point));
  return array;
}

}  // namespace revisit::python
