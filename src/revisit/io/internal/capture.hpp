// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>
#include <vector>

#include <revisit/io/internal/packets.hpp>
#include <revisit/io/recording.hpp>

namespace revisit::io_internal {

/// The UDP packets of a capture (.pcap, .pcapng) that went from one sender to one port.
struct CapturedStream {
  std::string name;  ///< "192.168.1.201 to port 2368"
  std::size_t payload_bytes = 0;
  Packet first;  ///< one of them
  std::shared_ptr<const PacketSource> packets;
};

/// All streams of a capture, the one with the most bytes first; those of a sender and port with different sizes apart.
/// Only the places of packets are kept; IP fragments are joined. A capture that was cut off gives what it holds, with a
/// warning. Reading is safe from several threads.
Result<std::vector<CapturedStream>> open_capture(const std::filesystem::path& file, const LogSink& log);

/// The stream that is a LiDAR's, and who decodes it: by --topic, or the only one. Velodyne's packets say what they are;
/// an Ouster's need the sensor's JSON: the one that is named, or those beside the file (NAME.json, NAME.1.json ...).
struct LidarStream {
  std::size_t index = 0;
  std::shared_ptr<const PacketDecoder> decoder;
};
Result<LidarStream> lidar_stream(const std::filesystem::path& file, const std::vector<CapturedStream>& streams,
                                 const RecordingOptions& options);

}  // namespace revisit::io_internal
