// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include <revisit/io/internal/bag_file.hpp>
#include <revisit/io/internal/message_values.hpp>

namespace revisit::io_internal {

/// A recording of messages in one file or in several that follow each other. Reading is safe from several threads.
class Bag {
 public:
  /// A .bag, .mcap, .db3 (each also as .zstd), or a folder of them.
  static Result<std::unique_ptr<Bag>> open(const std::filesystem::path& path, const LogSink& log);
  /// Whether open() is the way to read this file or folder.
  static bool is_bag(const std::filesystem::path& path);
  ~Bag();

  const std::filesystem::path& path() const { return path_; }
  std::string kind() const;  ///< e.g. "ROS 2 bag, mcap, 3 files"
  const std::vector<BagTopic>& topics() const { return topics_; }
  std::int64_t first_ns() const { return first_ns_; }
  std::int64_t last_ns() const { return last_ns_; }

  Result<BagMessage> read(std::size_t topic, std::uint64_t index) const;
  Status visit(std::size_t topic, std::int64_t from_ns, std::int64_t to_ns,
               const std::function<bool(const BagMessage&)>& use) const;

  /// The values in a message of the topic; an error where revisit cannot read its type.
  Result<MessageValues> decode(std::size_t topic, const BagMessage& message) const;
  bool can_decode(std::size_t topic) const { return definitions_.at(topic).has_value(); }

 private:
  struct File {
    std::unique_ptr<BagFile> bag;
    std::vector<std::optional<std::size_t>> topic_here;  ///< of each topic of all files, the number in this one
  };
  Status add(const std::filesystem::path& file, const LogSink& log);
  void finish();
  Result<BagMessage> unpacked(std::size_t topic, BagMessage message) const;
  std::string name_of(std::size_t topic, std::uint64_t index) const;

  std::filesystem::path path_;
  std::string format_;
  std::vector<File> files_;
  std::vector<std::filesystem::path> temporary_;  ///< decompressed files, removed at the end
  std::vector<BagTopic> topics_;
  std::vector<std::optional<MessageDefinition>> definitions_;  ///< of each topic whose messages can be read
  std::int64_t first_ns_ = 0, last_ns_ = 0;
};

}  // namespace revisit::io_internal
