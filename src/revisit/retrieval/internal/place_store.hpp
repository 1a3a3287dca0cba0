// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <thread>

#include <revisit/bits/occupancy_bits.h>
#include <revisit/core/ids.hpp>
#include <revisit/core/result.hpp>
#include <revisit/descriptors/intensity_scan_context.hpp>
#include <revisit/retrieval/internal/aligned_vector.hpp>
#include <revisit/retrieval/internal/mapped_file.hpp>

namespace revisit::retrieval_internal {

/// How a chunk of 4,096 places lies in memory, and in a file the same (docs/retrieval.md): the bounds of all, then
/// images and intensities in groups of 256 places. Each of these parts is checked by itself, and starts on a page.
struct ChunkLayout {
  static constexpr std::size_t kPlaces = 4096, kGroup = 256, kGroups = kPlaces / kGroup;
  static constexpr std::size_t kBounds = 0, kImages = 1, kIntensities = kImages + kGroups,
                               kParts = kIntensities + kGroups;

  ChunkLayout() = default;
  ChunkLayout(int rings, int sectors, int levels);

  std::size_t cells = 0;
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
  /// Maps a saved file. Header, size and bounds are checked now, images and intensities before they are first used.
  static Result<std::unique_ptr<PlaceStore>> open(const std::string& path);
  using Write = std::function<Status(std::size_t offset, std::span<const std::byte> bytes)>;
  using Read = std::function<Status(std::size_t offset, std::span<std::byte> to)>;
  /// The same file in pieces, which lie anywhere: each is asked for as it was written, by one thread at a time, what is
  /// used first at first, the rest in the background; then `read` is destroyed. `name` is for errors.
  Status save(const Write& write) const;
  static Result<std::unique_ptr<PlaceStore>> open(const std::string& name, std::size_t size, Read read);
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
  /// The place and those that follow it in its group, `place_bytes()` apart; null where the file was altered.
  const revisit_bits_place* place(std::size_t i) const {
    const Chunk& c = chunk(i);
    if (!is_intact(c, ChunkLayout::kImages + i % kChunk / ChunkLayout::kGroup)) return nullptr;
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
    AlignedVector<std::uint8_t> owned;  ///< empty where the chunk lies in a mapped file
    const std::uint8_t* data;
    std::size_t offset = 0;  ///< in the file
    std::uint64_t checksums[ChunkLayout::kParts] = {};
    enum State : std::uint8_t { kIntact, kUnchecked, kDamaged };
    mutable std::atomic<std::uint8_t> state[ChunkLayout::kParts] = {};

    const std::uint8_t* part(std::size_t p) const { return data + layout.begin[p]; }
    std::size_t size(std::size_t p) const { return layout.begin[p + 1] - layout.begin[p]; }
    const std::uint8_t* coarse() const { return data; }  ///< [block of 64][column][place]
    const std::uint32_t* occupied() const {
      return reinterpret_cast<const std::uint32_t*>(data + kChunk * REVISIT_BITS_COLUMNS);
    }
    const std::int64_t* frames() const { return reinterpret_cast<const std::int64_t*>(occupied() + kChunk); }
    const double* latest_s() const { return reinterpret_cast<const double*>(frames() + kChunk); }
  };
  const Chunk& chunk(std::size_t i) const { return *chunks_[i / kChunk].load(std::memory_order_acquire); }
  bool is_intact(const Chunk& c, std::size_t p) const {
    return c.state[p].load(std::memory_order_acquire) == Chunk::kIntact || check(c, p);
  }
  bool check(const Chunk& c, std::size_t p) const;
  std::uint64_t checksum(const Chunk& c, std::size_t p) const;
  std::size_t saved_bytes() const;
  static Result<std::unique_ptr<PlaceStore>> open(const std::string& path, std::size_t size, MappedFile mapped,
                                                  Read read);
  Chunk& append_chunk(std::size_t at, const std::uint8_t* in_file);

  std::unique_ptr<std::atomic<Chunk*>[]> chunks_;
  std::atomic<std::size_t> size_ = 0;
  int rings_ = 0, sectors_ = 0, levels_ = 0;  // set before the first place is published
  ChunkLayout layout_;
  std::string path_;
  MappedFile file_;  ///< either this is where the store was opened,
  bool is_mapped_ = true;
  mutable std::mutex reading_;
  Read read_;  ///< or this
  std::condition_variable_any stopped_;
  std::jthread background_;  ///< reads the rest; ends before what it reads
};

}  // namespace revisit::retrieval_internal
