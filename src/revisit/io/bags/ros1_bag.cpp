// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <map>
#include <optional>

#include <revisit/io/internal/byte_cursor.hpp>
#include <revisit/io/internal/chunked_bag.hpp>
#include <revisit/io/internal/decompress.hpp>
#include <revisit/io/internal/ros1_format.hpp>

namespace revisit::io_internal {
namespace {

class RecordFields {
 public:
  explicit RecordFields(ByteSpan header) {
    ByteCursor cursor(header);
    while (cursor.left() > 0) {
      const std::string_view field = cursor.text();
      const auto equals = field.find('=');
      if (equals == std::string_view::npos) break;
      fields_.emplace(field.substr(0, equals), field.substr(equals + 1));
    }
    is_whole_ = cursor.left() == 0 && !cursor.failed();
  }
  template <typename T>
  std::optional<T> number(std::string_view name) const {
    const auto found = fields_.find(name);
    if (found == fields_.end() || found->second.size() != sizeof(T)) return std::nullopt;
    return load_number<T>(reinterpret_cast<const std::uint8_t*>(found->second.data()));
  }
  std::string text(std::string_view name) const {
    const auto found = fields_.find(name);
    return found == fields_.end() ? std::string() : std::string(found->second);
  }
  std::int64_t time_ns(std::string_view name) const {
    const auto time = number<std::uint64_t>(name).value_or(0);
    return static_cast<std::int64_t>(time & 0xffffffff) * 1'000'000'000 + static_cast<std::int64_t>(time >> 32);
  }
  std::uint8_t op() const { return number<std::uint8_t>("op").value_or(0); }
  bool is_whole() const { return is_whole_; }

 private:
  std::map<std::string_view, std::string_view> fields_;
  bool is_whole_ = false;
};

class Ros1Bag final : public ChunkedBag {
 public:
  explicit Ros1Bag(RandomAccessFile file) : ChunkedBag(std::move(file)) {}

  Status open(const LogSink& log) {
    const auto magic = file_.read(0, std::min<std::uint64_t>(ros1::kMagic.size(), file_.size()));
    if (!magic) return magic.error();
    if (magic->bytes.empty()) return Error{file_.path().string() + ": empty file"};
    const std::string_view found(reinterpret_cast<const char*>(magic->bytes.data()), magic->bytes.size());
    if (found != ros1::kMagic)
      return Error{file_.path().string() + ": is no ROS 1 bag of version 2.0" +
                   (found.starts_with("#ROS") ? "; `rosbag fix` brings older ones up to date" : "")};
    if (!read_index()) {
      forget_index();
      if (const Status status = read_without_index(log); !status) return status;
    }
    finish_index();
    return ok();
  }

 private:
  struct Record {
    SharedBytes header;
    std::uint64_t data = 0, data_size = 0;
    std::uint64_t end() const { return data + data_size; }
  };

  Result<Record> record_at(std::uint64_t offset) const {
    constexpr std::uint64_t kLongestHeader = 1 << 20;
    const auto length = file_.read(offset, 4);
    if (!length) return length.error();
    const auto header_size = load_number<std::uint32_t>(length->bytes.data());
    if (header_size > kLongestHeader)
      return file_.error(offset, "a record's header of " + std::to_string(header_size) + " bytes");
    auto header = file_.read(offset + 4, header_size + 4);
    if (!header) return header.error();
    return Record{header->part(0, header_size), offset + 8 + header_size,
                  load_number<std::uint32_t>(header->bytes.data() + header_size)};
  }

  static BagTopic topic_in(const RecordFields& fields, ByteSpan data) {
    const RecordFields facts(data);
    return {fields.text("topic"), facts.text("type"), "ros1", facts.text("message_definition"), 0};
  }

  // False where there is none, or it is broken: a bag that was not closed.
  bool read_index() {
    const auto bag = record_at(ros1::kMagic.size());
    if (!bag) return false;
    const RecordFields header(bag->header.bytes);
    const auto index = header.number<std::uint64_t>("index_pos");
    if (header.op() != ros1::kBagHeader || !index || *index == 0 || *index > file_.size() ||
        file_.size() - *index > kLargestPiece)
      return false;
    const auto bytes = file_.read(*index, file_.size() - *index);
    if (!bytes) return false;
    ByteCursor cursor(bytes->bytes);
    while (cursor.left() > 0) {
      const RecordFields fields(cursor.block());
      const ByteSpan data = cursor.block();
      if (cursor.failed() || !fields.is_whole()) return false;
      if (fields.op() == ros1::kConnection)
        add_connection(fields.number<std::uint32_t>("conn").value_or(0), topic_in(fields, data));
      if (fields.op() == ros1::kChunkInfo && !add_chunk_info(fields, data)) return false;
    }
    std::uint64_t messages = 0;
    for (const Chunk& chunk : chunks_)
      for (const auto& [topic, count] : chunk.counts) messages += count;
    if (messages > file_.size()) return false;  // even compressed, a message takes a byte and more
    return chunks_.size() == header.number<std::uint32_t>("chunk_count").value_or(0);
  }

  bool add_chunk_info(const RecordFields& fields, ByteSpan data) {
    Chunk chunk;
    const auto offset = fields.number<std::uint64_t>("chunk_pos");
    if (!offset || *offset >= file_.size()) return false;
    chunk.offset = *offset;
    chunk.first_ns = fields.time_ns("start_time");
    chunk.last_ns = fields.time_ns("end_time");
    std::map<std::uint32_t, std::uint32_t> counts;
    for (ByteCursor cursor(data); cursor.left() > 0;) {
      const auto topic = topic_of(cursor.number<std::uint32_t>());
      const auto count = cursor.number<std::uint32_t>();
      if (cursor.failed() || !topic) return false;
      counts[*topic] += count;
    }
    chunk.counts.assign(counts.begin(), counts.end());
    chunks_.push_back(std::move(chunk));
    return true;
  }

  // Chunk by chunk from the front, as far as they are whole.
  Status read_without_index(const LogSink& log) {
    std::size_t chunks = 0, broken = 0;
    std::uint64_t offset = ros1::kMagic.size();
    while (offset < file_.size()) {
      const auto record = record_at(offset);
      if (!record) break;
      const RecordFields fields(record->header.bytes);
      if (fields.op() == ros1::kChunk) {
        ++chunks;
        Chunk chunk;
        chunk.offset = offset;
        const auto bytes = load(chunk);
        if (bytes) learn_connections(bytes->bytes);
        if (!bytes || !add_chunk_without_index(chunk, *bytes)) ++broken;
      } else if (fields.op() == 0) {
        break;
      }
      offset = record->end();
    }
    if (chunks == 0) return file_.error(offset, "the bag has no index, and no chunk is found from here");
    log_to(log, LogLevel::kWarning,
           file_.path().string() + ": was not closed (no index); " + std::to_string(chunks - broken) + " of " +
               std::to_string(chunks) + " chunks can be read" +
               (broken > 0 ? "; messages of the others are left out" : ""));
    return ok();
  }

  void learn_connections(ByteSpan bytes) {
    for (ByteCursor cursor(bytes); cursor.left() > 0;) {
      const RecordFields fields(cursor.block());
      const ByteSpan data = cursor.block();
      if (cursor.failed()) return;
      if (fields.op() == ros1::kConnection)
        add_connection(fields.number<std::uint32_t>("conn").value_or(0), topic_in(fields, data));
    }
  }

  Result<SharedBytes> load(const Chunk& chunk) const override {
    const auto record = record_at(chunk.offset);
    if (!record) return record.error();
    const RecordFields fields(record->header.bytes);
    const auto size = fields.number<std::uint32_t>("size");
    if (fields.op() != ros1::kChunk || !size) return file_.error(chunk.offset, "is no chunk");
    const auto data = file_.read(record->data, record->data_size);
    if (!data) return data.error();
    auto bytes = decompress(fields.text("compression"), *data, *size);
    if (!bytes) return file_.error(chunk.offset, bytes.error().message);
    return bytes;
  }

  Result<std::vector<Entry>> entries(ByteSpan bytes) const override {
    std::vector<Entry> result;
    for (ByteCursor cursor(bytes); cursor.left() > 0;) {
      const ByteSpan header = cursor.block();
      const ByteSpan data = cursor.block();
      if (cursor.failed()) return Error{"a record in the chunk goes beyond its end"};
      const RecordFields fields(header);
      const auto connection = fields.number<std::uint32_t>("conn");
      if (fields.op() != ros1::kMessage || !connection) continue;
      if (const auto topic = topic_of(*connection))
        result.push_back({*topic, fields.time_ns("time"), cursor.position() - data.size(), data.size()});
    }
    return result;
  }
};

}  // namespace

Result<std::unique_ptr<BagFile>> open_ros1_bag(const std::filesystem::path& file, const LogSink& log) {
  return open_chunked_bag<Ros1Bag>(file, log);
}

}  // namespace revisit::io_internal
