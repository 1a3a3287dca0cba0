// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <limits>
#include <map>
#include <vector>

#include <lz4frame.h>

#include <revisit/io/internal/bag_file_writer.hpp>
#include <revisit/io/internal/byte_buffer.hpp>
#include <revisit/io/internal/ros1_format.hpp>
#include <revisit/io/internal/text_writer.hpp>

namespace revisit::io_internal {
namespace {

// Fields of a record's header.
class RecordHeader {
 public:
  template <typename T>
  RecordHeader& number(std::string_view name, T value) {
    ByteBuffer field;
    field.raw(name).raw("=").number(value);
    bytes_.text(field.bytes());
    return *this;
  }
  RecordHeader& text(std::string_view name, std::string_view value) {
    bytes_.text(std::string(name) + "=" + std::string(value));
    return *this;
  }
  const std::string& bytes() const { return bytes_.bytes(); }

 private:
  ByteBuffer bytes_;
};

std::uint64_t ros_time(std::int64_t time_ns) {
  return static_cast<std::uint64_t>(time_ns / 1'000'000'000) | static_cast<std::uint64_t>(time_ns % 1'000'000'000)
                                                                   << 32;
}

class Ros1BagWriter final : public BagFileWriter {
 public:
  explicit Ros1BagWriter(const std::filesystem::path& file) : file_(file) { write_head(0, 0); }

  Serialisation serialisation() const override { return Serialisation::kRos1; }

  Status add_topic(const std::string& name, const std::string& type) override {
    RecordHeader facts;
    facts.text("topic", name).text("type", type).text("md5sum", md5_of(type));
    facts.text("message_definition", definition_for_bag(type, true));
    ByteBuffer record;
    record.text(RecordHeader()
                    .number("op", ros1::kConnection)
                    .number("conn", static_cast<std::uint32_t>(connections_.size()))
                    .text("topic", name)
                    .bytes());
    record.text(facts.bytes());
    connections_.push_back(record.bytes());
    is_in_chunk_.push_back(false);
    return ok();
  }

  Status write(std::size_t topic, std::int64_t log_time_ns, const std::string& message) override {
    // ROS knows no time of 0.
    const std::int64_t time_ns = std::max<std::int64_t>(log_time_ns, 1);
    if (!is_in_chunk_[topic]) chunk_.raw(connections_[topic]);
    is_in_chunk_[topic] = true;
    index_[topic].emplace_back(ros_time(time_ns), static_cast<std::uint32_t>(chunk_.size()));
    first_ns_ = std::min(first_ns_, time_ns);
    last_ns_ = std::max(last_ns_, time_ns);
    chunk_.text(RecordHeader()
                    .number("op", ros1::kMessage)
                    .number("conn", static_cast<std::uint32_t>(topic))
                    .number("time", ros_time(time_ns))
                    .bytes());
    chunk_.text(message);
    return chunk_.size() < kBagChunkBytes ? ok() : end_chunk();
  }

  Status finish() override {
    if (const Status status = end_chunk(); !status) return status;
    const std::uint64_t index_at = at_;
    for (const std::string& connection : connections_) put(connection);
    for (const std::string& info : chunk_infos_) put(info);
    file_.stream().seekp(0);
    at_ = 0;
    write_head(index_at, static_cast<std::uint32_t>(chunk_infos_.size()));
    return file_.finish();
  }

 private:
  void put(std::string_view bytes) {
    file_.stream() << bytes;
    at_ += bytes.size();
  }

  // Padded to 4096 bytes, so that it can be written again.
  void write_head(std::uint64_t index_at, std::uint32_t chunks) {
    constexpr std::size_t kHeadBytes = 4096;
    const std::string header = RecordHeader()
                                   .number("op", ros1::kBagHeader)
                                   .number("index_pos", index_at)
                                   .number("conn_count", static_cast<std::uint32_t>(connections_.size()))
                                   .number("chunk_count", chunks)
                                   .bytes();
    ByteBuffer record;
    record.text(header).text(std::string(kHeadBytes - 8 - header.size(), ' '));
    put(ros1::kMagic);
    put(record.bytes());
  }

  Status end_chunk() {
    if (index_.empty()) return ok();
    const std::string packed = compress(chunk_.bytes());
    const std::uint64_t begin = at_;
    ByteBuffer record;
    record.text(RecordHeader()
                    .number("op", ros1::kChunk)
                    .text("compression", "lz4")
                    .number("size", static_cast<std::uint32_t>(chunk_.size()))
                    .bytes());
    record.text(packed);
    ByteBuffer counts;
    for (const auto& [topic, entries] : index_) {
      record.text(RecordHeader()
                      .number("op", ros1::kIndex)
                      .number("ver", std::uint32_t{1})
                      .number("conn", static_cast<std::uint32_t>(topic))
                      .number("count", static_cast<std::uint32_t>(entries.size()))
                      .bytes());
      ByteBuffer rows;
      for (const auto& [time, offset] : entries) rows.number(time).number(offset);
      record.text(rows.bytes());
      counts.number(static_cast<std::uint32_t>(topic)).number(static_cast<std::uint32_t>(entries.size()));
    }
    put(record.bytes());
    ByteBuffer info;
    info.text(RecordHeader()
                  .number("op", ros1::kChunkInfo)
                  .number("ver", std::uint32_t{1})
                  .number("chunk_pos", begin)
                  .number("start_time", ros_time(first_ns_))
                  .number("end_time", ros_time(last_ns_))
                  .number("count", static_cast<std::uint32_t>(index_.size()))
                  .bytes());
    info.text(counts.bytes());
    chunk_infos_.push_back(info.bytes());
    chunk_.clear();
    index_.clear();
    std::fill(is_in_chunk_.begin(), is_in_chunk_.end(), false);
    first_ns_ = std::numeric_limits<std::int64_t>::max();
    last_ns_ = std::numeric_limits<std::int64_t>::min();
    return file_.flush();
  }

  // What rosbag reads: blocks that do not depend on each other.
  static std::string compress(const std::string& bytes) {
    LZ4F_preferences_t preferences = LZ4F_INIT_PREFERENCES;
    preferences.frameInfo.blockMode = LZ4F_blockIndependent;
    preferences.frameInfo.contentChecksumFlag = LZ4F_contentChecksumEnabled;
    std::string packed(LZ4F_compressFrameBound(bytes.size(), &preferences), '\0');
    packed.resize(LZ4F_compressFrame(packed.data(), packed.size(), bytes.data(), bytes.size(), &preferences));
    return packed;
  }

  TextWriter file_;
  std::uint64_t at_ = 0;
  std::vector<std::string> connections_, chunk_infos_;
  std::vector<bool> is_in_chunk_;
  ByteBuffer chunk_;
  std::map<std::size_t, std::vector<std::pair<std::uint64_t, std::uint32_t>>> index_;  ///< of the chunk, by topic
  std::int64_t first_ns_ = std::numeric_limits<std::int64_t>::max(),
               last_ns_ = std::numeric_limits<std::int64_t>::min();
};

}  // namespace

Result<std::unique_ptr<BagFileWriter>> create_ros1_bag(const std::filesystem::path& file) {
  return std::unique_ptr<BagFileWriter>(std::make_unique<Ros1BagWriter>(file));
}

}  // namespace revisit::io_internal
