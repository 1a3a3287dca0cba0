// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include <revisit/core/log.hpp>
#include <revisit/core/result.hpp>
#include <revisit/io/internal/random_access_file.hpp>

namespace revisit::io_internal {

/// Messages of one type under one name. A name may carry several types, each of them then a topic of its own.
struct BagTopic {
  std::string name;
  std::string type;        ///< "sensor_msgs/PointCloud2", without the "/msg" of ROS 2
  std::string encoding;    ///< of the messages: "ros1", "cdr", or what else the file says
  std::string definition;  ///< of the type, as .msg text; empty where the file has none
  std::uint64_t messages = 0;
};

struct BagMessage {
  std::int64_t log_time_ns = 0;  ///< when it was recorded, since 1970 (or of the simulated clock)
  SharedBytes data;
};

/// One file of recorded messages: a ROS 1 bag, an .mcap or a .db3. Nothing is read before it is asked for; reading is
/// safe from several threads. Messages of a topic are counted from 0, in the order of their log times.
class BagFile {
 public:
  virtual ~BagFile() = default;
  virtual const std::vector<BagTopic>& topics() const = 0;
  virtual std::int64_t first_ns() const = 0;  ///< log time of the first and the last message
  virtual std::int64_t last_ns() const = 0;
  virtual Result<BagMessage> read(std::size_t topic, std::uint64_t index) const = 0;
  /// The messages of a topic with a log time in [from_ns, to_ns], in their order, until `use` returns false.
  virtual Status visit(std::size_t topic, std::int64_t from_ns, std::int64_t to_ns,
                       const std::function<bool(const BagMessage&)>& use) const = 0;
};

Result<std::unique_ptr<BagFile>> open_ros1_bag(const std::filesystem::path& file, const LogSink& log);
Result<std::unique_ptr<BagFile>> open_mcap(const std::filesystem::path& file, const LogSink& log);
Result<std::unique_ptr<BagFile>> open_db3(const std::filesystem::path& file, const LogSink& log);

}  // namespace revisit::io_internal
