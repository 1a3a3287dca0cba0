// SPDX-License-Identifier: Apache-2.0
#include "fuzz/readers.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <string>
#include <utility>
#include <vector>

#include <revisit/config/parameter_file.hpp>
#include <revisit/io/bag_topics.hpp>
#include <revisit/io/calibration_file.hpp>
#include <revisit/io/nmea_file.hpp>
#include <revisit/io/pose_file.hpp>
#include <revisit/io/recording.hpp>
#include <revisit/io/result_files.hpp>
#include <revisit/io/scan_file.hpp>
#include <revisit/io/scan_message.hpp>
#include <revisit/mapping/cloud_file.hpp>
#include <revisit/pipeline/localiser.hpp>
#include <revisit/retrieval/place_index.hpp>
#include <revisit/store/keyframe_bytes.hpp>
#include <revisit/store/stored_map.hpp>

namespace revisit::fuzz {
namespace {

namespace fs = std::filesystem;

// An error says something, and a line of it names the file or the value.
template <typename T>
bool judged(const Result<T>& result) {
  if (!result && result.error().message.empty()) std::abort();
  return static_cast<bool>(result);
}

void check(const Scan& scan) {
  require_consistent(scan);
  for (const Point& p : scan.points)
    if (!std::isfinite(p.x) || !std::isfinite(p.y) || !std::isfinite(p.z) || !std::isfinite(p.intensity)) std::abort();
}

void read_a_scan(const fs::path& file) {
  if (const auto scan = read_scan(file); judged(scan)) check(*scan);
}

void read_a_recording(const fs::path& file) {
  judged(list_topics(file));
  const auto recording = open_recording(file);
  if (!judged(recording)) return;
  (*recording)->findings();
  const std::size_t size = (*recording)->size();
  for (const std::size_t i : {std::size_t{0}, size / 2, size - 1}) {
    const auto scan = (*recording)->read(i);
    if (judged(scan)) check(*scan);
    (*recording)->wheel_pose(i);
  }
  judged((*recording)->gps_fixes(""));
}

std::vector<std::uint8_t> bytes_of(const fs::path& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

// The first byte says how the message was written and of which type it is; then the message.
void read_a_message(const fs::path& file) {
  constexpr const char* kTypes[] = {"sensor_msgs/PointCloud2", "livox_ros_driver/CustomMsg",
                                    "livox_ros_driver2/CustomMsg", "velodyne_msgs/VelodyneScan"};
  const auto bytes = bytes_of(file);
  if (bytes.empty()) return;
  const auto reader = ScanMessageReader::make(kTypes[(bytes[0] >> 1) % std::size(kTypes)], "", (bytes[0] & 1) != 0);
  if (!judged(reader)) return;
  const auto message = reader->read(std::span(bytes).subspan(1), "message");
  if (judged(message)) check(message->scan);
}

void read_a_definition(const fs::path& file) {
  const auto bytes = bytes_of(file);
  judged(ScanMessageReader::make("sensor_msgs/PointCloud2", std::string(bytes.begin(), bytes.end()), true));
}

// A capture of UDP packets, each a tenth of a millisecond after the one before.
void write_capture(const fs::path& file, const std::vector<std::vector<std::uint8_t>>& packets, std::uint16_t port) {
  std::ofstream stream(file, std::ios::binary);
  const auto put = [&](std::uint64_t value, int size, bool is_big_endian) {
    for (int i = 0; i < size; ++i)
      stream.put(static_cast<char>(value >> (8 * (is_big_endian ? size - 1 - i : i)) & 255u));
  };
  for (const auto& [value, size] :
       {std::pair{0xa1b2c3d4u, 4}, {0x00040002u, 4}, {0u, 4}, {0u, 4}, {0xffffu, 4}, {1u, 4}})
    put(value, size, false);
  std::uint32_t time_us = 0;
  for (const auto& packet : packets) {
    const auto size = static_cast<std::uint32_t>(packet.size());
    for (const std::uint32_t value : {1u, time_us += 100, size + 42, size + 42}) put(value, 4, false);
    put(0, 12, true);  // Ethernet
    put(0x0800, 2, true);
    put(0x4500, 2, true);  // IP
    put(size + 28, 2, true);
    put(0, 4, true);
    put(0x4011, 2, true);
    put(0, 10, true);
    for (const std::uint32_t value : {std::uint32_t{port}, std::uint32_t{port}, size + 8, 0u}) put(value, 2, true);
    stream.write(reinterpret_cast<const char*>(packet.data()), size);
  }
}

void read_a_packet(const fs::path& file) {
  const auto bytes = bytes_of(file);
  const fs::path capture = file.parent_path() / "packets.pcap";
  write_capture(capture, {4, bytes}, 2368);
  read_a_recording(capture);
}

// What an Ouster sensor says of itself, beside packets of zeros of every size that it sends.
void read_a_sensor(const fs::path& file) {
  const fs::path capture = file.parent_path() / "packets.pcap";
  for (const std::size_t size : {3392u, 6464u, 8448u, 12608u, 24896u}) {
    write_capture(capture, {2, std::vector<std::uint8_t>(size)}, 7502);
    read_a_recording(capture);
  }
}

void read_a_map(const fs::path& file) {
  const auto store = MapStore::open(file, MapStore::Access::kRead);
  if (!judged(store)) return;
  judged(store->scans());
  judged(store->edges());
  judged(store->answers());
  judged(store->sessions());
  judged(store->earth());
  const auto map = read_map(*store);
  if (!judged(map)) return;
  for (const auto& keyframe : map->keyframes) {
    judged(read_place_points(*store, keyframe.frame.frame));
    judged(read_map_points(*store, keyframe.frame.frame));
  }
  judged(Localiser::open(file));
}

void read_an_index(const fs::path& file) {
  const auto index = PlaceIndex::open(file.string(), {});
  if (!judged(index)) return;
  const Status checked = index->check();
  if (!checked && checked.error().message.empty()) std::abort();
  if (index->size() == 0) return;
  if (const auto place = index->find(index->frame(0))) {
    IntensityScanContext query;
    query.rings = place->rings;
    query.sectors = place->sectors;
    query.levels = place->levels;
    query.intensity.assign(place->intensity, place->intensity + place->cells());
    query.occupancy.assign(place->occupancy, place->occupancy + (query.image_cells() + 63) / 64);
    judged(index->search(query, index->size()));
  }
}

void read_back_points(const fs::path& file) {
  std::size_t points = 0;
  if (const Status status = read_back(file, [&](std::span<const Point> part) { points += part.size(); });
      !status && status.error().message.empty())
    std::abort();
}

constexpr Reader kReaders[] = {
    {"bin", "000000.bin", read_a_scan},
    {"pcd", "scan.pcd", read_a_scan},
    {"ply", "scan.ply", read_a_scan},
    {"las", "scan.las", read_a_scan},
    {"bag", "drive.bag", read_a_recording},
    {"mcap", "drive.mcap", read_a_recording},
    {"db3", "drive.db3", read_a_recording},
    {"pcap", "drive.pcap", read_a_recording},
    {"message", "message", read_a_message},
    {"definition", "definition.msg", read_a_definition},
    {"packet", "packet", read_a_packet},
    {"sensor", "sensor.json", read_a_sensor},
    {"kitti_poses", "poses.txt", [](const fs::path& file) { judged(read_poses(file)); }},
    {"tum_poses", "poses.tum", [](const fs::path& file) { judged(read_poses(file)); }},
    {"g2o", "poses.g2o", [](const fs::path& file) { judged(read_poses(file)); }},
    {"nmea", "gps.nmea", [](const fs::path& file) { judged(read_nmea(file)); }},
    {"calib", "calib.txt", [](const fs::path& file) { judged(read_camera_calibration(file)); }},
    {"calibration", "calibration.json", [](const fs::path& file) { judged(read_calibration(file)); }},
    {"parameters", "parameters.toml", [](const fs::path& file) { judged(read_parameters(file)); }},
    {"candidates", "candidates.csv", [](const fs::path& file) { judged(read_candidates(file)); }},
    {"loops", "loops.csv", [](const fs::path& file) { judged(read_loops(file)); }},
    {"localisation", "localisation.csv", [](const fs::path& file) { judged(read_localisation(file)); }},
    {"map", "map.revisit", read_a_map},
    {"index", "places.index", read_an_index},
    {"points", "map.ply", read_back_points},
};

}  // namespace

std::span<const Reader> readers() { return kReaders; }

const Reader* find_reader(const std::string& name) {
  const auto found =
      std::find_if(std::begin(kReaders), std::end(kReaders), [&](const Reader& reader) { return name == reader.name; });
  return found == std::end(kReaders) ? nullptr : found;
}

}  // namespace revisit::fuzz
