// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include <revisit/io/internal/bag_recording.hpp>
#include <revisit/io/internal/byte_cursor.hpp>
#include <revisit/io/internal/bytes.hpp>
#include <revisit/io/internal/capture.hpp>
#include <revisit/io/internal/scan_source.hpp>

namespace revisit::io_internal {
namespace {

namespace fs = std::filesystem;

class CaptureRecording final : public Recording {
 public:
  CaptureRecording(std::unique_ptr<ScanSource> scans, std::string stream)
      : scans_(std::move(scans)), stream_(std::move(stream)) {}

  std::size_t size() const override { return scans_->size(); }
  FrameId frame(std::size_t index) const override { return FrameId{static_cast<std::int64_t>(index)}; }
  double stamp_s(std::size_t index) const override {
    const auto stamp = scans_->stamp_s(index);
    return stamp ? *stamp : 0.0;  // the scan cannot be read either, and says so
  }
  Result<Scan> read(std::size_t index) const override {
    auto scan = scans_->read(index);
    if (scan) scan->frame = frame(index);
    return scan;
  }
  std::string kind() const override { return "packet capture, " + stream_; }
  bool has_times() const override { return true; }
  const Trajectory& trajectory() const override { return trajectory_; }
  bool has_wheel_odometry() const override { return false; }
  std::optional<Pose> wheel_pose(std::size_t) const override { return std::nullopt; }
  std::optional<Pose> T_camera_lidar() const override { return std::nullopt; }
  std::vector<std::string> findings() const override { return scans_->findings(); }
  void set_trajectory(Trajectory trajectory) { trajectory_ = std::move(trajectory); }

 private:
  std::unique_ptr<ScanSource> scans_;
  std::string stream_;
  Trajectory trajectory_;
};

// The JSON files that may describe the sensors of a capture.
std::vector<fs::path> sensor_files(const fs::path& file, const RecordingOptions& options) {
  if (!options.sensor_file.empty()) return {options.sensor_file};
  std::vector<fs::path> found;
  const std::string stem = file.stem().string();
  std::error_code failure;
  const fs::path folder = file.has_parent_path() ? file.parent_path() : fs::path(".");
  for (fs::directory_iterator it(folder, failure), end; !failure && it != end; it.increment(failure)) {
    const fs::path& other = it->path();
    if (other.extension() != ".json") continue;
    // "NAME.json" and "NAME.1.json" belong to "NAME.pcap", and to "NAME_more.pcap".
    std::string name = other.stem().string();
    if (const auto dot = name.rfind('.'); dot != std::string::npos && dot + 2 == name.size()) name.resize(dot);
    if (stem.starts_with(name)) found.push_back(other);
  }
  std::sort(found.begin(), found.end());
  return found;
}

}  // namespace

std::string advice_for_hesai() {
  return "packets of a Hesai sensor: its beams are calibrated one by one, and the packets do not hold the angles; "
         "record "
         "the driver's PointCloud2 topic instead";
}

std::string advice_for_packets(ByteSpan payload) {
  if (payload.size() >= 2 && payload[0] == 0xEE && payload[1] == 0xFF) return advice_for_hesai();
  constexpr std::size_t kVelodyneBytes = 1206;
  if (payload.size() == kVelodyneBytes && payload[0] == 0xFF && (payload[1] == 0xEE || payload[1] == 0xDD))
    return "packets of a Velodyne sensor of model " + std::to_string(payload[kVelodyneBytes - 1]) +
           ", which are not decoded (VLP-16, VLP-32C and HDL-32E are); record the driver's PointCloud2 topic instead";
  return "packets of " + std::to_string(payload.size()) +
         " bytes of no sensor that is known (Velodyne VLP-16, VLP-32C, HDL-32E; Ouster with its JSON); record the "
         "driver's PointCloud2 topic instead";
}

Result<LidarStream> lidar_stream(const fs::path& file, const std::vector<CapturedStream>& streams,
                                 const RecordingOptions& options) {
  const Echo echo = options.last_return ? Echo::kLast : Echo::kStrongest;
  std::vector<std::shared_ptr<const PacketDecoder>> ousters;
  for (const fs::path& sensor : sensor_files(file, options)) {
    const auto json = read_bytes(sensor);
    if (!json) return json.error();
    auto decoder = ouster_decoder(*json, sensor.string(), echo);
    if (decoder)
      ousters.push_back(*std::move(decoder));
    else if (!options.sensor_file.empty())
      return decoder.error();
  }
  std::vector<LidarStream> found;
  for (std::size_t i = 0; i < streams.size(); ++i) {
    const ByteSpan payload = streams[i].first.payload.bytes;
    if (!options.topic.empty() && streams[i].name.find(options.topic) == std::string::npos) continue;
    const auto next = streams[i].packets->size() > 1 ? streams[i].packets->read(1) : Result<Packet>(Error{});
    if (std::shared_ptr<const PacketDecoder> decoder =
            velodyne_decoder(payload, next ? next->payload.bytes : ByteSpan(), echo))
      found.push_back({i, decoder});
    for (const auto& ouster : ousters)
      if (ouster->accepts(payload)) found.push_back({i, ouster});
  }
  if (found.size() == 1) return found.front();
  if (found.empty()) {
    std::string advice = advice_for_packets(streams.front().first.payload.bytes);
    if (!options.topic.empty()) advice = "no LiDAR's packets from or to '" + options.topic + "'";
    if (ousters.empty() && streams.front().payload_bytes > 3000)
      advice += "; an Ouster's JSON is to stand beside the file, or be named with --sensor";
    return Error{file.string() + ": " + advice};
  }
  std::string text = file.string() + ": has packets of several LiDARs; name one with --topic:";
  for (const LidarStream& stream : found)
    text += "\n  " + streams[stream.index].name + " (" + stream.decoder->sensor() + ", " +
            std::to_string(streams[stream.index].packets->size()) + " packets)";
  return Error{text};
}

bool is_capture(const fs::path& path) { return path.extension() == ".pcap" || path.extension() == ".pcapng"; }

Result<std::unique_ptr<Recording>> open_capture_recording(const fs::path& file, const RecordingOptions& options,
                                                          const LogSink& log) {
  const auto streams = open_capture(file, log);
  if (!streams) return streams.error();
  const auto lidar = lidar_stream(file, *streams, options);
  if (!lidar) return lidar.error();
  const CapturedStream& stream = (*streams)[lidar->index];
  auto scans = scans_of_packets(stream.packets, lidar->decoder, file.string());
  if (!scans) return scans.error();
  auto recording = std::make_unique<CaptureRecording>(*std::move(scans), stream.name);
  return with_poses(std::move(recording), options.poses_file);
}

}  // namespace revisit::io_internal
