// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>

#include <nlohmann/json.hpp>

#include <revisit/core/pose.hpp>
#include <revisit/io/internal/byte_cursor.hpp>
#include <revisit/io/internal/packets.hpp>

namespace revisit::io_internal {
namespace {

// The maker's sensor manual: packets of columns, each a head and one record a pixel (beam).
struct Profile {
  const char* name;
  std::size_t packet_head, packet_foot, column_head, column_foot, pixel;
  struct EchoAt {
    std::size_t range_at, reflectivity_at;
  };
  std::array<EchoAt, 2> echoes;
  std::size_t echo_count;
  std::uint32_t range_mask;
  double range_unit_m;
  std::size_t range_bytes, reflectivity_bytes;
};
constexpr std::array kProfiles{
    Profile{"LEGACY", 0, 0, 16, 4, 12, {{{0, 4}, {}}}, 1, 0xFFFFF, 0.001, 4, 2},
    Profile{"RNG19_RFL8_SIG16_NIR16", 32, 32, 12, 0, 12, {{{0, 4}, {}}}, 1, 0x7FFFF, 0.001, 4, 1},
    Profile{"RNG19_RFL8_SIG16_NIR16_DUAL", 32, 32, 12, 0, 16, {{{0, 3}, {4, 7}}}, 2, 0x7FFFF, 0.001, 4, 1},
    Profile{"RNG15_RFL8_NIR8", 32, 32, 12, 0, 4, {{{0, 2}, {}}}, 1, 0x7FFF, 0.008, 2, 1},
    Profile{"FUSA_RNG15_RFL8_NIR8_DUAL", 32, 32, 12, 0, 8, {{{0, 2}, {4, 6}}}, 2, 0x7FFF, 0.008, 2, 1},
};

struct Metadata {
  std::string product, profile = "LEGACY";
  std::vector<double> altitude_deg, azimuth_deg;
  Eigen::Vector2d beam_origin_m = Eigen::Vector2d::Zero();  ///< from the axis outwards, and upwards
  Pose T_sensor_lidar = Pose::Identity();
  std::size_t columns_per_frame = 1024, columns_per_packet = 16, pixels = 64;
  std::int64_t initialisation = -1;
};

// Keys stand in one flat object (first generations) or in sections.
class Facts {
 public:
  explicit Facts(const nlohmann::json& root) : root_(root) {}
  template <typename T>
  std::optional<T> get(const char* key) const {
    const nlohmann::json* found = find(root_, key, 0);
    if (found == nullptr) return std::nullopt;
    return found->get<T>();
  }

 private:
  static const nlohmann::json* find(const nlohmann::json& object, const char* key, int depth) {
    if (!object.is_object() || depth > 3) return nullptr;
    if (const auto own = object.find(key); own != object.end() && !own->is_null()) return &*own;
    for (const auto& [name, value] : object.items())
      if (const auto* found = find(value, key, depth + 1)) return found;
    return nullptr;
  }
  const nlohmann::json& root_;
};

Metadata parse_metadata(const nlohmann::json& root) {
  const Facts facts(root);
  Metadata data;
  data.product = facts.get<std::string>("prod_line").value_or("Ouster");
  data.altitude_deg = facts.get<std::vector<double>>("beam_altitude_angles").value_or(std::vector<double>());
  data.azimuth_deg = facts.get<std::vector<double>>("beam_azimuth_angles").value_or(std::vector<double>());
  data.pixels = facts.get<std::size_t>("pixels_per_column").value_or(data.altitude_deg.size());
  data.columns_per_packet = facts.get<std::size_t>("columns_per_packet").value_or(16);
  if (const auto mode = facts.get<std::string>("lidar_mode"))
    data.columns_per_frame = static_cast<std::size_t>(std::strtoul(mode->c_str(), nullptr, 10));
  data.columns_per_frame = facts.get<std::size_t>("columns_per_frame").value_or(data.columns_per_frame);
  data.profile = facts.get<std::string>("udp_profile_lidar").value_or("LEGACY");
  data.initialisation = facts.get<std::int64_t>("initialization_id").value_or(-1);
  data.beam_origin_m.x() = 1e-3 * facts.get<double>("lidar_origin_to_beam_origin_mm").value_or(0.0);
  if (const auto beam = facts.get<std::vector<double>>("beam_to_lidar_transform"); beam && beam->size() == 16)
    data.beam_origin_m = 1e-3 * Eigen::Vector2d((*beam)[3], (*beam)[11]);
  if (const auto lidar = facts.get<std::vector<double>>("lidar_to_sensor_transform"); lidar && lidar->size() == 16) {
    const Eigen::Matrix<double, 4, 4, Eigen::RowMajor> matrix(lidar->data());
    data.T_sensor_lidar.linear() = matrix.topLeftCorner<3, 3>();
    data.T_sensor_lidar.translation() = 1e-3 * matrix.topRightCorner<3, 1>();
  }
  return data;
}

class OusterDecoder final : public PacketDecoder {
 public:
  OusterDecoder(const Metadata& data, const Profile& profile, Echo echo) : data_(data), profile_(profile), echo_(echo) {
    for (std::size_t i = 0; i < data.pixels; ++i) {
      const double altitude = to_radians(data.altitude_deg[i]), azimuth = to_radians(-data.azimuth_deg[i]);
      beams_.push_back(
          {std::cos(altitude) * std::cos(azimuth), std::cos(altitude) * std::sin(azimuth), std::sin(altitude)});
      std::uint16_t ring = 0;  // from the lowest beam to the highest
      for (const double other : data.altitude_deg) ring += other < data.altitude_deg[i];
      rings_.push_back(ring);
    }
  }

  std::string sensor() const override { return data_.product + ", " + profile_.name; }
  std::size_t parts() const override { return data_.columns_per_packet; }
  std::int64_t clock_period_ns() const override { return 0; }

  bool accepts(ByteSpan payload) const override {
    // Older drivers recorded a byte more than there is.
    if (payload.size() != packet_bytes() && payload.size() != packet_bytes() + 1) return false;
    if (profile_.packet_head == 0) return true;
    const auto id = load_number<std::uint32_t>(payload.data() + (is_fusa() ? 1 : 4)) & 0xFFFFFF;
    return data_.initialisation < 0 || id == data_.initialisation;
  }
  // The number of the frame.
  std::uint32_t phase(ByteSpan payload, std::size_t part) const override {
    if (profile_.packet_head == 0) return load_number<std::uint16_t>(column(payload, part) + 10);
    return load_number<std::uint16_t>(payload.data() + (is_fusa() ? 4 : 2));
  }
  bool begins_scan(std::uint32_t before, std::uint32_t now) const override {
    return now != before && !is_late(before, now);
  }
  // A few frames back; farther, the sensor began to count again.
  bool is_late(std::uint32_t before, std::uint32_t now) const override {
    constexpr std::uint16_t kFewFrames = 16;
    const auto back = static_cast<std::uint16_t>(before - now);
    return back != 0 && back < kFewFrames;
  }
  std::int64_t time_ns(ByteSpan payload, std::size_t part) const override {
    return static_cast<std::int64_t>(load_number<std::uint64_t>(column(payload, part)) & 0x1FFFFFFFFFFFFFFF);
  }

  void decode(ByteSpan payload, std::size_t first, std::size_t end, PacketPoints& points) const override {
    for (std::size_t part = first; part < end; ++part) {
      const std::uint8_t* at = column(payload, part);
      if (!is_valid(at)) continue;
      const double turned = 2.0 * kPi *
                            (1.0 - static_cast<double>(load_number<std::uint16_t>(at + 8)) /
                                       static_cast<double>(data_.columns_per_frame));
      const Eigen::Vector2d outwards(std::cos(turned), std::sin(turned));
      const std::int64_t time = time_ns(payload, part);
      for (std::size_t i = 0; i < data_.pixels; ++i)
        add_pixel(at + profile_.column_head + i * profile_.pixel, i, outwards, time, points);
    }
  }

 private:
  bool is_fusa() const { return std::string_view(profile_.name).starts_with("FUSA"); }
  std::size_t column_bytes() const {
    return profile_.column_head + profile_.column_foot + data_.pixels * profile_.pixel;
  }
  std::size_t packet_bytes() const {
    return profile_.packet_head + profile_.packet_foot + data_.columns_per_packet * column_bytes();
  }
  const std::uint8_t* column(ByteSpan payload, std::size_t part) const {
    return payload.data() + profile_.packet_head + part * column_bytes();
  }
  bool is_valid(const std::uint8_t* at) const {
    if (profile_.column_foot == 0) return (load_number<std::uint16_t>(at + 10) & 1) != 0;
    return load_number<std::uint32_t>(at + column_bytes() - profile_.column_foot) == 0xFFFFFFFF;
  }
  std::uint32_t range(const std::uint8_t* at) const {
    return (profile_.range_bytes == 4 ? load_number<std::uint32_t>(at) : load_number<std::uint16_t>(at)) &
           profile_.range_mask;
  }

  // The second echo is the weaker one.
  void add_pixel(const std::uint8_t* at, std::size_t beam, const Eigen::Vector2d& outwards, std::int64_t time,
                 PacketPoints& points) const {
    Profile::EchoAt echo = profile_.echoes[0];
    if (echo_ == Echo::kLast && profile_.echo_count == 2 &&
        range(at + profile_.echoes[1].range_at) > range(at + echo.range_at))
      echo = profile_.echoes[1];
    const double range_m = range(at + echo.range_at) * profile_.range_unit_m;
    if (range_m == 0.0) {
      ++points.scan.dropped_at_origin;
      return;
    }
    const double from_beam_m = range_m - data_.beam_origin_m.norm();
    const Eigen::Vector3d& d = beams_[beam];
    const Eigen::Vector2d level = from_beam_m * d.head<2>();
    const Eigen::Vector3d lidar(outwards.x() * (level.x() + data_.beam_origin_m.x()) - outwards.y() * level.y(),
                                outwards.y() * (level.x() + data_.beam_origin_m.x()) + outwards.x() * level.y(),
                                from_beam_m * d.z() + data_.beam_origin_m.y());
    const Eigen::Vector3f p = (data_.T_sensor_lidar * lidar).cast<float>();
    const std::uint8_t* reflectivity = at + echo.reflectivity_at;
    const float intensity = profile_.reflectivity_bytes == 2 ? load_number<std::uint16_t>(reflectivity) : *reflectivity;
    points.add({p.x(), p.y(), p.z(), intensity}, rings_[beam], time);
  }

  Metadata data_;
  const Profile& profile_;
  Echo echo_;
  std::vector<Eigen::Vector3d> beams_;
  std::vector<std::uint16_t> rings_;
};

}  // namespace

Result<std::unique_ptr<PacketDecoder>> ouster_decoder(const std::string& json, const std::string& name, Echo echo) {
  Metadata data;
  try {
    data = parse_metadata(nlohmann::json::parse(json));
  } catch (const nlohmann::json::exception& problem) {
    return Error{name + ": is no description of an Ouster sensor: " + problem.what()};
  }
  const auto profile = std::find_if(kProfiles.begin(), kProfiles.end(),
                                    [&](const Profile& known) { return data.profile == known.name; });
  if (profile == kProfiles.end()) {
    std::string known;
    for (const Profile& each : kProfiles) known += (known.empty() ? "" : ", ") + std::string(each.name);
    return Error{name + ": packets of profile '" + data.profile + "'; allowed: " + known};
  }
  const bool is_whole = data.pixels > 0 && data.pixels <= 256 && data.altitude_deg.size() == data.pixels &&
                        data.azimuth_deg.size() == data.pixels && data.columns_per_packet > 0 &&
                        data.columns_per_packet <= 64 && data.columns_per_frame > 0 && data.columns_per_frame <= 4096;
  const auto is_angle = [](double deg) { return std::isfinite(deg) && std::abs(deg) <= 360.0; };
  if (!is_whole || !std::all_of(data.altitude_deg.begin(), data.altitude_deg.end(), is_angle) ||
      !std::all_of(data.azimuth_deg.begin(), data.azimuth_deg.end(), is_angle) ||
      !data.T_sensor_lidar.matrix().allFinite() || !data.beam_origin_m.allFinite())
    return Error{name + ": describes no Ouster sensor: " + std::to_string(data.pixels) + " pixels a column, " +
                 std::to_string(data.altitude_deg.size()) + " beam angles, " + std::to_string(data.columns_per_packet) +
                 " columns a packet, " + std::to_string(data.columns_per_frame) + " columns a frame"};
  return std::unique_ptr<PacketDecoder>(std::make_unique<OusterDecoder>(data, *profile, echo));
}

}  // namespace revisit::io_internal
