// SPDX-License-Identifier: Apache-2.0
#include <revisit/simulation/sensor_model.hpp>

#include <algorithm>

namespace revisit {
namespace {

// `count` lines from `first_deg` down in equal steps.
std::vector<double> lines(int count, double first_deg, double last_deg) {
  std::vector<double> elevations;
  elevations.reserve(static_cast<std::size_t>(count));
  for (int i = 0; i < count; ++i) elevations.push_back(first_deg + (last_deg - first_deg) * i / (count - 1));
  return elevations;
}

std::vector<double> joined(std::vector<double> upper, const std::vector<double>& lower) {
  upper.insert(upper.end(), lower.begin(), lower.end());
  return upper;
}

// Geometry, range and rate from the makers' data sheets; noise, drop-outs and intensity set beside real scans
// (docs/simulation.md).
std::vector<SensorModel> make_table() {
  SensorModel hdl64;
  hdl64.name = "hdl64e";
  hdl64.title = "Velodyne HDL-64E";
  hdl64.elevations_deg = joined(lines(32, 2.0, -8.333), lines(32, -8.833, -24.333));
  hdl64.columns = 2000;
  hdl64.min_range_m = 0.9;
  hdl64.range_noise_m = 0.012;
  hdl64.line_bias_m = 0.008;
  hdl64.visible_10_percent_m = 50.0;
  hdl64.drop_out = 0.02;
  hdl64.gain_spread = 0.15;
  hdl64.falloff = 0.35;
  hdl64.intensity_noise = 0.12;
  hdl64.dark = 0.09;
  hdl64.intensity_max = 0.99;

  SensorModel vlp16;
  vlp16.name = "vlp16";
  vlp16.title = "Velodyne VLP-16";
  vlp16.elevations_deg = lines(16, 15.0, -15.0);
  vlp16.columns = 1800;
  vlp16.max_range_m = 100.0;
  vlp16.range_noise_m = 0.015;
  vlp16.line_bias_m = 0.003;
  vlp16.visible_10_percent_m = 40.0;
  vlp16.drop_out = 0.01;
  vlp16.intensity_scale = 100.0;
  vlp16.intensity_step = 1.0;
  vlp16.intensity_max = 255.0;
  vlp16.falloff = 0.2;

  SensorModel os0;
  os0.name = "os0-128";
  os0.title = "Ouster OS0-128, 360 x 90 degrees";
  os0.elevations_deg = lines(128, 45.0, -45.0);
  os0.columns = 1024;
  os0.mast_m = 1.0;
  os0.max_range_m = 75.0;
  os0.min_range_m = 0.4;
  os0.range_noise_m = 0.012;
  os0.range_step_m = 0.001;
  os0.visible_10_percent_m = 30.0;
  os0.drop_out = 0.015;
  os0.gain_spread = 0.04;
  os0.focus_m = 4.0;
  os0.falloff = 1.6;  // signal, not reflectivity: it falls fast
  os0.intensity_scale = 2500.0;
  os0.intensity_step = 1.0;
  os0.intensity_max = 65535.0;

  SensorModel rosette;
  rosette.name = "rosette";
  rosette.title = "a forward, non-repetitive sensor of 70 degrees (as Livox Avia)";
  rosette.columns = 24000;
  rosette.rosette_half_angle_deg = 35.2;
  rosette.max_range_m = 190.0;
  rosette.min_range_m = 0.5;
  rosette.range_noise_m = 0.02;
  rosette.range_step_m = 0.001;
  rosette.visible_10_percent_m = 90.0;
  rosette.drop_out = 0.01;
  rosette.gain_spread = 0.02;
  rosette.falloff = 0.15;
  rosette.intensity_scale = 150.0;
  rosette.intensity_step = 1.0;
  rosette.intensity_max = 255.0;

  SensorModel os1 = os0;
  os1.name = "os1-64";
  os1.title = "Ouster OS1-64";
  os1.elevations_deg = lines(64, 16.6, -16.6);
  os1.mast_m = 0.4;
  os1.max_range_m = 120.0;
  os1.min_range_m = 0.8;
  os1.range_noise_m = 0.02;
  os1.range_step_m = 0.003;
  os1.visible_10_percent_m = 45.0;

  SensorModel dome = rosette;
  dome.name = "mid360";
  dome.title = "Livox Mid-360, all round, non-repetitive";
  dome.columns = 20000;
  dome.rosette_half_angle_deg = 0.0;
  dome.lowest_deg = -7.0;
  dome.highest_deg = 52.0;
  dome.max_range_m = 70.0;
  dome.min_range_m = 0.1;
  dome.visible_10_percent_m = 40.0;
  return {hdl64, vlp16, os0, rosette, os1, dome};
}

}  // namespace

const std::vector<SensorModel>& sensor_models() {
  static const std::vector<SensorModel> table = make_table();
  return table;
}

Result<SensorModel> find_sensor_model(std::string_view name) {
  std::string known;
  for (const SensorModel& model : sensor_models()) {
    if (model.name == name) return model;
    known += (known.empty() ? "" : ", ") + model.name;
  }
  return Error{"simulation.sensor = '" + std::string(name) + "' is not known; allowed: " + known};
}

}  // namespace revisit
