// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <list>
#include <map>
#include <mutex>
#include <optional>
#include <utility>

#include <revisit/io/internal/bag_file.hpp>

namespace revisit::io_internal {

/// What ROS 1 bags and .mcap files share: messages lie in chunks, each compressed as a whole, and an index at the end
/// tells what is in which. Only the index is kept; the last few chunks stay decompressed.
class ChunkedBag : public BagFile {
 public:
  struct Chunk {
    std::uint64_t offset = 0;  ///< of its record
    std::uint64_t size = 0;    ///< of its record, where the index knows it
    std::int64_t first_ns = 0, last_ns = 0;
    bool is_bare = false;                                         ///< messages that stand in the file without a chunk
    std::vector<std::pair<std::uint32_t, std::uint32_t>> counts;  ///< topic and its messages
  };
  struct Entry {  ///< a message in the bytes of its chunk
    std::uint32_t topic = 0;
    std::int64_t log_time_ns = 0;
    std::size_t offset = 0, size = 0;
  };

  const std::vector<BagTopic>& topics() const override { return topics_; }
  std::int64_t first_ns() const override { return first_ns_; }
  std::int64_t last_ns() const override { return last_ns_; }
  Result<BagMessage> read(std::size_t topic, std::uint64_t index) const override;
  Status visit(std::size_t topic, std::int64_t from_ns, std::int64_t to_ns,
               const std::function<bool(const BagMessage&)>& use) const override;

 protected:
  explicit ChunkedBag(RandomAccessFile file) : file_(std::move(file)) {}
  virtual Result<SharedBytes> load(const Chunk& chunk) const = 0;
  /// The messages in a chunk, in their order. An error only where its records cannot be told apart.
  virtual Result<std::vector<Entry>> entries(ByteSpan bytes) const = 0;

  /// The topic of a connection (ROS 1) or channel (.mcap), known from then on.
  void add_connection(std::uint32_t connection, BagTopic topic);
  std::optional<std::uint32_t> topic_of(std::uint32_t connection) const;
  /// The index was no good.
  void forget_index();
  /// The index is complete: chunks are put in the order of their times, and messages counted.
  void finish_index();
  /// Counts the messages of a chunk that no index speaks of. False where its data cannot be read.
  bool add_chunk_without_index(Chunk chunk, const SharedBytes& bytes);

  RandomAccessFile file_;
  std::vector<BagTopic> topics_;
  std::vector<Chunk> chunks_;

 private:
  struct Loaded {
    SharedBytes bytes;
    std::vector<Entry> entries;
  };
  struct Place {  ///< of messages of one topic
    std::size_t chunk = 0;
    std::uint64_t first = 0;
  };
  Result<std::shared_ptr<const Loaded>> loaded(std::size_t chunk) const;
  const Place& place_of(std::size_t topic, std::uint64_t index) const;

  std::map<std::uint32_t, std::uint32_t> topic_of_connection_;
  std::vector<std::vector<Place>> places_;  ///< of each topic, in order
  std::int64_t first_ns_ = 0, last_ns_ = 0;
  mutable std::mutex mutex_;
  mutable std::list<std::pair<std::size_t, std::shared_ptr<const Loaded>>> recent_;
  mutable std::size_t recent_bytes_ = 0;
  mutable bool keeps_around_ = false;  ///< messages are asked for by their times
};

/// A bag of a format derived from ChunkedBag, whose open() reads what the file holds.
template <typename Format>
Result<std::unique_ptr<BagFile>> open_chunked_bag(const std::filesystem::path& file, const LogSink& log) {
  auto opened = RandomAccessFile::open(file);
  if (!opened) return opened.error();
  auto bag = std::make_unique<Format>(*std::move(opened));
  if (const Status status = bag->open(log); !status) return status.error();
  return std::unique_ptr<BagFile>(std::move(bag));
}

}  // namespace revisit::io_internal
