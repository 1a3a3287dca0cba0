// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include <revisit/core/exclusion.hpp>
#include <revisit/core/result.hpp>

namespace revisit {

/// Range and ground filters in front of the descriptor (paper, section III-A).
struct PreprocessOptions {
  double min_range_m = 1.0;    ///< nearer returns are the vehicle itself
  double max_range_m = 80.0;   ///< farther returns are noise
  bool remove_ground = false;  ///< describe the scan without its ground
  /// Added to the elevation of every point: the HDL-64E of KITTI is off by 0.2 degrees. `revisit calibrate` finds it.
  double elevation_offset_deg = 0.0;
};

/// How raw intensity becomes [0, 1], decided once a recording.
struct IntensityOptions {
  double full_scale = 0.0;  ///< reading that becomes 1; 0 finds it from the first scans
};

/// The polar grid of intensity scan context (paper, section III-B).
struct DescriptorOptions {
  int rings = 20;             ///< N_r, radial bins
  int sectors = 30;           ///< N_s, azimuthal bins
  int levels = 4;             ///< layers of the image, by height above the ground; 0: one, of all points
  double max_range_m = 80.0;  ///< L_max
};

/// The two search stages (paper, section III-C) and which places may answer (ExclusionRule, docs/evaluation.md).
struct RetrievalOptions : ExclusionRule {
  int top_k = 20;                    ///< candidates returned, best first
  double intensity_weight = 0.1;     ///< of Phi_i beside Phi_g in the order of candidates; 1 in the paper
  double min_geometry_score = 0.0;   ///< epsilon_g
  double min_intensity_score = 0.0;  ///< epsilon_i
  // No parameters; the preset of the paper does without both.
  int separation_frames = 8;  ///< of places so few frames apart, one is returned: neighbours say the same
  int shortlist = 200;        ///< places of best geometry score that enter the intensity stage; 0 = all
};

/// Temporal consistency (paper, eq. 11).
struct TemporalOptions {
  double min_score = 0.0;  ///< xi, on Phi_g + Phi_i; 0 = reported but never refused
};

/// Geometric consistency (paper, section III-D): from overhead or FPFH, then ICP, then evidence (docs/method.md).
struct GeometricOptions {
  int candidates = 3;              ///< how many of the top-K are registered, best first
  bool overhead_search = true;     ///< find position and heading from overhead before registering
  bool follow = true;              ///< predict the place from the last loops and odometry, and let these support it
  double min_overlap = 0.3;        ///< of both images from overhead; candidates below are not registered
  std::string features = "never";  ///< FPFH: never; fallback, where the yaw gave no loop; first, as the paper
  double min_inlier_ratio = 0.25;  ///< share of the points above ground, both ways, that must be inliers
  double min_probability = 0.95;   ///< that the pose is right (docs/accuracy.md); 0 never refuses
};

/// Trajectory and map (docs/slam.md).
struct SlamOptions {
  double keyframe_distance_m = 1.5;  ///< a key frame at the latest after so much travelled distance
  double keyframe_angle_deg = 20.0;  ///< and after turning so much
  double map_voxel_m = 0.2;          ///< edge of the voxels of the map
};

/// A drive that is simulated instead of read (docs/simulation.md).
struct SimulationOptions {
  std::string world = "town";     ///< town, warehouse or building
  std::string sensor = "hdl64e";  ///< a row of the table of sensors
  std::string trajectory;         ///< pose file to drive along; empty: a drive of its own
  int seed = 1;
  double difficulty = 0.0;        ///< how much changes and errs: 0 tame, 1 as the real world (docs/simulation.md)
  double length_m = 1000.0;       ///< of a drive of its own
  int day = 0;                    ///< another day: another drive through the same world, parked cars and traffic differ
  double from_m = 0.0;            ///< only the part of the drive from here
  double to_m = 0.0;              ///< to here; 0: its end
  bool reverse = false;           ///< driven the other way round
  double beside_m = 0.0;          ///< driven so far to the left of the drive's way
  int frames = 0;                 ///< the first so many scans; 0: all of the drive
  double tilt_deg = 0.0;          ///< how far a sensor carried by hand leans, at most
  double blind_deg = 0.0;         ///< of the view behind the sensor, hidden by what carries it
  bool motion_distortion = true;  ///< the sensor moves while it sweeps
  bool imu = false;               ///< the sensor has an IMU inside
  bool gps = false;               ///< the vehicle has a GPS receiver
  double traffic = 1.0;           ///< how many move about, as a multiple of the default
};

/// Every parameter of the system, at the shipped defaults.
struct Parameters {
  PreprocessOptions preprocess;
  IntensityOptions intensity;
  DescriptorOptions descriptor;
  RetrievalOptions retrieval;
  TemporalOptions temporal;
  GeometricOptions geometric;
  SlamOptions slam;
  SimulationOptions simulation;
};

/// One parameter as the user meets it. The name is `section.field`, the unit its suffix.
struct ParameterInfo {
  std::string name;
  std::string help;
  std::string default_value;
  double min = 0.0, max = 0.0;  ///< inclusive; both 0 for a switch or a text
  bool is_switch = false;
  bool is_integer = false;
  bool is_text = false;
  std::string choices;  ///< of a text that is one of few, separated by commas
};

/// All parameters in the order of the reference page.
std::vector<ParameterInfo> parameter_infos();

/// The values that a parameter may have, in words.
std::string allowed_values(const ParameterInfo& info);

/// "default", "paper" (its printed thresholds, to the letter), "grid20x60" (the authors' program's grid).
std::vector<std::string> preset_names();
Result<Parameters> preset(std::string_view name);

/// Sets one parameter from text; the error names it, its value and the allowed range, or the nearest known name.
Status set_parameter(Parameters& parameters, std::string_view name, std::string_view value);
/// The value as text that set_parameter reads back. Throws std::invalid_argument for an unknown name.
std::string get_parameter(const Parameters& parameters, std::string_view name);

/// Names the first field that is outside its range.
Status validate(const Parameters& parameters);
/// The parameters themselves; throws std::invalid_argument where validate() finds one outside its range.
const Parameters& require_valid(const Parameters& parameters);

}  // namespace revisit
