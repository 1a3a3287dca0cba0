// SPDX-License-Identifier: Apache-2.0
#include <revisit/io/internal/chunked_bag.hpp>

#include <algorithm>
#include <stdexcept>

namespace revisit::io_internal {

void ChunkedBag::add_connection(std::uint32_t connection, BagTopic topic) {
  const auto same = [&](const BagTopic& other) {
    return other.name == topic.name && other.type == topic.type && other.encoding == topic.encoding;
  };
  const auto found = std::find_if(topics_.begin(), topics_.end(), same);
  topic_of_connection_.emplace(connection, static_cast<std::uint32_t>(found - topics_.begin()));
  if (found == topics_.end()) topics_.push_back(std::move(topic));
}

std::optional<std::uint32_t> ChunkedBag::topic_of(std::uint32_t connection) const {
  const auto found = topic_of_connection_.find(connection);
  return found == topic_of_connection_.end() ? std::nullopt : std::optional(found->second);
}

void ChunkedBag::forget_index() {
  topics_.clear();
  chunks_.clear();
  topic_of_connection_.clear();
}

bool ChunkedBag::add_chunk_without_index(Chunk chunk, const SharedBytes& bytes) {
  const auto messages = entries(bytes.bytes);
  if (!messages) return false;
  std::map<std::uint32_t, std::uint32_t> counts;
  for (const Entry& entry : *messages) {
    chunk.first_ns = counts.empty() ? entry.log_time_ns : std::min(chunk.first_ns, entry.log_time_ns);
    chunk.last_ns = counts.empty() ? entry.log_time_ns : std::max(chunk.last_ns, entry.log_time_ns);
    ++counts[entry.topic];
  }
  chunk.counts.assign(counts.begin(), counts.end());
  if (!chunk.counts.empty()) chunks_.push_back(std::move(chunk));
  return true;
}

void ChunkedBag::finish_index() {
  std::stable_sort(chunks_.begin(), chunks_.end(),
                   [](const Chunk& a, const Chunk& b) { return a.first_ns < b.first_ns; });
  places_.assign(topics_.size(), {});
  bool is_first = true;
  for (std::size_t i = 0; i < chunks_.size(); ++i) {
    const Chunk& chunk = chunks_[i];
    if (chunk.counts.empty()) continue;
    first_ns_ = is_first ? chunk.first_ns : std::min(first_ns_, chunk.first_ns);
    last_ns_ = is_first ? chunk.last_ns : std::max(last_ns_, chunk.last_ns);
    is_first = false;
    for (const auto& [topic, count] : chunk.counts) {
      places_[topic].push_back({i, topics_[topic].messages});
      topics_[topic].messages += count;
    }
  }
}

Result<std::shared_ptr<const ChunkedBag::Loaded>> ChunkedBag::loaded(std::size_t chunk) const {
  // A few, whose memory is soon used again; and all that odometry and an IMU need around a cloud, where they are read.
  constexpr std::size_t kFew = 4, kAroundBytes = 64 << 20;
  {
    const std::lock_guard lock(mutex_);
    for (auto it = recent_.begin(); it != recent_.end(); ++it)
      if (it->first == chunk) {
        recent_.splice(recent_.begin(), recent_, it);
        return recent_.front().second;
      }
  }
  auto bytes = load(chunks_[chunk]);
  if (!bytes) return bytes.error();
  auto messages = entries(bytes->bytes);
  if (!messages) return file_.error(chunks_[chunk].offset, messages.error().message);
  // Programs with several threads write messages as they come.
  std::stable_sort(messages->begin(), messages->end(),
                   [](const Entry& a, const Entry& b) { return a.log_time_ns < b.log_time_ns; });
  auto made = std::make_shared<const Loaded>(Loaded{*std::move(bytes), *std::move(messages)});
  const std::lock_guard lock(mutex_);
  recent_.emplace_front(chunk, made);
  recent_bytes_ += made->bytes.bytes.size();
  while (recent_.size() > kFew && (!keeps_around_ || recent_bytes_ > kAroundBytes)) {
    recent_bytes_ -= recent_.back().second->bytes.bytes.size();
    recent_.pop_back();
  }
  return made;
}

const ChunkedBag::Place& ChunkedBag::place_of(std::size_t topic, std::uint64_t index) const {
  if (index >= topics_.at(topic).messages) throw std::out_of_range("message " + std::to_string(index));
  const auto after = std::upper_bound(places_[topic].begin(), places_[topic].end(), index,
                                      [](std::uint64_t i, const Place& place) { return i < place.first; });
  return *std::prev(after);
}

Result<BagMessage> ChunkedBag::read(std::size_t topic, std::uint64_t index) const {
  const Place& place = place_of(topic, index);
  const auto chunk = loaded(place.chunk);
  if (!chunk) return chunk.error();
  std::uint64_t left = index - place.first;
  for (const Entry& entry : (*chunk)->entries)
    if (entry.topic == topic && left-- == 0)
      return BagMessage{entry.log_time_ns, (*chunk)->bytes.part(entry.offset, entry.size)};
  return file_.error(chunks_[place.chunk].offset,
                     "the chunk holds fewer messages of " + topics_[topic].name + " than its index says");
}

Status ChunkedBag::visit(std::size_t topic, std::int64_t from_ns, std::int64_t to_ns,
                         const std::function<bool(const BagMessage&)>& use) const {
  {
    const std::lock_guard lock(mutex_);
    keeps_around_ = true;
  }
  for (const Place& place : places_.at(topic)) {
    const Chunk& chunk = chunks_[place.chunk];
    if (chunk.first_ns > to_ns) break;
    if (chunk.last_ns < from_ns) continue;
    const auto bytes = loaded(place.chunk);
    if (!bytes) return bytes.error();
    for (const Entry& entry : (*bytes)->entries) {
      if (entry.topic != topic || entry.log_time_ns < from_ns || entry.log_time_ns > to_ns) continue;
      if (!use({entry.log_time_ns, (*bytes)->bytes.part(entry.offset, entry.size)})) return ok();
    }
  }
  return ok();
}

}  // namespace revisit::io_internal
