// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cstring>
#include <stdexcept>
#include <string>

#include <revisit/retrieval/internal/place_store.hpp>

namespace revisit::retrieval_internal {

ChunkLayout::ChunkLayout(int rings, int sectors, int levels)
    : cells(static_cast<std::size_t>(rings) * static_cast<std::size_t>(sectors)),
      place(revisit_bits_place_bytes(static_cast<std::uint32_t>(rings * std::max(1, levels)),
                                     static_cast<std::uint32_t>(sectors))) {
  constexpr std::size_t kBytesOfBounds =
      REVISIT_BITS_COLUMNS + sizeof(std::uint32_t) + sizeof(std::int64_t) + sizeof(double);
  begin[kImages] = kPlaces * kBytesOfBounds;  // whole pages, for 4,096 places
  for (std::size_t part = kImages; part < kParts; ++part)
    begin[part + 1] = begin[part] + kGroup * (part < kIntensities ? place : cells);
}

PlaceStore::~PlaceStore() {
  // It reads into the chunks.
  background_.request_stop();
  if (background_.joinable()) background_.join();
  for (std::size_t i = 0; i < kMostChunks; ++i) {
    const Chunk* chunk = chunks_[i].load(std::memory_order_relaxed);
    if (chunk == nullptr) break;
    delete chunk;  // NOLINT(cppcoreguidelines-owning-memory): owned by this directory
  }
}

PlaceStore::Chunk& PlaceStore::append_chunk(std::size_t at, const std::uint8_t* in_file) {
  std::unique_ptr<Chunk> fresh(new Chunk{layout_, {}, in_file});
  if (in_file == nullptr) {
    fresh->owned.assign(layout_.begin[ChunkLayout::kParts], 0);
    fresh->data = fresh->owned.data();
  }
  Chunk* const chunk = fresh.release();
  chunks_[at].store(chunk, std::memory_order_release);
  return *chunk;
}

void PlaceStore::add(FrameId frame, double stamp_s, const IntensityScanContext& descriptor) {
  const std::size_t i = size_.load(std::memory_order_relaxed);
  if (i > 0 && frame <= this->frame(i - 1))
    throw std::invalid_argument("frame " + std::to_string(frame.value) + " after frame " +
                                std::to_string(this->frame(i - 1).value) + ": frames must increase");
  if (i > 0 && (descriptor.rings != rings_ || descriptor.sectors != sectors_ || descriptor.levels != levels_))
    throw std::invalid_argument("descriptors of one index must have one grid");
  if (i / kChunk >= kMostChunks) throw std::length_error("an index holds up to 268 million places");
  if (i == 0) {
    rings_ = descriptor.rings;
    sectors_ = descriptor.sectors;
    levels_ = descriptor.levels;
    layout_ = {rings_, sectors_, levels_};
  }
  Chunk& chunk =
      i % kChunk == 0 ? append_chunk(i / kChunk, nullptr) : *chunks_[i / kChunk].load(std::memory_order_relaxed);
  const double latest = i > 0 ? std::max(stamp_s, latest_s(i - 1)) : stamp_s;
  const std::size_t at = i % kChunk;
  std::uint8_t* const data = chunk.owned.data();
  const auto put = [&](const void* array, std::size_t index, const auto& value) {
    const auto offset = static_cast<std::size_t>(static_cast<const std::uint8_t*>(array) - chunk.data);
    std::memcpy(data + offset + index * sizeof value, &value, sizeof value);
  };
  auto* const place =
      reinterpret_cast<revisit_bits_place*>(data + layout_.begin[ChunkLayout::kImages] + at * layout_.place);
  std::uint8_t columns[REVISIT_BITS_COLUMNS];
  revisit_bits_make_place(descriptor.occupancy.data(), rows(), static_cast<std::uint32_t>(sectors_), place, columns);
  for (std::size_t column = 0; column < REVISIT_BITS_COLUMNS; ++column)
    data[(at / REVISIT_BITS_BLOCK * REVISIT_BITS_COLUMNS + column) * REVISIT_BITS_BLOCK + at % REVISIT_BITS_BLOCK] =
        columns[column];
  put(chunk.occupied(), at, place->occupied);
  put(chunk.frames(), at, frame.value);
  put(chunk.latest_s(), at, latest);
  std::memcpy(data + layout_.begin[ChunkLayout::kIntensities] + at * layout_.cells, descriptor.intensity.data(),
              layout_.cells);
  size_.store(i + 1, std::memory_order_release);
}

std::optional<DescriptorView> PlaceStore::descriptor(std::size_t i) const {
  const revisit_bits_place* const found = place(i);
  const Chunk& c = chunk(i);
  if (found == nullptr || !is_intact(c, ChunkLayout::kIntensities + i % kChunk / ChunkLayout::kGroup))
    return std::nullopt;
  return DescriptorView(rings_, sectors_, levels_, c.part(ChunkLayout::kIntensities) + i % kChunk * layout_.cells,
                        image_of(found));
}

void PlaceStore::half_bounds(const revisit_bits_query& query, std::size_t begin, std::size_t end, std::uint8_t* bounds,
                             std::uint8_t* least) const {
  const Chunk& c = chunk(begin);
  const std::uint8_t* coarse = c.coarse() + begin % kChunk * REVISIT_BITS_COLUMNS;
  const std::uint32_t* occupied = c.occupied() + begin % kChunk;
  const std::size_t whole = (end - begin) / REVISIT_BITS_BLOCK, rest = (end - begin) % REVISIT_BITS_BLOCK;
  revisit_bits_half_bounds(&query, coarse, occupied, whole, bounds, least);
  if (rest == 0) return;
  // The last block may be written to at this moment, beyond the places that are wanted: those alone are read. The
  // others are full: no bound is lower for them.
  coarse += whole * REVISIT_BITS_COLUMNS * REVISIT_BITS_BLOCK;
  alignas(64) std::uint8_t coarse_copy[REVISIT_BITS_COLUMNS * REVISIT_BITS_BLOCK] = {};
  std::uint32_t occupied_copy[REVISIT_BITS_BLOCK];
  std::fill(std::begin(occupied_copy), std::end(occupied_copy), query.occupied + 510);
  for (std::size_t column = 0; column < REVISIT_BITS_COLUMNS; ++column)
    std::memcpy(coarse_copy + column * REVISIT_BITS_BLOCK, coarse + column * REVISIT_BITS_BLOCK, rest);
  std::copy_n(occupied + whole * REVISIT_BITS_BLOCK, rest, occupied_copy);
  revisit_bits_half_bounds(&query, coarse_copy, occupied_copy, 1, bounds + whole * REVISIT_BITS_BLOCK, least + whole);
}

}  // namespace revisit::retrieval_internal
