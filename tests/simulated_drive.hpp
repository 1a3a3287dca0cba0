// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstring>
#include <memory>
#include <string>

#include <gtest/gtest.h>

#include <revisit/simulation/simulated_recording.hpp>

namespace revisit::testing_support {

inline SimulationOptions small_drive(const std::string& world, const std::string& sensor = "vlp16") {
  SimulationOptions options;
  options.world = world;
  options.sensor = sensor;
  options.length_m = 60.0;
  return options;
}

inline std::unique_ptr<SimulatedRecording> make(const SimulationOptions& options, int threads = 0) {
  auto recording = simulate(options, {}, threads);
  EXPECT_TRUE(recording) << (recording ? "" : recording.error().message);
  return recording ? *std::move(recording) : nullptr;
}

inline std::string refusal(const SimulationOptions& options) {
  const auto recording = simulate(options);
  return recording ? "" : recording.error().message;
}

inline bool same_bytes(const Scan& a, const Scan& b) {
  return a.points.size() == b.points.size() && a.rings == b.rings && a.times_s == b.times_s &&
         std::memcmp(a.points.data(), b.points.data(), a.points.size() * sizeof(Point)) == 0;
}

}  // namespace revisit::testing_support
