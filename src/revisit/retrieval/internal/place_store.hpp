// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <vector>

#include <revisit/bits/occupancy_bits.h>
#include <revisit/core/ids.hpp>
#include <revisit/descriptors/intensity_scan_context.hpp>
#include <revisit/retrieval/internal/aligned_vector.hpp>

namespace revisit::retrieval_internal {

/// Places in the order in which they were added, each kind of data in a row of its own (docs/retrieval.md). Grows by
/// chunks that never move: one thread adds while others read what was there when they asked for the size.
class PlaceStore {
 public:
  static constexpr std::size_t kChunk = 4096;  ///< places
  static constexpr std::size_t kMostChunks = std::size_t{1} << 16;

  PlaceStore() : chunks_(std::make_unique<std::atomic<Chunk*>[]>(kMostChunks)) {}
  ~PlaceStore();
  PlaceStore(const PlaceStore&) = delete;
  PlaceStore& operator=(const PlaceStore&) = delete;

  /// Throws std::invalid_argument for a frame that does not increase or another grid than the first place's, and
  /// std::length_error beyond 268 million places.
  void add(FrameId frame, double stamp_s, const IntensityScanContext& descriptor);

  std::size_t size() const { return size_.load(std::memory_order_acquire); }
  int rings() const { return rings_; }
  int sectors() const { return sectors_; }

  // Of a place below size().
  FrameId frame(std::size_t i) const { return FrameId{chunk(i).frames[i % kChunk]}; }
  /// The latest stamp until this place: it does not decrease, even where stamps do.
  double latest_s(std::size_t i) const { return chunk(i).latest_s[i % kChunk]; }
  const std::uint64_t* image(std::size_t i) const { return chunk(i).images.data() + i % kChunk * words_; }
  DescriptorView descriptor(std::size_t i) const {
    return {rings_, sectors_, chunk(i).intensity.data() + i % kChunk * cells_, image(i)};
  }

  /// Lower bounds of the distances of a query, given by the columns of its turns, to the places [begin, end), which lie
  /// in one chunk; `begin` is a multiple of 64. `bounds` has room for end - begin, filled up to a multiple of 64.
  void bounds(const std::uint8_t* turned_columns, std::size_t begin, std::size_t end, std::uint8_t* bounds) const;

 private:
  struct Chunk {
    AlignedVector<std::uint8_t> counts;   ///< [block of 64][column][place]
    std::vector<std::uint64_t> images;    ///< [place][word]
    std::vector<std::uint8_t> intensity;  ///< [place][cell]
    std::vector<std::int64_t> frames;
    std::vector<double> latest_s;
  };
  const Chunk& chunk(std::size_t i) const { return *chunks_[i / kChunk].load(std::memory_order_acquire); }

  std::unique_ptr<std::atomic<Chunk*>[]> chunks_;
  std::atomic<std::size_t> size_ = 0;
  int rings_ = 0, sectors_ = 0;  // set before the first place is published
  std::size_t words_ = 0, cells_ = 0;
};

}  // namespace revisit::retrieval_internal
