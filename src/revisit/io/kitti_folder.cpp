// SPDX-License-Identifier: Apache-2.0
#include <chrono>
#include <cmath>
#include <cstdio>

#include <revisit/io/internal/bytes.hpp>
#include <revisit/io/internal/kitti_folder.hpp>

namespace revisit::io_internal {
namespace {

// The numbers behind "KEY:" in a file of such lines.
Result<std::vector<double>> keyed_numbers(const std::filesystem::path& file, const std::string& key,
                                          std::size_t count) {
  const auto text = read_bytes(file);
  if (!text) return text.error();
  for (std::string_view line : split_lines(*text)) {
    if (line.substr(0, key.size() + 1) != key + ":") continue;
    auto values = parse_numbers(line.substr(key.size() + 1));
    if (!values || values->size() != count)
      return Error{file.string() + ": row '" + key + ":' needs " + std::to_string(count) + " numbers"};
    return *values;
  }
  return Error{file.string() + ": no row '" + key + ":'"};
}

Result<Pose> to_pose(const std::filesystem::path& file, const Eigen::Matrix3d& R, const Eigen::Vector3d& t) {
  if (!R.allFinite() || !t.allFinite() || (R * R.transpose() - Eigen::Matrix3d::Identity()).norm() > 1e-2)
    return Error{file.string() + ": the calibration is not a rigid transform"};
  Pose T = Pose::Identity();
  T.linear() = Eigen::Quaterniond(R).normalized().toRotationMatrix();
  T.translation() = t;
  return T;
}

}  // namespace

Result<Pose> read_kitti_calibration(const std::filesystem::path& file, const std::string& key) {
  const auto v = keyed_numbers(file, key, 12);
  if (!v) return v.error();
  const Eigen::Matrix<double, 3, 4> M = Eigen::Map<const Eigen::Matrix<double, 3, 4, Eigen::RowMajor>>(v->data());
  return to_pose(file, M.leftCols<3>(), M.col(3));
}

bool is_calibration_of_kitti(const std::filesystem::path& file) {
  for (const char* key : {"P0", "P_rect_00"})
    if (const auto P = keyed_numbers(file, key, 12))
      for (const double of_kitti : {718.856, 721.5377, 707.0912})  // of its three calibrations
        if (std::abs((*P)[0] - of_kitti) < 1e-3) return true;
  return false;
}

Result<Pose> read_kitti_raw_calibration(const std::filesystem::path& file) {
  const auto R = keyed_numbers(file, "R", 9);
  if (!R) return R.error();
  const auto t = keyed_numbers(file, "T", 3);
  if (!t) return t.error();
  return to_pose(file, Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(R->data()),
                 Eigen::Map<const Eigen::Vector3d>(t->data()));
}

Result<std::vector<double>> read_times(const std::filesystem::path& file) {
  const auto rows = read_number_rows(file);
  if (!rows) return rows.error();
  std::vector<double> times;
  for (const NumberRow& row : *rows) {
    if (row.values.size() != 1 || !std::isfinite(row.values[0]))
      return Error{file.string() + ":" + std::to_string(row.line) + ": one time in seconds a row is needed"};
    times.push_back(row.values[0]);
  }
  return times;
}

Result<std::vector<double>> read_timestamps(const std::filesystem::path& file) {
  const auto text = read_bytes(file);
  if (!text) return text.error();
  std::vector<double> times;
  for (std::string_view line : split_lines(*text)) {
    if (split_words(line).empty()) continue;
    int year = 0, hour = 0, minute = 0;
    unsigned month = 0, day = 0;
    double second = 0.0;
    if (std::sscanf(std::string(line).c_str(), "%d-%u-%u %d:%d:%lf", &year, &month, &day, &hour, &minute, &second) != 6)
      return Error{file.string() + ": '" + std::string(line.substr(0, 40)) + "' is not 'YYYY-MM-DD hh:mm:ss.s'"};
    const std::chrono::year_month_day ymd = std::chrono::year(year) / std::chrono::month(month) / std::chrono::day(day);
    if (!ymd.ok() || hour < 0 || hour > 23 || minute < 0 || minute > 59 || !(second >= 0.0 && second < 61.0))
      return Error{file.string() + ": '" + std::string(line.substr(0, 40)) + "' is no date and time"};
    const std::chrono::sys_days date = ymd;
    times.push_back(static_cast<double>(date.time_since_epoch().count()) * 86400.0 + hour * 3600.0 + minute * 60.0 +
                    second);
  }
  return times;
}

}  // namespace revisit::io_internal
