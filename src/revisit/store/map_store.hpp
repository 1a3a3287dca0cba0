// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <revisit/core/candidate_row.hpp>
#include <revisit/core/gps_fix.hpp>
#include <revisit/core/loop.hpp>
#include <revisit/core/pose.hpp>
#include <revisit/core/result.hpp>

namespace revisit {

using Bytes = std::vector<std::byte>;

/// A node of the pose graph, and what was seen from it. The store does not know what its bytes mean.
struct StoredKeyframe {
  FrameId frame;
  double stamp_s = 0.0;
  Pose T_odom_lidar = Pose::Identity();
  bool starts_segment = false;  ///< tracking was lost before: how it lies to the key frames before is not known
  /// Empty where the place was known already.
  Bytes descriptor, place, cloud;
};

/// Where a scan was, from the key frame before it.
struct StoredScan {
  FrameId frame, keyframe;
  double stamp_s = 0.0;
  Pose T_keyframe_lidar = Pose::Identity();
  Pose T_odom_lidar = Pose::Identity();
  bool is_tracked = true;
};

/// What was measured between two key frames.
struct StoredEdge {
  FrameId from, to;
  Pose T_from_to = Pose::Identity();
  Matrix6 information = Matrix6::Identity();  ///< as in LoopConstraint
  std::optional<LoopConstraint> loop;         ///< where it is one: `to` is the query
};

/// A recording that entered the map. The store does not know what its texts mean.
struct StoredSession {
  int id = 0;
  std::string recording, parameters, sensor;
};

/// Where a key frame is in the map, as the graph was settled last. Parts of the map that no loop joins have their
/// coordinates each.
struct StoredMapPose {
  FrameId keyframe;
  Pose T_map_lidar = Pose::Identity();
  int part = 0;
};

/// Where GPS had a key frame; its stamp is the key frame's.
struct StoredFix {
  FrameId keyframe;
  GpsFix fix;
};

/// Which way was up at a key frame, as an IMU with it said (OdometryStep::up_by_gravity): a unit vector in its frame.
struct StoredUp {
  FrameId keyframe;
  Eigen::Vector3d up = Eigen::Vector3d::UnitZ();
};

/// How a part of the map lies on the earth: east, north and up of a point of it.
struct StoredEarth {
  int part = 0;
  double latitude_deg = 0.0, longitude_deg = 0.0, altitude_m = 0.0;
  Pose T_earth_map = Pose::Identity();
};

/// A map on disk (SQLite), which grows while it is made. What was committed survives whatever happens to the program,
/// and each row is checked against altered bytes as it is read. Belongs to one thread at a time; any number of programs
/// may read a file while one writes it.
class MapStore {
 public:
  /// The map in the folder of a `revisit slam`.
  static constexpr const char* kFileName = "map.revisit";
  /// The map that a path names: the file itself, or the one in the folder.
  static std::filesystem::path file_of(const std::filesystem::path& path);
  /// A map that lasts as long as the program, on the disk as far as it is large.
  static Result<MapStore> create_temporary();
  /// An existing file is an error.
  static Result<MapStore> create(const std::filesystem::path& file);
  /// Takes a map away, unless another program writes it.
  static Status remove_file(const std::filesystem::path& file);
  enum class Access : std::uint8_t { kRead, kWrite };
  /// Refused are files that are no map, or of a version that this program does not know. One of an earlier version is
  /// upgraded, for which it must be writable.
  static Result<MapStore> open(const std::filesystem::path& file, Access access = Access::kWrite);
  MapStore(MapStore&&) noexcept;
  MapStore& operator=(MapStore&&) noexcept;
  ~MapStore();

  Status add(const StoredKeyframe& keyframe);
  Status add(const StoredScan& scan);
  Status add(const StoredEdge& edge);
  Status add(const CandidateRow& answer);
  Status add(const StoredFix& fix);
  Status add(const StoredUp& up);
  /// Everything added since the last commit becomes part of the map, or none of it does.
  Status commit();
  /// Of a key frame at a place that was known: what it saw, until the session is finished.
  Status add_visit(FrameId keyframe, const Bytes& cloud);
  /// The points of a place with what later sessions made of them. Empty `changes`: nothing.
  Status set_cloud(FrameId keyframe, const Bytes& cloud, const Bytes& changes);
  Status forget_visits();
  /// Key frames of the session that visited known places, in order.
  Result<std::vector<FrameId>> visits() const;
  /// Takes key frames out of the map, with all that belongs to them. `joints` join those that stay.
  struct Joint {
    StoredEdge edge;
    bool starts_segment = false;  ///< as of the key frame that it leads to
  };
  Status remove(std::span<const FrameId> keyframes, std::span<const Joint> joints);
  /// Key frames that are places, in order.
  Result<std::vector<FrameId>> places() const;

  /// Nothing more will be written: what was committed is brought into the one file. Without it, the destructor does so
  /// as far as it can.
  Status close();
  /// Nothing added since the last commit becomes part of the map.
  Status roll_back();

  /// A second one of the same id replaces the first.
  Status set(const StoredSession& session);
  /// All of them: those of before are forgotten.
  Status set_map_poses(std::span<const StoredMapPose> poses);

  /// All of them: those of before are forgotten.
  Status set_earth(std::span<const StoredEarth> parts);

  /// What a finished map is opened with at once: its place index in pieces (PlaceIndex::save), which carry checksums of
  /// their own, and where the places are. Both are gone as soon as a key frame or a pose changes.
  Status add_index(std::size_t offset, std::span<const std::byte> piece);
  Status set_place_poses(std::span<const StoredMapPose> poses);
  /// Bytes of all pieces; 0 where there is none.
  Result<std::size_t> index_size() const;
  Status read_index(std::size_t offset, std::span<std::byte> piece) const;
  Result<std::vector<StoredMapPose>> place_poses() const;

  /// What the run that makes the map has in memory, to go on from exactly there. It replaces that of before.
  Status set_state(std::span<const std::byte> bytes);
  /// Empty where there is none.
  Result<Bytes> state() const;

  /// From here to release(), what is read is the map at one moment, whatever others write meanwhile. Not for long: it
  /// keeps others from beginning to write.
  Status hold() const;
  Status release() const;
  bool is_held() const;  ///< or there is something that waits for commit()

  /// In the order of their ids.
  Result<std::vector<StoredSession>> sessions() const;
  /// In the order of their frames; those of key frames that came after the graph was settled are missing.
  Result<std::vector<StoredMapPose>> map_poses() const;
  /// In the order of their frames, the bytes left out.
  Result<std::vector<StoredKeyframe>> keyframes() const;
  Result<std::vector<StoredScan>> scans() const;
  /// In the order in which they were added.
  Result<std::vector<StoredEdge>> edges() const;
  Result<std::vector<CandidateRow>> answers() const;
  /// In the order of their key frames.
  Result<std::vector<StoredFix>> fixes() const;
  Result<std::vector<StoredUp>> ups() const;
  Result<std::vector<StoredEarth>> earth() const;
  enum class Part { kDescriptor, kPlace, kCloud, kVisit, kChanges };
  /// Empty where the place was known already. An unknown frame is an error.
  Result<Bytes> part(FrameId keyframe, Part part) const;
  /// Whether it is a key frame of the map: another program may have taken it out by now.
  Result<bool> has(FrameId keyframe) const;
  /// Reads everything: an error names the first row that is not what was written.
  Status check() const;
  const std::string& file() const;
  /// The error for bytes that cannot be read: names the file, the part and the key frame.
  Error damaged(const char* part, FrameId keyframe) const;

 private:
  struct Database;
  explicit MapStore(std::unique_ptr<Database> database);
  std::unique_ptr<Database> database_;
};

}  // namespace revisit
