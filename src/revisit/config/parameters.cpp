// SPDX-License-Identifier: Apache-2.0
#include <revisit/config/parameters.hpp>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <functional>
#include <numeric>
#include <stdexcept>
#include <variant>

namespace revisit {
namespace {

using Field = std::variant<std::function<double&(Parameters&)>, std::function<int&(Parameters&)>,
                           std::function<bool&(Parameters&)>, std::function<std::string&(Parameters&)>>;

struct Entry {
  std::string name;
  Field field;
  double min, max;
  std::string help;
  std::string choices = {};  ///< of a text: separated by ", "; empty: any
};

#define REVISIT_FIELD(type, section, field) \
  std::function<type&(Parameters&)>([](Parameters& p) -> type& { return p.section.field; })
#define REVISIT_REAL(section, field, min, max, help) \
  Entry { #section "." #field, REVISIT_FIELD(double, section, field), min, max, help }
#define REVISIT_INTEGER(section, field, min, max, help) \
  Entry { #section "." #field, REVISIT_FIELD(int, section, field), min, max, help }
#define REVISIT_SWITCH(section, field, help) \
  Entry { #section "." #field, REVISIT_FIELD(bool, section, field), 0, 0, help }

#define REVISIT_TEXT(section, field, help) \
  Entry { #section "." #field, REVISIT_FIELD(std::string, section, field), 0, 0, help }
#define REVISIT_CHOICE(section, field, choices, help) \
  Entry { #section "." #field, REVISIT_FIELD(std::string, section, field), 0, 0, help, choices }

// The one table from which flags, file format, validation and reference page are made.
const std::vector<Entry>& table() {
  static const std::vector<Entry> entries = {
      REVISIT_REAL(preprocess, min_range_m, 0, 20, "nearer returns are dropped: they are the vehicle itself"),
      REVISIT_REAL(preprocess, max_range_m, 5, 500, "farther returns are dropped: noise grows with distance"),
      REVISIT_REAL(preprocess, elevation_offset_deg, -2, 2,
                   "added to the elevation of every point; `revisit calibrate` finds it"),
      REVISIT_SWITCH(preprocess, remove_ground, "describe the scan without its ground"),
      REVISIT_REAL(intensity, full_scale, 0, 1e9, "raw intensity that becomes 1; 0 finds it from the first scans"),
      REVISIT_INTEGER(descriptor, rings, 1, 512, "N_r, radial bins of the polar grid"),
      REVISIT_INTEGER(descriptor, sectors, 1, 720, "N_s, azimuthal bins of the polar grid"),
      REVISIT_INTEGER(
          descriptor, levels, 0, 8,
          "layers of the binary image, each of what stands higher above the ground; 0 makes one of all points"),
      REVISIT_REAL(descriptor, max_range_m, 1, 500, "L_max, outer radius of the polar grid"),
      REVISIT_INTEGER(retrieval, top_k, 1, 1000, "candidates returned for a query, best first"),
      REVISIT_REAL(retrieval, intensity_weight, 0, 1, "weight of the intensity score beside the geometry score"),
      REVISIT_REAL(retrieval, min_geometry_score, 0, 1, "epsilon_g, least geometry score of a candidate"),
      REVISIT_REAL(retrieval, min_intensity_score, 0, 1, "epsilon_i, least intensity score of a candidate"),
      REVISIT_INTEGER(retrieval, exclude_frames, 1, 10000000, "places fewer frames before the query are not searched"),
      REVISIT_REAL(retrieval, exclude_s, 0, 1e9, "places fewer seconds before the query are not searched"),
      REVISIT_REAL(temporal, min_score, 0, 2, "xi, least mean of geometry plus intensity score; 0 never refuses"),
      REVISIT_INTEGER(geometric, candidates, 1, 1000,
                      "how many poses of the top-K candidates are registered, those that overlap most first"),
      REVISIT_SWITCH(geometric, overhead_search,
                     "find position and heading by laying the scans on each other from overhead before registering"),
      REVISIT_SWITCH(geometric, follow,
                     "test first the place that the last loops and odometry predict, and let them support what agrees"),
      REVISIT_REAL(geometric, min_overlap, 0, 1,
                   "least overlap from overhead, the smaller of both directions, that is worth registering; two thirds "
                   "of it for a scan alone in a map"),
      REVISIT_CHOICE(
          geometric, features, "never, fallback, first",
          "FPFH features: never; as a fallback where the yaw of the descriptors gave no loop (slow); or first, "
          "as in the paper"),
      REVISIT_REAL(geometric, min_inlier_ratio, 0, 1,
                   "share of the points above ground, in both directions, that must be inliers"),
      REVISIT_REAL(geometric, min_probability, 0, 1,
                   "least probability that the pose is right, from all evidence together; 0 never refuses"),
      REVISIT_REAL(slam, keyframe_distance_m, 0.05, 100, "a key frame at the latest after so many metres"),
      REVISIT_REAL(slam, keyframe_angle_deg, 1, 180, "a key frame at the latest after a turn by so much"),
      REVISIT_REAL(slam, map_voxel_m, 0.02, 5, "edge of the voxels of the map: one point each"),
      REVISIT_TEXT(simulation, world, "what is driven through: town, warehouse or building"),
      REVISIT_TEXT(simulation, sensor, "the sensor: hdl64e, vlp16, os0-128, os1-64, mid360 or rosette"),
      REVISIT_TEXT(simulation, trajectory,
                   "pose file (KITTI, TUM, g2o) to drive along; without, the world has a drive of its own"),
      REVISIT_INTEGER(simulation, seed, 0, 1000000000,
                      "another number, another world; the same number, the same bytes"),
      REVISIT_REAL(simulation, difficulty, 0, 2,
                   "how much changes between visits, looks alike, hides, shakes and errs: 0 tame, 1 as real roads"),
      REVISIT_REAL(simulation, length_m, 20, 50000, "length of a drive of its own"),
      REVISIT_INTEGER(
          simulation, day, 0, 1000000,
          "another day in the same world: parked cars, traffic, foliage, weather and the sensor's errors differ"),
      REVISIT_REAL(simulation, from_m, 0, 50000, "drives only the part of the way that begins after so many metres"),
      REVISIT_REAL(simulation, to_m, 0, 50000, "and ends after so many; 0 for its end"),
      REVISIT_SWITCH(simulation, reverse, "drives the way from its end to its beginning"),
      REVISIT_REAL(simulation, beside_m, -1, 2.5, "drives so far to the left of the way"),
      REVISIT_INTEGER(simulation, frames, 0, 10000000, "only the first so many scans; 0 for all of the drive"),
      REVISIT_REAL(simulation, tilt_deg, 0, 40, "how far a sensor carried by hand leans to and fro, at most"),
      REVISIT_REAL(simulation, blind_deg, 0, 300, "what carries the sensor hides so much of the view behind it"),
      REVISIT_SWITCH(simulation, motion_distortion,
                     "the sensor moves on while it sweeps; false: each scan is taken at once"),
      REVISIT_SWITCH(simulation, imu,
                     "the sensor has an IMU inside, with noise and bias; scans and bags then hold its readings"),
      REVISIT_SWITCH(simulation, gps,
                     "the vehicle has a GPS receiver, off by a metre or two and now and then by far more"),
      REVISIT_REAL(simulation, traffic, 0, 5, "how many vehicles and people move about, as a multiple of the default"),
  };
  return entries;
}

#undef REVISIT_CHOICE
#undef REVISIT_TEXT
#undef REVISIT_SWITCH
#undef REVISIT_INTEGER
#undef REVISIT_REAL
#undef REVISIT_FIELD

std::string to_text(double value) {
  char buffer[32];
  const auto end = std::to_chars(buffer, buffer + sizeof buffer, value).ptr;
  return {buffer, end};
}

std::string value_text(const Entry& entry, Parameters& parameters) {
  return std::visit(
      [&](const auto& get) -> std::string {
        const auto value = get(parameters);
        if constexpr (std::is_same_v<decltype(value), const bool>)
          return value ? "true" : "false";
        else if constexpr (std::is_same_v<decltype(value), const std::string>)
          return value;
        else
          return to_text(static_cast<double>(value));
      },
      entry.field);
}

std::string range_text(const Entry& entry) { return to_text(entry.min) + " to " + to_text(entry.max); }

std::size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 0; i < a.size(); ++i) {
    std::size_t diagonal = row[0]++;
    for (std::size_t j = 0; j < b.size(); ++j) {
      const std::size_t replaced = diagonal + (a[i] != b[j]);
      diagonal = row[j + 1];
      row[j + 1] = std::min({replaced, row[j] + 1, row[j + 1] + 1});
    }
  }
  return row.back();
}

Error unknown_name(std::string_view name) {
  const auto& nearest = *std::min_element(table().begin(), table().end(), [&](const Entry& a, const Entry& b) {
    return edit_distance(name, a.name) < edit_distance(name, b.name);
  });
  return {"unknown parameter '" + std::string(name) + "'; did you mean '" + nearest.name + "'?"};
}

const Entry* find(std::string_view name) {
  const auto& entries = table();
  const auto found = std::find_if(entries.begin(), entries.end(), [&](const Entry& e) { return e.name == name; });
  return found == entries.end() ? nullptr : &*found;
}

}  // namespace

std::vector<ParameterInfo> parameter_infos() {
  Parameters defaults;
  std::vector<ParameterInfo> infos;
  for (const Entry& entry : table())
    infos.push_back({entry.name, entry.help, value_text(entry, defaults), entry.min, entry.max,
                     std::holds_alternative<std::function<bool&(Parameters&)>>(entry.field),
                     std::holds_alternative<std::function<int&(Parameters&)>>(entry.field),
                     std::holds_alternative<std::function<std::string&(Parameters&)>>(entry.field), entry.choices});
  return infos;
}

std::string allowed_values(const ParameterInfo& info) {
  if (info.is_text) return info.choices.empty() ? "text" : info.choices;
  if (info.is_switch) return "true or false";
  return to_text(info.min) + " to " + to_text(info.max) + (info.is_integer ? ", whole" : "");
}

std::vector<std::string> preset_names() { return {"default", "paper", "grid20x60"}; }

Result<Parameters> preset(std::string_view name) {
  Parameters p;
  if (name == "default") return p;
  if (name == "grid20x60") {
    p.descriptor.rings = 20;
    p.descriptor.sectors = 60;
    p.descriptor.levels = 0;
    p.descriptor.max_range_m = 50.0;
    return p;
  }
  if (name == "paper") {  // table I of the paper, to the letter
    p.preprocess.max_range_m = p.descriptor.max_range_m = 50.0;
    p.preprocess.remove_ground = true;
    p.descriptor.sectors = 20;
    p.descriptor.rings = 60;
    p.descriptor.levels = 0;
    p.retrieval.top_k = 5;
    p.retrieval.separation_frames = 0;
    p.retrieval.intensity_weight = 1.0;
    p.retrieval.shortlist = 0;
    p.retrieval.min_geometry_score = 0.9;
    p.retrieval.min_intensity_score = 0.92;
    p.temporal.min_score = 1.8;
    p.geometric.min_inlier_ratio = 0.6;
    p.geometric.min_probability = 0.0;
    p.geometric.overhead_search = false;
    p.geometric.follow = false;
    p.geometric.features = "first";
    return p;
  }
  std::string known;
  for (const auto& each : preset_names()) known += (known.empty() ? "" : ", ") + each;
  return Error{"unknown preset '" + std::string(name) + "'; known: " + known};
}

Status set_parameter(Parameters& parameters, std::string_view name, std::string_view value) {
  const Entry* entry = find(name);
  if (entry == nullptr) return unknown_name(name);
  const auto refuse = [&](const std::string& allowed) {
    return Error{entry->name + " = " + std::string(value) + " is not allowed; allowed: " + allowed};
  };
  if (const auto* get = std::get_if<std::function<bool&(Parameters&)>>(&entry->field)) {
    if (value != "true" && value != "false") return refuse("true or false");
    (*get)(parameters) = value == "true";
    return ok();
  }
  if (const auto* get = std::get_if<std::function<std::string&(Parameters&)>>(&entry->field)) {
    // Choices stand between ", ": whole ones only.
    if (!entry->choices.empty() &&
        (", " + entry->choices + ", ").find(", " + std::string(value) + ", ") == std::string::npos)
      return refuse(entry->choices);
    (*get)(parameters) = value;
    return ok();
  }
  double number = 0.0;
  const auto [end, failure] = std::from_chars(value.data(), value.data() + value.size(), number);
  const bool parsed = failure == std::errc() && end == value.data() + value.size() && std::isfinite(number);
  const bool in_range = parsed && number >= entry->min && number <= entry->max;
  if (const auto* get = std::get_if<std::function<int&(Parameters&)>>(&entry->field)) {
    if (!in_range || number != std::floor(number)) return refuse("a whole number, " + range_text(*entry));
    (*get)(parameters) = static_cast<int>(number);
    return ok();
  }
  if (!in_range) return refuse(range_text(*entry));
  std::get<std::function<double&(Parameters&)>>(entry->field)(parameters) = number;
  return ok();
}

std::string get_parameter(const Parameters& parameters, std::string_view name) {
  const Entry* entry = find(name);
  if (entry == nullptr) throw std::invalid_argument(unknown_name(name).message);
  Parameters copy = parameters;
  return value_text(*entry, copy);
}

Status validate(const Parameters& parameters) {
  Parameters copy = parameters;
  for (const Entry& entry : table()) {
    const Status status = set_parameter(copy, entry.name, get_parameter(parameters, entry.name));
    if (!status) return status;
  }
  if (parameters.preprocess.min_range_m >= parameters.preprocess.max_range_m)
    return Error{
        "preprocess.min_range_m = " + to_text(parameters.preprocess.min_range_m) +
        " is not allowed; allowed: less than preprocess.max_range_m = " + to_text(parameters.preprocess.max_range_m)};
  if (parameters.descriptor.max_range_m > parameters.preprocess.max_range_m)
    return Error{
        "descriptor.max_range_m = " + to_text(parameters.descriptor.max_range_m) +
        " is not allowed; allowed: up to preprocess.max_range_m = " + to_text(parameters.preprocess.max_range_m)};
  return ok();
}

const Parameters& require_valid(const Parameters& parameters) {
  if (const Status status = validate(parameters); !status) throw std::invalid_argument(status.error().message);
  return parameters;
}

}  // namespace revisit
