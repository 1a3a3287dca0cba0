// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <revisit/core/log.hpp>
#include <revisit/core/result.hpp>
#include <revisit/core/scan.hpp>

namespace revisit {

/// Points as records of fields: a PointCloud2 of ROS, whoever holds it (a bag, a node, a PCD file).
struct PointCloudView {
  struct Field {
    std::string name;
    std::uint32_t offset = 0;  ///< in the record, bytes
    std::uint8_t type = 0;     ///< 1 to 8: int8, uint8, int16, uint16, int32, uint32, float32, float64
  };
  std::vector<Field> fields;
  std::size_t width = 0, height = 1;
  std::size_t point_step = 0, row_step = 0;  ///< bytes; 0 for a row_step means width * point_step
  bool is_big_endian = false;
  std::span<const std::uint8_t> data;
};

/// How the stamp and the point times of a cloud were understood.
struct PointTimes {
  enum class Meaning : std::uint8_t {
    kNone,           ///< no field of times, or none that can be a sweep's
    kFromStamp,      ///< counted from the stamp
    kAbsolute,       ///< on the clock of the stamp
    kFromFirstPoint  ///< on another clock, or without a stamp: the first point is taken to lie at the stamp
  } meaning = Meaning::kNone;
  std::string field;    ///< the field's name; two joined by '+' where seconds and nanoseconds stand apart
  double unit_s = 0.0;  ///< of the field
  double first_s = 0.0, last_s = 0.0;  ///< from the stamp
};

/// The scan in a cloud of any field layout. Fields are found by the names that drivers use (docs/formats.md). Points
/// that are not finite or at (0,0,0) are dropped and counted. `stamp_s` is the cloud's, if it has one; point times
/// count from it. `what` names the cloud in messages. Safe to call from several threads.
Result<Scan> to_scan(const PointCloudView& cloud, const std::optional<double>& stamp_s, const std::string& what,
                     const LogSink& log = {}, PointTimes* times = nullptr);

}  // namespace revisit
