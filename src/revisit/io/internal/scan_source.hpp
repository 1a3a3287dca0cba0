// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>
#include <vector>

#include <revisit/core/log.hpp>
#include <revisit/io/internal/bag.hpp>
#include <revisit/io/internal/packets.hpp>
#include <revisit/io/point_cloud.hpp>

namespace revisit::io_internal {

/// Scans out of messages or packets. Reading is safe from several threads.
class ScanSource {
 public:
  virtual ~ScanSource() = default;
  virtual std::size_t size() const = 0;
  /// Scan and stamp; the frame is the caller's.
  virtual Result<Scan> read(std::size_t index) const = 0;
  virtual Result<double> stamp_s(std::size_t index) const = 0;
  /// When the scan was received or recorded.
  virtual Result<double> log_time_s(std::size_t index) const = 0;
  /// What was found and assumed about stamps and times: a line each, for people.
  virtual std::vector<std::string> findings() const { return {}; }
};

/// A scan a message: PointCloud2, Livox CustomMsg, VelodyneScan.
Result<std::unique_ptr<ScanSource>> scans_of_messages(std::shared_ptr<const Bag> bag, std::size_t topic, Echo echo,
                                                      const LogSink& log);
bool holds_scans(const std::string& type);  ///< whether scans_of_messages() takes messages of this type
/// The scan in one of them. `what` names it in messages; `times` are set where points of PointCloud2 and Livox have
/// some.
Result<Scan> scan_of_message(const std::string& type, const MessageValues& values, double stamp_s, Echo echo,
                             const std::string& what, const LogSink& log, PointTimes& times);
bool holds_packets(const std::string& type);

/// Scans cut out of single packets, where a sensor's turn begins. All heads of packets are read.
Result<std::unique_ptr<ScanSource>> scans_of_packets(std::shared_ptr<const PacketSource> packets,
                                                     std::shared_ptr<const PacketDecoder> decoder,
                                                     const std::string& name);

/// The scan in packets of one turn: points with times from the stamp, which is that of the first point.
/// `received_minus_sensor_ns`: from the sensor's clock to that of who received its packets.
Scan finish_scan(PacketPoints points, std::int64_t received_minus_sensor_ns);

/// The packets of a message of type ouster PacketMsg, one each, as a source.
std::shared_ptr<const PacketSource> packets_of_topic(std::shared_ptr<const Bag> bag, std::size_t topic);

}  // namespace revisit::io_internal
