// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include <revisit/core/result.hpp>

namespace revisit {

/// How a simulated LiDAR looks about, errs and measures light. One row of the table in sensor_model.cpp a sensor.
struct SensorModel {
  std::string name;   ///< as the user gives it
  std::string title;  ///< as people call it
  double sweep_s = 0.1;

  // Rotating sensors: lines by columns. Empty elevations: `columns` beams a sweep that never repeat, in a circle ahead
  // (rosette) or all round (dome).
  std::vector<double> elevations_deg;          ///< of each line, from the highest
  int columns = 0;                             ///< beams of a line in one turn; all beams of a rosette or dome
  double rosette_half_angle_deg = 0.0;         ///< 0: a dome
  double lowest_deg = 0.0, highest_deg = 0.0;  ///< of a dome

  double mast_m = 0.3;  ///< from the vehicle's roof up to the sensor
  double min_range_m = 0.5, max_range_m = 120.0;
  double range_noise_m = 0.01;       ///< standard deviation of a beam
  double line_bias_m = 0.0;          ///< standard deviation of what each line is always off by
  double range_step_m = 0.002;       ///< ranges are whole multiples
  double visible_10_percent_m = 50;  ///< how far a target of 10 % reflectance is seen
  double drop_out = 0.01;            ///< share of beams that get no answer for no reason

  double gain_spread = 0.05;      ///< standard deviation of the gains of the lines
  double intensity_noise = 0.05;  ///< standard deviation, share of the reading
  double focus_m = 15.0;          ///< readings are compensated for distance up to here, and fall behind it
  double falloff = 0.5;           ///< ... with distance to this power
  double intensity_scale = 1.0;   ///< reading of a white target
  double intensity_step = 0.01;   ///< readings are whole multiples
  double dark = 0.0;              ///< share of the readings that are 0
  double intensity_max = 1.0;     ///< larger readings saturate

  bool rotates() const { return !elevations_deg.empty(); }
  bool is_dome() const { return highest_deg > lowest_deg; }
  std::size_t beams() const { return static_cast<std::size_t>(columns) * (rotates() ? elevations_deg.size() : 1); }
};

/// All sensors there are.
const std::vector<SensorModel>& sensor_models();
/// The one of that name; the error lists the known names.
Result<SensorModel> find_sensor_model(std::string_view name);

}  // namespace revisit
