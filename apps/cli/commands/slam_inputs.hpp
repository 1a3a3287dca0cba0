// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <revisit/core/gps_fix.hpp>
#include <revisit/core/intensity_calibration.hpp>
#include <revisit/io/recording.hpp>
#include <revisit/pipeline/slam.hpp>

#include "common.hpp"

namespace revisit::cli {

/// The flags of `revisit slam`.
struct SlamOptions {
  std::string input, out, into, poses, calibration, odometry, wheels;
  std::optional<std::string> gps;
  double sweep_s = 0.0;
  bool overwrite = false, resume = false, without_map = false, is_viewed = false;
  double checkpoint_s = SlamSetup().checkpoint_every_s;
  InputFlags recording;
  ParameterFlags parameters;
};

/// The pose that stands in for, or helps, the tracking of scan `index`, if there is one.
using OtherOdometry = std::function<std::optional<Pose>(std::size_t index)>;

/// What --wheels or --odometry name. The recording outlives it.
Result<OtherOdometry> other_odometry(const SlamOptions& options, const Recording& recording);

/// What --gps names: an NMEA log, or the recording's own receiver; none without it.
Result<std::vector<GpsFix>> gps_fixes(const SlamOptions& options, const Recording& recording);

/// The map that is begun, continued or added to.
Result<std::shared_ptr<MapStore>> open_store(const SlamOptions& options);

/// What the run goes by; `recording_name` is the recording as the map knows it. An error where the map was made of
/// another recording, or with other parameters, than the run that continues it.
Result<SlamSetup> slam_setup(const SlamOptions& options, const Parameters& parameters, const IntensityScale& scale,
                             const IntensityCalibration& calibration, std::vector<GpsFix> gps,
                             const std::string& recording_name, const MapStore& store);

}  // namespace revisit::cli
