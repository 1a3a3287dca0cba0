// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include <revisit/core/result.hpp>
#include <revisit/io/internal/message_values.hpp>

namespace revisit::io_internal {

constexpr std::size_t kBagChunkBytes = std::size_t{768} * 1024;  ///< before compression, as ROS writes them

/// Writes messages into one file of a format. In memory is the chunk that is being filled, and the index.
class BagFileWriter {
 public:
  virtual ~BagFileWriter() = default;
  virtual Serialisation serialisation() const = 0;
  /// A new topic; its number counts from 0. `type` as "sensor_msgs/PointCloud2", of those that revisit reads.
  virtual Status add_topic(const std::string& name, const std::string& type) = 0;
  virtual Status write(std::size_t topic, std::int64_t log_time_ns, const std::string& message) = 0;
  /// Without it the file is one that was cut off.
  virtual Status finish() = 0;
};

Result<std::unique_ptr<BagFileWriter>> create_ros1_bag(const std::filesystem::path& file);
Result<std::unique_ptr<BagFileWriter>> create_mcap(const std::filesystem::path& file);
Result<std::unique_ptr<BagFileWriter>> create_db3(const std::filesystem::path& file);

/// The definition of a known type as ROS writes it into bags.
std::string definition_for_bag(const std::string& type, bool is_ros1);
/// The checksum by which ROS 1 tells versions of a type apart.
std::string md5_of(const std::string& type);

}  // namespace revisit::io_internal
