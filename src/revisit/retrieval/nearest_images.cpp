// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <cstring>

#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/task_arena.h>

#include <revisit/retrieval/internal/nearest_images.hpp>

namespace revisit::retrieval_internal {
namespace {

constexpr std::size_t kBlock = REVISIT_BITS_BLOCK;

constexpr std::uint32_t kStep = 8;
constexpr std::size_t kIntact = SIZE_MAX;
// Fewer places than this for each thread are not worth waking it up.
constexpr std::size_t kPlacesPerThread = 8192;

// What all parts of a search share.
struct Query {
  const PlaceStore& store;
  const revisit_bits_query& prepared;
  std::size_t wanted;
  std::atomic<std::uint32_t> limit;            ///< some thread knows enough places that are nearer
  std::atomic<std::size_t> damaged = kIntact;  ///< a place whose image was refused
};

// Brings the shared limit down to `limit`.
void lower(std::atomic<std::uint32_t>& shared, std::uint32_t limit) {
  std::uint32_t known = shared.load(std::memory_order_relaxed);
  while (limit < known && !shared.compare_exchange_weak(known, limit, std::memory_order_relaxed)) {
  }
}

// Reused from search to search by each thread.
struct Scratch {
  AlignedVector<std::uint8_t> half_bounds, least;  ///< of places, of blocks
  std::vector<std::uint32_t> upper_bounds;
};

// The places [first, end) of a query, from the block that `first` lies in on.
class Part {
 public:
  Part(Query& query, std::size_t first, std::size_t end, std::vector<NearImage>& heap)
      : query_(query),
        begin_(first / kBlock * kBlock),
        first_(first),
        end_(end),
        blocks_((end - begin_ + kBlock - 1) / kBlock),
        heap_(heap) {}

  // Returns how many places were compared.
  std::size_t search() {
    find_bounds();
    const std::uint32_t near = promising_half_bound();
    limit_by_promising_turns(near);
    for (std::uint32_t low = 0, high = near; low <= 255; low = high + 1, high = std::min(low + kStep - 1, 255u))
      if (!compare(low, high)) break;
    return compared_;
  }

 private:
  void find_bounds() {
    thread_local Scratch scratch;
    scratch_ = &scratch;
    scratch.half_bounds.resize(std::max(scratch.half_bounds.size(), blocks_ * kBlock));
    scratch.least.resize(std::max(scratch.least.size(), blocks_));
    for (std::size_t at = begin_; at < end_;) {
      const std::size_t stop = std::min(end_, (at / PlaceStore::kChunk + 1) * PlaceStore::kChunk);
      query_.store.half_bounds(query_.prepared, at, stop, scratch.half_bounds.data() + (at - begin_),
                               scratch.least.data() + (at - begin_) / kBlock);
      at = stop;
    }
  }

  // The more places there are, the more are worth a look beforehand.
  std::size_t promising_blocks() const { return std::min(blocks_, query_.wanted + 8 + blocks_ / 64); }

  // So many blocks have a half bound up to this that the places wanted are likely among theirs.
  std::uint32_t promising_half_bound() const {
    std::array<std::uint32_t, 256> histogram{};
    for (std::size_t block = 0; block < blocks_; ++block) ++histogram[scratch_->least[block]];
    const std::size_t promising = promising_blocks();
    std::uint32_t near = 0;
    for (std::size_t sum = 0; near < 255 && (sum += histogram[near]) < promising;) ++near;
    return near;
  }

  // Calls visit(first place of the block, which of its places) for half bounds in [low, high] that the limit allows.
  template <typename Visit>
  void for_each_block(std::uint32_t low, std::uint32_t high, Visit visit) {
    for (std::size_t block = 0; block < blocks_; ++block) {
      // 2 h < limit, as far as there is one
      const std::uint32_t limit = query_.limit.load(std::memory_order_relaxed);
      const std::uint32_t below = std::min(high + 1, limit / 2 + limit % 2);
      if (scratch_->least[block] >= below || below <= low) continue;
      std::uint64_t which = revisit_bits_between(scratch_->half_bounds.data() + block * kBlock,
                                                 static_cast<std::uint8_t>(low), static_cast<std::uint8_t>(below - 1));
      const std::size_t here = end_ - begin_ - block * kBlock;
      if (here < kBlock) which &= (std::uint64_t{1} << here) - 1;
      if (block == 0) which &= ~std::uint64_t{0} << (first_ - begin_);
      if (which != 0) visit(begin_ + block * kBlock, which);
    }
  }

  // Each promising place is at most as far as at its most promising turn: the K-th of these distances is a limit.
  void limit_by_promising_turns(std::uint32_t near) {
    std::vector<std::uint32_t>& upper = scratch_->upper_bounds;
    upper.clear();
    for_each_block(0, near, [&](std::size_t first, std::uint64_t which) {
      for (; which != 0 && upper.size() < 2 * promising_blocks(); which &= which - 1) {
        const revisit_bits_place* const place =
            query_.store.place(first + static_cast<std::size_t>(std::countr_zero(which)));
        if (place != nullptr) upper.push_back(revisit_bits_hamming_at_promising_turn(&query_.prepared, place));
      }
    });
    if (upper.size() < query_.wanted) return;
    const auto last = upper.begin() + static_cast<std::ptrdiff_t>(query_.wanted) - 1;
    std::nth_element(upper.begin(), last, upper.end());
    lower(query_.limit, *last + 1);
  }

  bool compare(std::uint32_t low, std::uint32_t high) {
    if (2 * low >= query_.limit.load(std::memory_order_relaxed)) return false;
    for_each_block(low, high, [&](std::size_t first, std::uint64_t which) {
      const revisit_bits_place* const places = query_.store.place(first);
      if (places == nullptr) {
        query_.damaged.store(first, std::memory_order_relaxed);
        return;
      }
      compared_ += static_cast<std::size_t>(std::popcount(which));
      std::uint32_t distances[kBlock], shifts[kBlock];
      std::uint64_t found = revisit_bits_compare(&query_.prepared, places, query_.store.place_bytes(), which,
                                                 query_.limit.load(std::memory_order_relaxed), distances, shifts);
      for (; found != 0; found &= found - 1) {
        const auto i = static_cast<std::size_t>(std::countr_zero(found));
        keep({distances[i], shifts[i], first + i});
      }
    });
    return true;
  }

  // The heap holds the best so far, the worst of them on top.
  void keep(const NearImage& place) {
    if (heap_.size() == query_.wanted) {
      if (!(place < heap_.front())) return;
      std::pop_heap(heap_.begin(), heap_.end());
      heap_.pop_back();
    }
    heap_.push_back(place);
    std::push_heap(heap_.begin(), heap_.end());
    // Equal distances may still win by age: the limit is one more than the worst.
    if (heap_.size() == query_.wanted) lower(query_.limit, heap_.front().distance + 1);
  }

  Query& query_;
  std::size_t begin_, first_, end_, blocks_, compared_ = 0;
  std::vector<NearImage>& heap_;
  Scratch* scratch_ = nullptr;
};

}  // namespace

Result<std::vector<NearImage>> nearest_images(const PlaceStore& store, PlaceRange places, const std::uint64_t* query,
                                              std::size_t count, std::uint32_t farthest, int threads,
                                              SearchCounts* counts) {
  const std::size_t size = places.size();
  if (counts != nullptr) *counts = {size, 0};
  std::vector<NearImage> result;
  if (size == 0 || count == 0) return result;
  const std::uint32_t rings = store.rows();
  const auto sectors = static_cast<std::uint32_t>(store.sectors());
  thread_local AlignedVector<std::uint8_t> memory;
  memory.resize(std::max(memory.size(), revisit_bits_query_bytes(rings, sectors)));
  revisit_bits_query prepared;
  revisit_bits_prepare(query, rings, sectors, memory.data(), &prepared);
  Query shared{store, prepared, std::min(count, size), farthest == UINT32_MAX ? farthest : farthest + 1};

  const std::size_t parts =
      std::clamp<std::size_t>(size / kPlacesPerThread, 1, static_cast<std::size_t>(std::max(1, threads)));
  std::size_t compared = 0;
  if (parts == 1) {
    compared = Part(shared, places.first, places.last, result).search();
  } else {
    const std::size_t part_size = (size / parts / kBlock + 1) * kBlock;
    std::vector<std::vector<NearImage>> found(parts);
    std::atomic<std::size_t> sum = 0;
    tbb::task_arena arena(std::min(threads, tbb::this_task_arena::max_concurrency()));
    arena.execute([&] {
      tbb::parallel_for(std::size_t{0}, parts, [&](std::size_t part) {
        const std::size_t begin = std::min(places.last, places.first + part * part_size),
                          end = std::min(places.last, begin + part_size);
        if (begin < end) sum += Part(shared, begin, end, found[part]).search();
      });
    });
    for (const auto& each : found) result.insert(result.end(), each.begin(), each.end());
    compared = sum;
  }
  if (shared.damaged != kIntact) return store.damage(shared.damaged);
  if (counts != nullptr) counts->compared = compared;
  std::sort(result.begin(), result.end());
  result.resize(std::min(result.size(), count));
  return result;
}

}  // namespace revisit::retrieval_internal
