// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <revisit/core/log.hpp>
#include <revisit/core/result.hpp>
#include <revisit/core/scan.hpp>
#include <revisit/io/internal/random_access_file.hpp>

namespace revisit::io_internal {

/// What a LiDAR sent at once, and when it was received.
struct Packet {
  std::int64_t time_ns = 0;
  SharedBytes payload;
};

/// The points of a scan as packets give them, with their times on the sensor's own clock.
struct PacketPoints {
  Scan scan;  ///< its times_s are filled at the end
  std::vector<std::int64_t> times_ns;

  void add(const Point& point, std::uint16_t ring, std::int64_t time_ns) {
    scan.points.push_back(point);
    scan.rings.push_back(ring);
    times_ns.push_back(time_ns);
  }
};

/// Which of a pulse's echoes becomes the point, where the sensor sends two.
enum class Echo : std::uint8_t { kStrongest, kLast };

/// One model of sensor. A packet has parts (blocks, columns), each measured at one moment, in the order of their times.
class PacketDecoder {
 public:
  virtual ~PacketDecoder() = default;
  virtual std::string sensor() const = 0;  ///< e.g. "VLP-16, dual return"
  virtual std::size_t parts() const = 0;
  /// Whether the packet is one of this sensor's measurements. The calls below take only these.
  virtual bool accepts(ByteSpan payload) const = 0;
  /// What tells the part's scan from others (angle or number), and whether a scan begins where it changes from one
  /// value to another. Parts that came late begin none.
  virtual std::uint32_t phase(ByteSpan payload, std::size_t part) const = 0;
  virtual bool begins_scan(std::uint32_t before, std::uint32_t now) const = 0;
  virtual bool is_late(std::uint32_t before, std::uint32_t now) const = 0;
  /// Time of the part on the sensor's clock, and after how long that clock begins again; 0 for never.
  virtual std::int64_t time_ns(ByteSpan payload, std::size_t part) const = 0;
  virtual std::int64_t clock_period_ns() const = 0;
  /// Appends the points of parts [first, end).
  virtual void decode(ByteSpan payload, std::size_t first, std::size_t end, PacketPoints& points) const = 0;
};

/// The decoder of Velodyne packets (VLP-16, VLP-32C, HDL-32E), by what a packet says of itself and by how soon the
/// `next` one follows (empty if there is none): early VLP-16 call themselves HDL-32E. None for other packets.
std::unique_ptr<PacketDecoder> velodyne_decoder(ByteSpan payload, ByteSpan next, Echo echo);

/// What an Ouster sensor says of itself, in JSON of any generation. `name` stands in errors.
Result<std::unique_ptr<PacketDecoder>> ouster_decoder(const std::string& json, const std::string& name, Echo echo);

/// For packets that no decoder takes: whose they seem to be, and what to do.
std::string advice_for_packets(ByteSpan payload);
std::string advice_for_hesai();

/// Packets in the order in which they were received.
class PacketSource {
 public:
  virtual ~PacketSource() = default;
  virtual std::size_t size() const = 0;
  virtual Result<Packet> read(std::size_t index) const = 0;
};

}  // namespace revisit::io_internal
