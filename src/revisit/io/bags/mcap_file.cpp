// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <map>
#include <optional>

#include <zlib.h>

#include <revisit/io/internal/byte_cursor.hpp>
#include <revisit/io/internal/chunked_bag.hpp>
#include <revisit/io/internal/decompress.hpp>
#include <revisit/io/internal/mcap_format.hpp>

namespace revisit::io_internal {
namespace {

std::int64_t to_ns(std::uint64_t time) { return static_cast<std::int64_t>(std::min(time, std::uint64_t{1} << 61)); }

class McapFile final : public ChunkedBag {
 public:
  explicit McapFile(RandomAccessFile file) : ChunkedBag(std::move(file)) {}

  Status open(const LogSink& log) {
    if (file_.size() == 0) return Error{file_.path().string() + ": empty file"};
    const auto magic = file_.read(0, std::min<std::uint64_t>(mcap::kMagic.size(), file_.size()));
    if (!magic) return magic.error();
    if (std::string_view(reinterpret_cast<const char*>(magic->bytes.data()), magic->bytes.size()) != mcap::kMagic)
      return Error{file_.path().string() + ": does not begin as an .mcap file of version 0"};
    if (!read_summary()) {
      forget_index();
      if (const Status status = read_without_index(log); !status) return status;
    }
    finish_index();
    return ok();
  }

 private:
  struct Record {
    std::uint8_t op = 0;
    std::uint64_t size = 0;
  };

  Result<Record> record_at(std::uint64_t offset) const {
    const auto head = file_.read(offset, mcap::kRecordHead);
    if (!head) return head.error();
    const Record record{head->bytes[0], load_number<std::uint64_t>(head->bytes.data() + 1)};
    if (record.size > file_.size() - offset - mcap::kRecordHead)
      return file_.error(offset, "a record of " + std::to_string(record.size) + " bytes goes beyond the end");
    return record;
  }

  // The summary at the end; false where there is none, or it says too little to find every message.
  bool read_summary() {
    constexpr std::uint64_t kFooterSize = mcap::kRecordHead + 20;
    if (file_.size() < 2 * mcap::kMagic.size() + kFooterSize) return false;
    const std::uint64_t footer_at = file_.size() - mcap::kMagic.size() - kFooterSize;
    const auto footer = file_.read(footer_at, kFooterSize + mcap::kMagic.size());
    if (!footer || footer->bytes[0] != mcap::kFooter) return false;
    if (!std::equal(mcap::kMagic.begin(), mcap::kMagic.end(),
                    footer->bytes.end() - static_cast<std::ptrdiff_t>(mcap::kMagic.size()),
                    [](char a, std::uint8_t b) { return static_cast<std::uint8_t>(a) == b; }))
      return false;
    const auto start = load_number<std::uint64_t>(footer->bytes.data() + mcap::kRecordHead);
    if (start == 0 || start >= footer_at || footer_at - start > kLargestPiece) return false;
    const auto summary = file_.read(start, footer_at - start);
    if (!summary) return false;
    std::optional<std::uint64_t> expected;
    for (ByteCursor cursor(summary->bytes); cursor.left() > 0;) {
      const auto op = cursor.number<std::uint8_t>();
      const ByteSpan content = cursor.take(cursor.number<std::uint64_t>());
      if (cursor.failed() || !learn(op, content)) return false;
      if (op == mcap::kChunkIndex && !add_chunk_index(content)) return false;
      if (op == mcap::kStatistics) expected = ByteCursor(content).number<std::uint64_t>();
    }
    std::uint64_t found = 0;
    for (const Chunk& chunk : chunks_)
      for (const auto& [topic, count] : chunk.counts) found += count;
    return expected ? found == *expected : found > 0;
  }

  // What schemas and channels say. False where it cannot be read.
  bool learn(std::uint8_t op, ByteSpan content) {
    ByteCursor cursor(content);
    if (op == mcap::kSchema) {
      const auto id = cursor.number<std::uint16_t>();
      Schema schema{std::string(cursor.text()), std::string(cursor.text()), {}};
      schema.text = cursor.text();
      schemas_[id] = std::move(schema);
    } else if (op == mcap::kChannel) {
      const auto id = cursor.number<std::uint16_t>();
      const auto schema = schemas_.find(cursor.number<std::uint16_t>());
      BagTopic topic;
      topic.name = cursor.text();
      topic.encoding = cursor.text();
      if (schema != schemas_.end()) {
        topic.type = schema->second.name;
        if (schema->second.encoding == "ros1msg" || schema->second.encoding == "ros2msg")
          topic.definition = schema->second.text;
      }
      add_connection(id, std::move(topic));
    }
    return !cursor.failed();
  }

  // How many messages of each channel: the lengths of the message indexes, which lie behind the chunk one by one.
  bool add_chunk_index(ByteSpan content) {
    ByteCursor cursor(content);
    Chunk chunk;
    chunk.first_ns = to_ns(cursor.number<std::uint64_t>());
    chunk.last_ns = to_ns(cursor.number<std::uint64_t>());
    chunk.offset = cursor.number<std::uint64_t>();
    chunk.size = cursor.number<std::uint64_t>();
    std::map<std::uint64_t, std::uint32_t> channel_at;
    for (ByteCursor offsets(cursor.block()); offsets.left() > 0;) {
      const auto channel = offsets.number<std::uint16_t>();
      channel_at[offsets.number<std::uint64_t>()] = channel;
      if (offsets.failed()) return false;
    }
    const auto indexes_size = cursor.number<std::uint64_t>();
    if (cursor.failed() || chunk.offset > file_.size() || chunk.size > file_.size() - chunk.offset) return false;
    if (channel_at.empty()) return indexes_size == 0 && chunk.first_ns == 0 && chunk.last_ns == 0;
    constexpr std::uint64_t kIndexHead = mcap::kRecordHead + 6, kIndexRow = 16;
    const std::uint64_t end = chunk.offset + chunk.size + indexes_size;
    std::map<std::uint32_t, std::uint32_t> counts;
    for (auto it = channel_at.begin(); it != channel_at.end(); ++it) {
      const std::uint64_t next = std::next(it) != channel_at.end() ? std::next(it)->first : end;
      const auto topic = topic_of(it->second);
      if (!topic || next < it->first + kIndexHead) return false;
      const std::uint64_t size = next - it->first - kIndexHead;
      if (size % kIndexRow != 0 || size / kIndexRow > chunk.size * 1024) return false;
      if (size > 0) counts[*topic] += static_cast<std::uint32_t>(size / kIndexRow);
    }
    chunk.counts.assign(counts.begin(), counts.end());
    chunks_.push_back(std::move(chunk));
    return true;
  }

  // Record by record from the front, as far as they are whole.
  Status read_without_index(const LogSink& log) {
    constexpr std::uint64_t kLargestRun = 4 << 20;
    std::size_t broken = 0;
    std::uint64_t offset = mcap::kMagic.size(), run = 0;  // where a run of bare messages began
    bool is_closed = false;
    const auto end_run = [&](std::uint64_t end) {
      if (run == 0) return;
      Chunk chunk;
      chunk.offset = run;
      chunk.size = end - run;
      chunk.is_bare = true;
      run = 0;
      const auto bytes = load(chunk);
      if (!bytes || !add_chunk_without_index(chunk, *bytes)) ++broken;
    };
    while (offset < file_.size()) {
      const auto record = record_at(offset);
      if (!record) break;
      if (record->op != mcap::kMessage || (run != 0 && offset - run > kLargestRun)) end_run(offset);
      if (record->op == mcap::kMessage && run == 0) run = offset;
      if (record->op == mcap::kSchema || record->op == mcap::kChannel) {
        const auto content = file_.read(offset + mcap::kRecordHead, record->size);
        if (!content || !learn(record->op, content->bytes)) ++broken;
      } else if (record->op == mcap::kChunk) {
        Chunk chunk;
        chunk.offset = offset;
        chunk.size = mcap::kRecordHead + record->size;
        const auto bytes = load(chunk);
        if (bytes) learn_all(bytes->bytes);
        if (!bytes || !add_chunk_without_index(chunk, *bytes)) ++broken;
      } else if (record->op == mcap::kDataEnd || record->op == mcap::kFooter) {
        is_closed = true;
        break;
      } else if (record->op == 0) {
        break;
      }
      offset += mcap::kRecordHead + record->size;
    }
    end_run(std::min(offset, file_.size()));
    if (!is_closed || broken > 0)
      log_to(log, LogLevel::kWarning,
             file_.path().string() + (is_closed ? ": " : ": was not closed (its end is missing); ") +
                 std::to_string(chunks_.size()) + " pieces can be read, " + std::to_string(broken) + " are broken");
    return ok();
  }

  void learn_all(ByteSpan bytes) {
    for (ByteCursor cursor(bytes); cursor.left() > 0;) {
      const auto op = cursor.number<std::uint8_t>();
      const ByteSpan content = cursor.take(cursor.number<std::uint64_t>());
      if (cursor.failed() || !learn(op, content)) return;
    }
  }

  Result<SharedBytes> load(const Chunk& chunk) const override {
    const auto record = file_.read(chunk.offset, chunk.size);
    if (!record || chunk.is_bare) return record;
    ByteCursor cursor(record->bytes);
    const auto op = cursor.number<std::uint8_t>();
    cursor.take(8 + 16);  // length; first and last time
    const auto size = cursor.number<std::uint64_t>();
    const auto checksum = cursor.number<std::uint32_t>();
    const std::string_view method = cursor.text();
    const ByteSpan data = cursor.take(cursor.number<std::uint64_t>());
    if (op != mcap::kChunk || cursor.failed()) return file_.error(chunk.offset, "is no whole chunk");
    auto bytes = decompress(method, {record->owner, data}, size);
    if (!bytes) return file_.error(chunk.offset, bytes.error().message);
    if (checksum != 0 && crc32_z(0, bytes->bytes.data(), bytes->bytes.size()) != checksum)
      return file_.error(chunk.offset, "the chunk's checksum is wrong: its data were changed");
    return bytes;
  }

  Result<std::vector<Entry>> entries(ByteSpan bytes) const override {
    constexpr std::size_t kMessageHead = 22;  // channel, sequence, log and publish time
    std::vector<Entry> result;
    for (ByteCursor cursor(bytes); cursor.left() > 0;) {
      const auto op = cursor.number<std::uint8_t>();
      const ByteSpan content = cursor.take(cursor.number<std::uint64_t>());
      if (cursor.failed()) return Error{"a record in the chunk goes beyond its end"};
      if (op != mcap::kMessage) continue;
      if (content.size() < kMessageHead) return Error{"a message in the chunk has no head"};
      ByteCursor head(content);
      const auto topic = topic_of(head.number<std::uint16_t>());
      head.number<std::uint32_t>();
      const std::int64_t time_ns = to_ns(head.number<std::uint64_t>());
      if (topic)
        result.push_back(
            {*topic, time_ns, cursor.position() - content.size() + kMessageHead, content.size() - kMessageHead});
    }
    return result;
  }

  struct Schema {
    std::string name, encoding, text;
  };
  std::map<std::uint16_t, Schema> schemas_;
};

}  // namespace

Result<std::unique_ptr<BagFile>> open_mcap(const std::filesystem::path& file, const LogSink& log) {
  return open_chunked_bag<McapFile>(file, log);
}

}  // namespace revisit::io_internal
