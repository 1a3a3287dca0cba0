// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <limits>
#include <map>
#include <vector>

#include <zlib.h>
#include <zstd.h>

#include <revisit/io/internal/bag_file_writer.hpp>
#include <revisit/io/internal/byte_buffer.hpp>
#include <revisit/io/internal/mcap_format.hpp>
#include <revisit/io/internal/text_writer.hpp>

namespace revisit::io_internal {
namespace {

std::string mcap_record(mcap::Op op, const std::string& content) {
  ByteBuffer bytes;
  bytes.number(static_cast<std::uint8_t>(op)).number(std::uint64_t{content.size()}).raw(content);
  return bytes.bytes();
}

class McapWriter final : public BagFileWriter {
 public:
  explicit McapWriter(const std::filesystem::path& file) : file_(file) {
    put(mcap::kMagic);
    put(mcap_record(mcap::kHeader, ByteBuffer().text("ros2").text("revisit").bytes()));
  }

  Serialisation serialisation() const override { return Serialisation::kCdr; }

  Status add_topic(const std::string& name, const std::string& type) override {
    const auto id = static_cast<std::uint16_t>(counts_.size() + 1);
    const std::string full = type.substr(0, type.find('/')) + "/msg" + type.substr(type.find('/'));
    std::string facts =
        mcap_record(mcap::kSchema,
                    ByteBuffer().number(id).text(full).text("ros2msg").text(definition_for_bag(type, false)).bytes());
    facts += mcap_record(mcap::kChannel, ByteBuffer().number(id).number(id).text(name).text("cdr").text("").bytes());
    chunk_.raw(facts);  // with the messages, and in the summary again
    facts_ += facts;
    counts_.push_back(0);
    return ok();
  }

  Status write(std::size_t topic, std::int64_t log_time_ns, const std::string& message) override {
    const auto time = static_cast<std::uint64_t>(std::max<std::int64_t>(log_time_ns, 0));
    const auto channel = static_cast<std::uint16_t>(topic + 1);
    index_[channel].number(time).number(std::uint64_t{chunk_.size()});
    first_ = std::min(first_, time);
    last_ = std::max(last_, time);
    ByteBuffer head;
    head.number(static_cast<std::uint8_t>(mcap::kMessage)).number(std::uint64_t{22 + message.size()}).number(channel);
    head.number(static_cast<std::uint32_t>(counts_[topic]++)).number(time).number(time);
    chunk_.raw(head.bytes()).raw(message);
    return chunk_.size() < kBagChunkBytes ? ok() : end_chunk();
  }

  Status finish() override {
    if (const Status status = end_chunk(); !status) return status;
    put(mcap_record(mcap::kDataEnd, ByteBuffer().number(std::uint32_t{0}).bytes()));
    const std::uint64_t summary = at_;
    put(facts_);
    put(chunk_indexes_);
    put(statistics());
    put(mcap_record(mcap::kFooter,
                    ByteBuffer().number(summary).number(std::uint64_t{0}).number(std::uint32_t{0}).bytes()));
    put(mcap::kMagic);
    return file_.finish();
  }

 private:
  void put(std::string_view bytes) {
    file_.stream() << bytes;
    at_ += bytes.size();
  }

  Status end_chunk() {
    if (index_.empty()) return ok();
    std::string packed(ZSTD_compressBound(chunk_.size()), '\0');
    packed.resize(ZSTD_compress(packed.data(), packed.size(), chunk_.bytes().data(), chunk_.size(), 1));
    const std::uint64_t begin = at_;
    const auto checksum = static_cast<std::uint32_t>(
        crc32_z(0, reinterpret_cast<const unsigned char*>(chunk_.bytes().data()), chunk_.size()));
    ByteBuffer chunk;
    chunk.number(first_).number(last_).number(std::uint64_t{chunk_.size()}).number(checksum).text("zstd");
    chunk.number(std::uint64_t{packed.size()}).raw(packed);
    put(mcap_record(mcap::kChunk, chunk.bytes()));
    const std::uint64_t end = at_;
    ByteBuffer offsets;
    for (const auto& [channel, rows] : index_) {
      offsets.number(channel).number(at_);
      put(mcap_record(mcap::kMessageIndex, ByteBuffer().number(channel).text(rows.bytes()).bytes()));
    }
    ByteBuffer index;
    index.number(first_).number(last_).number(begin).number(end - begin).text(offsets.bytes()).number(at_ - end);
    index.text("zstd").number(std::uint64_t{packed.size()}).number(std::uint64_t{chunk_.size()});
    chunk_indexes_ += mcap_record(mcap::kChunkIndex, index.bytes());
    ++chunks_;
    first_of_all_ = std::min(first_of_all_, first_);
    last_of_all_ = std::max(last_of_all_, last_);
    first_ = std::numeric_limits<std::uint64_t>::max();
    last_ = 0;
    chunk_.clear();
    index_.clear();
    return file_.flush();
  }

  std::string statistics() const {
    std::uint64_t messages = 0;
    ByteBuffer by_channel;
    for (std::size_t i = 0; i < counts_.size(); ++i) {
      by_channel.number(static_cast<std::uint16_t>(i + 1)).number(counts_[i]);
      messages += counts_[i];
    }
    ByteBuffer content;
    content.number(messages)
        .number(static_cast<std::uint16_t>(counts_.size()))
        .number(static_cast<std::uint32_t>(counts_.size()));
    content.number(std::uint32_t{0}).number(std::uint32_t{0}).number(chunks_);
    content.number(messages > 0 ? first_of_all_ : 0).number(last_of_all_).text(by_channel.bytes());
    return mcap_record(mcap::kStatistics, content.bytes());
  }

  TextWriter file_;
  std::uint64_t at_ = 0;
  std::string facts_, chunk_indexes_;
  std::vector<std::uint64_t> counts_;  ///< of messages, by topic
  std::uint32_t chunks_ = 0;
  ByteBuffer chunk_;
  std::map<std::uint16_t, ByteBuffer> index_;  ///< of the chunk, by channel
  std::uint64_t first_ = std::numeric_limits<std::uint64_t>::max(), last_ = 0;
  std::uint64_t first_of_all_ = std::numeric_limits<std::uint64_t>::max(), last_of_all_ = 0;
};

}  // namespace

Result<std::unique_ptr<BagFileWriter>> create_mcap(const std::filesystem::path& file) {
  return std::unique_ptr<BagFileWriter>(std::make_unique<McapWriter>(file));
}

}  // namespace revisit::io_internal
