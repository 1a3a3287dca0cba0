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

// What all parts of a search share. `limit`: some thread knows enough places that are nearer.
struct Query {
  const PlaceStore& store;
  const AlignedVector<std::uint64_t>& turned;
  const AlignedVector<std::uint8_t>& turned_columns;
  std::size_t wanted;
  std::atomic<std::uint32_t> limit;
};

// The best so far, the worst of them on top.
class Best {
 public:
  Best(Query& query, std::vector<NearImage>& heap) : query_(query), heap_(heap) { heap_.clear(); }

  std::uint32_t limit() const { return query_.limit.load(std::memory_order_relaxed); }

  void compare(std::size_t place) {
    NearImage found;
    found.place = place;
    found.distance = revisit_bits_min_hamming_turned(
        query_.turned.data(), query_.store.image(place), static_cast<std::uint32_t>(query_.store.rings()),
        static_cast<std::uint32_t>(query_.store.sectors()), limit(), &found.shift);
    ++compared_;
    if (found.distance == UINT32_MAX) return;
    if (heap_.size() == query_.wanted) {
      if (!(found < heap_.front())) return;
      std::pop_heap(heap_.begin(), heap_.end());
      heap_.pop_back();
    }
    heap_.push_back(found);
    std::push_heap(heap_.begin(), heap_.end());
    if (heap_.size() < query_.wanted) return;
    // Equal distances may still win by age: the limit is one more than the worst.
    const std::uint32_t worst = heap_.front().distance + 1;
    std::uint32_t known = limit();
    while (worst < known && !query_.limit.compare_exchange_weak(known, worst, std::memory_order_relaxed)) {
    }
  }
  std::size_t compared() const { return compared_; }

 private:
  Query& query_;
  std::vector<NearImage>& heap_;
  std::size_t compared_ = 0;
};

// Which of 64 bounds lie in [low, high): one bit each.
std::uint64_t between(const std::uint8_t* bounds, std::uint32_t low, std::uint32_t high) {
  std::uint64_t mask = 0;
  for (std::size_t i = 0; i < kBlock; ++i)
    mask |= std::uint64_t{static_cast<std::uint32_t>(bounds[i]) - low < high - low} << i;
  return mask;
}

// The places [begin, end), `begin` a multiple of 64: first all bounds, then the most promising places, which bring the
// limit down, then whatever the limit leaves.
std::size_t search_part(Query& query, std::size_t begin, std::size_t end, AlignedVector<std::uint8_t>& bounds,
                        std::vector<NearImage>& heap) {
  bounds.resize(std::max(bounds.size(), (end - begin + kBlock - 1) / kBlock * kBlock));
  for (std::size_t at = begin; at < end;) {
    const std::size_t stop = std::min(end, (at / PlaceStore::kChunk + 1) * PlaceStore::kChunk);
    query.store.bounds(query.turned_columns.data(), at, stop, bounds.data() + (at - begin));
    at = stop;
  }
  std::array<std::uint32_t, 256> histogram{};
  for (std::size_t i = 0; i < end - begin; ++i) ++histogram[bounds[i]];
  const std::size_t promising = std::min(end - begin, 2 * query.wanted + 16);
  std::uint32_t near = 0;
  for (std::size_t sum = 0; near < 255 && (sum += histogram[near]) < promising;) ++near;

  Best best(query, heap);
  const auto visit = [&](std::uint32_t low, bool up_to_limit) {
    for (std::size_t block = 0; block < end - begin; block += kBlock) {
      const std::uint32_t high = up_to_limit ? std::min(best.limit(), 256u) : near + 1;
      if (high <= low) continue;
      std::uint64_t mask = between(bounds.data() + block, low, high);
      if (end - begin - block < kBlock) mask &= (std::uint64_t{1} << (end - begin - block)) - 1;
      for (; mask != 0; mask &= mask - 1) {
        const std::size_t i = block + static_cast<std::size_t>(std::countr_zero(mask));
        if (bounds[i] < best.limit()) best.compare(begin + i);
      }
    }
  };
  visit(0, false);
  visit(near + 1, true);
  return best.compared();
}

}  // namespace

std::vector<NearImage> nearest_images(const PlaceStore& store, std::size_t places, const std::uint64_t* query,
                                      std::size_t count, std::uint32_t farthest, int threads, SearchCounts* counts) {
  if (counts != nullptr) *counts = {places, 0};
  if (places == 0 || count == 0) return {};
  const auto rings = static_cast<std::uint32_t>(store.rings()), sectors = static_cast<std::uint32_t>(store.sectors());
  thread_local AlignedVector<std::uint64_t> turned;
  turned.resize(revisit_bits_turned_words(rings, sectors));
  revisit_bits_turn(query, rings, sectors, turned.data());
  thread_local AlignedVector<std::uint8_t> turned_columns;
  turned_columns.resize(revisit_bits_turned_columns_bytes(sectors));
  revisit_bits_turn_columns(query, rings, sectors, turned_columns.data());
  Query shared{store, turned, turned_columns, std::min(count, places),
               farthest == UINT32_MAX ? farthest : farthest + 1};

  const auto parts = static_cast<std::size_t>(std::max(1, threads));
  const std::size_t part_size = ((places + parts - 1) / parts + kBlock - 1) / kBlock * kBlock;
  std::vector<NearImage> result;
  if (parts == 1) {
    thread_local AlignedVector<std::uint8_t> bounds;
    const std::size_t compared = search_part(shared, 0, places, bounds, result);
    if (counts != nullptr) counts->compared = compared;
  } else {
    std::vector<std::vector<NearImage>> found(parts);
    std::atomic<std::size_t> compared = 0;
    tbb::task_arena arena(std::min(threads, tbb::this_task_arena::max_concurrency()));
    arena.execute([&] {
      tbb::parallel_for(std::size_t{0}, parts, [&](std::size_t part) {
        thread_local AlignedVector<std::uint8_t> bounds;
        const std::size_t begin = std::min(places, part * part_size), end = std::min(places, begin + part_size);
        if (begin < end) compared += search_part(shared, begin, end, bounds, found[part]);
      });
    });
    for (const auto& each : found) result.insert(result.end(), each.begin(), each.end());
    if (counts != nullptr) counts->compared = compared;
  }
  std::sort(result.begin(), result.end());
  result.resize(std::min(result.size(), count));
  return result;
}

}  // namespace revisit::retrieval_internal
