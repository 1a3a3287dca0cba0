// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>

#include <revisit/core/pose.hpp>
#include <revisit/io/internal/byte_cursor.hpp>
#include <revisit/io/internal/packets.hpp>

namespace revisit::io_internal {
namespace {

// The makers' manuals: 12 blocks of 100 bytes (mark, azimuth in 0.01 degrees, 32 returns of distance and reflectivity),
// microseconds since the hour, return mode, model.
constexpr std::size_t kPacketBytes = 1206, kBlocks = 12, kBlockBytes = 100, kReturns = 32;
constexpr std::size_t kTimeAt = 1200, kModeAt = 1204, kModelAt = 1205;
constexpr std::uint16_t kMark = 0xEEFF;
constexpr std::uint8_t kLastReturn = 0x38, kDualReturn = 0x39;
constexpr int kFullCircle = 36000;  // 0.01 degrees
constexpr int kCut = 18000;         // scans begin behind the sensor

struct Model {
  std::uint8_t code;
  const char* name;
  std::size_t rings;
  double distance_unit_m;
  double firing_us;     ///< from one firing of all lasers to the next
  double laser_us;      ///< from one laser, or pair of lasers, to the next
  std::size_t at_once;  ///< lasers that fire together
  /// Two places where ROS's reference decoder departs from the manual, followed so that its clouds and ours agree: it
  /// interpolates the azimuth as if lasers of a pair fired one after the other, and not at all in a packet's last
  /// block.
  bool turns_each_laser, last_block_stands;
  std::array<float, kReturns> elevation_deg, azimuth_deg;

  constexpr double block_us() const {
    const std::size_t firings = kReturns / rings;
    return firing_us * static_cast<double>(firings);
  }
};

constexpr std::array<float, kReturns> kNone{};

// Returns 16 to 31 of a VLP-16 are those of its second firing.
constexpr Model kVlp16{0x22,
                       "VLP-16",
                       16,
                       0.002,
                       55.296,
                       2.304,
                       1,
                       false,
                       false,
                       {-15, 1, -13, 3, -11, 5, -9, 7, -7, 9, -5, 11, -3, 13, -1, 15,
                        -15, 1, -13, 3, -11, 5, -9, 7, -7, 9, -5, 11, -3, 13, -1, 15},
                       kNone};
constexpr Model kVlp32c{
    0x28,
    "VLP-32C",
    32,
    0.004,
    55.296,
    2.304,
    2,
    true,
    true,
    {-25.f,   -1.f,    -1.667f, -15.639f, -11.31f, 0.f,     -0.667f, -8.843f, -7.254f, 0.333f,  -0.333f,
     -6.148f, -5.333f, 1.333f,  0.667f,   -4.f,    -4.667f, 1.667f,  1.f,     -3.667f, -3.333f, 3.333f,
     2.333f,  -2.667f, -3.f,    7.f,      4.667f,  -2.333f, -2.f,    15.f,    10.333f, -1.333f},
    {1.4f, -4.2f, 1.4f, -1.4f, 1.4f, -1.4f, 4.2f, -1.4f, 1.4f, -4.2f, 1.4f, -1.4f, 4.2f, -1.4f, 4.2f, -1.4f,
     1.4f, -4.2f, 1.4f, -4.2f, 4.2f, -1.4f, 1.4f, -1.4f, 1.4f, -1.4f, 1.4f, -4.2f, 4.2f, -1.4f, 1.4f, -1.4f}};
constexpr Model kHdl32e{0x21,
                        "HDL-32E",
                        32,
                        0.002,
                        46.08,
                        1.152,
                        1,
                        false,
                        false,
                        {-30.67f, -9.33f,  -29.33f, -8.f,    -28.f,   -6.67f, -26.67f, -5.33f,  -25.33f, -4.f,    -24.f,
                         -2.67f,  -22.67f, -1.33f,  -21.33f, 0.f,     -20.f,  1.33f,   -18.67f, 2.67f,   -17.33f, 4.f,
                         -16.f,   5.33f,   -14.67f, 6.67f,   -13.33f, 8.f,    -12.f,   9.33f,   -10.67f, 10.67f},
                        kNone};

// Rings are numbered from the lowest beam to the highest.
std::array<std::uint16_t, kReturns> rings_of(const Model& model) {
  std::array<std::uint16_t, kReturns> rings{};
  for (std::size_t i = 0; i < kReturns; ++i)
    for (std::size_t j = 0; j < model.rings; ++j) rings[i] += model.elevation_deg[j] < model.elevation_deg[i];
  return rings;
}

class VelodyneDecoder final : public PacketDecoder {
 public:
  VelodyneDecoder(const Model& model, std::uint8_t code, bool is_dual, Echo echo)
      : model_(model), code_(code), is_dual_(is_dual), echo_(echo), rings_(rings_of(model)) {
    for (std::size_t i = 0; i < kReturns; ++i) {
      sin_elevation_[i] = std::sin(to_radians(static_cast<double>(model.elevation_deg[i])));
      cos_elevation_[i] = std::cos(to_radians(static_cast<double>(model.elevation_deg[i])));
    }
  }

  std::string sensor() const override { return model_.name + std::string(is_dual_ ? ", dual return" : ""); }
  std::size_t parts() const override { return is_dual_ ? kBlocks / 2 : kBlocks; }
  std::int64_t clock_period_ns() const override { return 3'600'000'000'000; }

  bool accepts(ByteSpan payload) const override {
    return payload.size() == kPacketBytes && payload[kModelAt] == code_ &&
           load_number<std::uint16_t>(payload.data()) == kMark && (payload[kModeAt] == kDualReturn) == is_dual_;
  }
  std::uint32_t phase(ByteSpan payload, std::size_t part) const override {
    return static_cast<std::uint32_t>((azimuth(payload, part) + kFullCircle - kCut) % kFullCircle);
  }
  bool begins_scan(std::uint32_t before, std::uint32_t now) const override {
    return now < before && !is_late(before, now);
  }
  // Less than half a turn back, across the cut, too.
  bool is_late(std::uint32_t before, std::uint32_t now) const override {
    return (now + kFullCircle - before) % kFullCircle > kFullCircle / 2;
  }
  std::int64_t time_ns(ByteSpan payload, std::size_t part) const override {
    return std::int64_t{load_number<std::uint32_t>(payload.data() + kTimeAt)} * 1000 +
           static_cast<std::int64_t>(1e3 * part_us() * static_cast<double>(part));
  }

  void decode(ByteSpan payload, std::size_t first, std::size_t end, PacketPoints& points) const override {
    for (std::size_t part = first; part < end; ++part) {
      const double turn = turn_of(payload, part);  // 0.01 degrees to the next part
      for (std::size_t i = 0; i < kReturns; ++i) add_return(payload, part, i, turn, points);
    }
  }

 private:
  // Two blocks at one moment hold the two echoes of dual return.
  const std::uint8_t* block(ByteSpan payload, std::size_t part) const {
    return payload.data() + part * (is_dual_ ? 2 : 1) * kBlockBytes;
  }
  int azimuth(ByteSpan payload, std::size_t part) const {
    return load_number<std::uint16_t>(block(payload, part) + 2) % kFullCircle;
  }
  double part_us() const { return model_.block_us(); }
  double turn_of(ByteSpan payload, std::size_t part) const {
    if (part + 1 == parts() && (model_.last_block_stands || is_dual_)) return 0.0;
    // At the end of a packet as from the part before.
    const std::size_t from = part + 1 < parts() ? part : part - 1;
    return (azimuth(payload, from + 1) - azimuth(payload, from) + kFullCircle) % kFullCircle;
  }

  void add_return(ByteSpan payload, std::size_t part, std::size_t i, double turn, PacketPoints& points) const {
    constexpr std::size_t kHead = 4, kReturnBytes = 3;
    const std::uint8_t* at = block(payload, part) + kHead + kReturnBytes * i;
    if (is_dual_) {  // the last echo comes first
      const std::uint8_t* strongest = at + kBlockBytes;
      const bool is_empty = load_number<std::uint16_t>(strongest) == 0;
      if (echo_ == Echo::kStrongest && !is_empty && strongest[2] >= at[2]) at = strongest;
    }
    const auto distance = load_number<std::uint16_t>(at);
    if (distance == 0) {
      ++points.scan.dropped_at_origin;
      return;
    }
    const std::size_t laser = i % model_.rings, fires_after = laser / model_.at_once;
    const double after_us =
        model_.laser_us * static_cast<double>(fires_after) + (i >= model_.rings ? model_.firing_us : 0.0);
    const double turns_for_us = model_.turns_each_laser ? model_.laser_us * static_cast<double>(laser) : after_us;
    // To the hundredth of a degree, in which blocks count.
    const double turned = std::round(azimuth(payload, part) + turn * turns_for_us / part_us());
    const double azimuth_rad = to_radians(0.01 * turned + static_cast<double>(model_.azimuth_deg[i]));
    const double range_m = distance * model_.distance_unit_m;
    const double level_m = range_m * cos_elevation_[i];
    points.add(
        {static_cast<float>(level_m * std::cos(azimuth_rad)), static_cast<float>(-level_m * std::sin(azimuth_rad)),
         static_cast<float>(range_m * sin_elevation_[i]), static_cast<float>(at[2])},
        rings_[i], time_ns(payload, part) + static_cast<std::int64_t>(1e3 * after_us));
  }

  const Model& model_;
  std::uint8_t code_;  ///< that its packets bear
  bool is_dual_;
  Echo echo_;
  std::array<std::uint16_t, kReturns> rings_;
  std::array<double, kReturns> sin_elevation_{}, cos_elevation_{};
};

}  // namespace

std::unique_ptr<PacketDecoder> velodyne_decoder(ByteSpan payload, ByteSpan next, Echo echo) {
  if (payload.size() != kPacketBytes || load_number<std::uint16_t>(payload.data()) != kMark) return nullptr;
  const std::uint8_t code = payload[kModelAt];
  const bool is_dual = payload[kModeAt] == kDualReturn;
  constexpr std::array kModels{&kVlp16, &kVlp32c, &kHdl32e};
  const auto named =
      std::find_if(kModels.begin(), kModels.end(), [&](const Model* model) { return model->code == code; });
  if (named == kModels.end()) return nullptr;
  const auto follows = [&](const Model* model) {
    if (next.size() != kPacketBytes) return false;
    const auto apart_us =
        load_number<std::uint32_t>(next.data() + kTimeAt) - load_number<std::uint32_t>(payload.data() + kTimeAt);
    return std::abs(apart_us - model->block_us() * (is_dual ? kBlocks / 2 : kBlocks)) < 10.0;
  };
  const auto timed = std::find_if(kModels.begin(), kModels.end(), follows);
  const Model* model = follows(*named) || timed == kModels.end() ? *named : *timed;
  return std::make_unique<VelodyneDecoder>(*model, code, is_dual, echo);
}

}  // namespace revisit::io_internal
