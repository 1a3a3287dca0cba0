// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cstring>
#include <stdexcept>
#include <string>

#include <revisit/retrieval/internal/place_store.hpp>

namespace revisit::retrieval_internal {

PlaceStore::~PlaceStore() {
  for (std::size_t i = 0; i < kMostChunks; ++i) {
    const Chunk* chunk = chunks_[i].load(std::memory_order_relaxed);
    if (chunk == nullptr) break;
    delete chunk;  // NOLINT(cppcoreguidelines-owning-memory): owned by this directory
  }
}

void PlaceStore::add(FrameId frame, double stamp_s, const IntensityScanContext& descriptor) {
  const std::size_t i = size_.load(std::memory_order_relaxed);
  if (i > 0 && frame <= this->frame(i - 1))
    throw std::invalid_argument("frame " + std::to_string(frame.value) + " after frame " +
                                std::to_string(this->frame(i - 1).value) + ": frames must increase");
  if (i > 0 && (descriptor.rings != rings_ || descriptor.sectors != sectors_))
    throw std::invalid_argument("descriptors of one index must have one grid");
  if (i / kChunk >= kMostChunks) throw std::length_error("an index holds up to 268 million places");
  if (i == 0) {
    rings_ = descriptor.rings;
    sectors_ = descriptor.sectors;
    words_ = descriptor.occupancy.size();
    cells_ = descriptor.cells();
  }
  if (i % kChunk == 0) {
    auto fresh = std::make_unique<Chunk>();
    fresh->counts.resize(kChunk * REVISIT_BITS_COLUMNS);
    fresh->images.resize(kChunk * words_);
    fresh->intensity.resize(kChunk * cells_);
    fresh->frames.resize(kChunk);
    fresh->latest_s.resize(kChunk);
    chunks_[i / kChunk].store(fresh.release(), std::memory_order_release);
  }
  Chunk& chunk = *chunks_[i / kChunk].load(std::memory_order_relaxed);
  const std::size_t at = i % kChunk;
  std::uint8_t counts[REVISIT_BITS_COLUMNS];
  revisit_bits_columns(descriptor.occupancy.data(), static_cast<std::uint32_t>(rings_),
                       static_cast<std::uint32_t>(sectors_), counts);
  for (std::size_t column = 0; column < REVISIT_BITS_COLUMNS; ++column)
    chunk.counts[(at / REVISIT_BITS_BLOCK * REVISIT_BITS_COLUMNS + column) * REVISIT_BITS_BLOCK +
                 at % REVISIT_BITS_BLOCK] = counts[column];
  std::copy(descriptor.occupancy.begin(), descriptor.occupancy.end(),
            chunk.images.begin() + static_cast<std::ptrdiff_t>(at * words_));
  std::copy(descriptor.intensity.begin(), descriptor.intensity.end(),
            chunk.intensity.begin() + static_cast<std::ptrdiff_t>(at * cells_));
  chunk.frames[at] = frame.value;
  chunk.latest_s[at] = i > 0 ? std::max(stamp_s, latest_s(i - 1)) : stamp_s;
  size_.store(i + 1, std::memory_order_release);
}

void PlaceStore::bounds(const std::uint8_t* turned_columns, std::size_t begin, std::size_t end,
                        std::uint8_t* bounds) const {
  const std::uint8_t* counts = chunk(begin).counts.data() + begin % kChunk * REVISIT_BITS_COLUMNS;
  const std::size_t whole = (end - begin) / REVISIT_BITS_BLOCK, rest = (end - begin) % REVISIT_BITS_BLOCK;
  revisit_bits_bounds(turned_columns, static_cast<std::uint32_t>(sectors_), counts, whole, bounds);
  if (rest == 0) return;
  // The last block may be written to at this moment, beyond the places that are asked for: those alone are read.
  counts += whole * REVISIT_BITS_COLUMNS * REVISIT_BITS_BLOCK;
  std::uint8_t block[REVISIT_BITS_COLUMNS * REVISIT_BITS_BLOCK] = {};
  for (std::size_t column = 0; column < REVISIT_BITS_COLUMNS; ++column)
    std::memcpy(block + column * REVISIT_BITS_BLOCK, counts + column * REVISIT_BITS_BLOCK, rest);
  revisit_bits_bounds(turned_columns, static_cast<std::uint32_t>(sectors_), block, 1,
                      bounds + whole * REVISIT_BITS_BLOCK);
}

}  // namespace revisit::retrieval_internal
