// SPDX-License-Identifier: Apache-2.0
#include <revisit/io/calibration_file.hpp>

#include <algorithm>
#include <cmath>

#include <nlohmann/json.hpp>

#include <revisit/io/internal/bytes.hpp>
#include <revisit/io/result_files.hpp>

namespace revisit {

Result<IntensityCalibration> read_calibration(const std::filesystem::path& file) {
  const auto text = io_internal::read_bytes(file);
  if (!text) return text.error();
  const auto wrong = [&](const std::string& what) { return Error{file.string() + ": " + what}; };
  IntensityCalibration calibration;
  try {
    const auto document = nlohmann::json::parse(*text);
    if (document.at("format") != "revisit intensity calibration" || document.at("version") != 1)
      return wrong("not an intensity calibration of version 1");
    calibration.distance_knots_m = document.at("distance_knots_m").get<std::vector<double>>();
    calibration.distance_gains = document.at("distance_gains").get<std::vector<double>>();
    calibration.ring_gains = document.at("ring_gains").get<std::vector<double>>();
  } catch (const nlohmann::json::exception& problem) {
    return wrong(std::string("not an intensity calibration: ") + problem.what());
  }
  const auto& knots = calibration.distance_knots_m;
  if (knots.size() != calibration.distance_gains.size())
    return wrong(std::to_string(knots.size()) + " distance knots for " +
                 std::to_string(calibration.distance_gains.size()) + " gains");
  const auto not_increasing = [](double a, double b) { return !(a < b); };
  if (std::adjacent_find(knots.begin(), knots.end(), not_increasing) != knots.end())
    return wrong("distance knots must increase");
  for (const auto* gains : {&calibration.distance_gains, &calibration.ring_gains})
    for (const double gain : *gains)
      if (!(std::isfinite(gain) && gain > 0.0)) return wrong("gain " + std::to_string(gain) + "; allowed: above 0");
  return calibration;
}

Status write_calibration(const std::filesystem::path& file, const IntensityCalibration& calibration) {
  const nlohmann::ordered_json document = {{"format", "revisit intensity calibration"},
                                           {"version", 1},
                                           {"distance_knots_m", calibration.distance_knots_m},
                                           {"distance_gains", calibration.distance_gains},
                                           {"ring_gains", calibration.ring_gains}};
  return write_text(file, document.dump(2) + "\n");
}

}  // namespace revisit
