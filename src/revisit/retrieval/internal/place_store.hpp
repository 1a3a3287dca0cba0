// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <revisit/bits/occupancy_bits.h>
#include <revisit/core/ids.hpp>
#include <revisit/core/result.hpp>
#include <revisit/descriptors/intensity_scan_context.hpp>
#include <revisit/retrieval/internal/aligned_vector.hpp>
#include <revisit/retrieval/internal/saved_bytes.hpp>

namespace revisit::retrieval_internal {

/// How a chunk of 4,096 places lies in memory, and in a file the same (docs/retrieval.md): three parts, each of
/// which starts on a page.
struct ChunkLayout {
  static constexpr std::size_t kPlaces = 4096;
  enum Part : std::uint8_t { kBounds, kImages, kIntensities, kParts };

  ChunkLayout() = default;
  ChunkLayout(int rings, int sectors, int levels);

  std::size_t cells = 0, words = 0;
  std::size_t place = 0;               ///< bytes of a revisit_bits_place
  std::size_t begin[kParts + 1] = {};  ///< bytes from the start of the chunk; the last is its size
};

/// Places in the order in which they were added. Grows by chunks that never move: one thread adds while others read
/// what was there when they read the size.
class PlaceStore {
 public:
  static constexpr std::size_t kChunk = ChunkLayout::kPlaces;
  static constexpr std::size_t kMostChunks = std::size_t{1} << 16;

  PlaceStore() : chunks_(std::make_unique<std::atomic<Chunk*>[]>(kMostChunks)) {}
  ~PlaceStore();
  PlaceStore(const PlaceStore&) = delete;
  PlaceStore& operator=(const PlaceStore&) = delete;

  /// Throws std::invalid_argument for a frame that does not increase or another grid than the first place's, and
  /// std::length_error beyond 268 million places.
  void add(FrameId frame, double stamp_s, const IntensityScanContext& descriptor);

  /// Writes all places; not while one is being added. The file is replaced only once the new one is complete.
  Status save(const std::string& path) const;
  /// Maps a saved file. Header, size and bounds are checked now, each chunk's images and intensities before they are
  /// first used.
  static Result<std::unique_ptr<PlaceStore>> open(const std::string& path);
  /// The same of what save() would write; `name` is for errors.
  static Result<std::unique_ptr<PlaceStore>> open(const std::string& name, SavedBytes bytes);
  Result<std::vector<std::byte>> to_bytes() const;
  /// Reads everything that has not been checked yet.
  Status check() const;

  std::size_t size() const { return size_.load(std::memory_order_acquire); }
  int rings() const { return rings_; }
  int sectors() const { return sectors_; }
  int levels() const { return levels_; }
  std::uint32_t rows() const { return static_cast<std::uint32_t>(rings_ * std::max(1, levels_)); }  ///< of an image

  // Of a place below size().
  FrameId frame(std::size_t i) const { return FrameId{chunk(i).frames()[i % kChunk]}; }
  /// The latest stamp until this place: it does not decrease, even where stamps do.
  double latest_s(std::size_t i) const { return chunk(i).latest_s()[i % kChunk]; }
  /// The place and those that follow it in its chunk, `place_bytes()` apart; null where the file was altered.
  const revisit_bits_place* place(std::size_t i) const {
    const Chunk& c = chunk(i);
    if (!is_intact(c, ChunkLayout::kImages)) return nullptr;
    return reinterpret_cast<const revisit_bits_place*>(c.part(ChunkLayout::kImages) + i % kChunk * layout_.place);
  }
  std::size_t place_bytes() const { return layout_.place; }
  static const std::uint64_t* image_of(const revisit_bits_place* place) {
    return reinterpret_cast<const std::uint64_t*>(place + 1);
  }
  std::optional<DescriptorView> descriptor(std::size_t i) const;
  /// What is wrong with the file that the place lies in, for a place whose data were refused.
  Error damage(std::size_t i) const;

  /// Half bounds (revisit_bits_half_bounds) of the places [begin, end), which lie in one chunk; `begin` is a multiple
  /// of 64. `bounds` has room for end - begin, filled up to a multiple of 64, `least` for one number a block.
  void half_bounds(const revisit_bits_query& query, std::size_t begin, std::size_t end, std::uint8_t* bounds,
                   std::uint8_t* least) const;

 private:
  struct Chunk {
    const ChunkLayout& layout;
    AlignedVector<std::uint8_t> owned;  ///< empty where the chunk lies in a file
    const std::uint8_t* data;
    std::uint64_t checksums[ChunkLayout::kParts] = {};
    enum State : std::uint8_t { kIntact, kUnchecked, kDamaged };
    mutable std::atomic<std::uint8_t> state[ChunkLayout::kParts] = {};

    const std::uint8_t* part(ChunkLayout::Part p) const { return data + layout.begin[p]; }
    const std::uint8_t* coarse() const { return data; }  ///< [block of 64][column][place]
    const std::uint32_t* occupied() const {
      return reinterpret_cast<const std::uint32_t*>(data + kChunk * REVISIT_BITS_COLUMNS);
    }
    const std::int64_t* frames() const { return reinterpret_cast<const std::int64_t*>(occupied() + kChunk); }
    const double* latest_s() const { return reinterpret_cast<const double*>(frames() + kChunk); }
  };
  const Chunk& chunk(std::size_t i) const { return *chunks_[i / kChunk].load(std::memory_order_acquire); }
  bool is_intact(const Chunk& c, ChunkLayout::Part p) const {
    return c.state[p].load(std::memory_order_acquire) == Chunk::kIntact || check(c, p);
  }
  bool check(const Chunk& c, ChunkLayout::Part p) const;
  std::uint64_t checksum(const Chunk& c, ChunkLayout::Part p) const;
  std::size_t saved_bytes() const;
  using Write = std::function<void(const void* data, std::size_t bytes)>;
  Status save(const Write& write) const;
  Chunk& append_chunk(std::size_t at, const std::uint8_t* in_file);

  std::unique_ptr<std::atomic<Chunk*>[]> chunks_;
  std::atomic<std::size_t> size_ = 0;
  int rings_ = 0, sectors_ = 0, levels_ = 0;  // set before the first place is published
  ChunkLayout layout_;
  std::string path_;
  SavedBytes file_;
};

}  // namespace revisit::retrieval_internal
