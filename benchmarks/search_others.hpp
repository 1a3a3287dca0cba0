// SPDX-License-Identifier: Apache-2.0
// What our search is measured against, on the same descriptors.
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <memory>
#include <vector>

#include <faiss/IndexBinaryFlat.h>
#include <omp.h>
#include <nanoflann.hpp>

#include <revisit/retrieval/internal/place_store.hpp>

namespace revisit::bench {

/// One byte a cell, a row a ring, as the published program of Intensity Scan Context keeps its binary images.
struct ByteImage {
  int rings, sectors;
  std::vector<std::uint8_t> cells;  ///< [ring * sectors + sector]

  explicit ByteImage(const IntensityScanContext& context)
      : rings(context.rings), sectors(context.sectors), cells(context.cells()) {
    for (int ring = 0; ring < rings; ++ring)
      for (int sector = 0; sector < sectors; ++sector)
        cells[static_cast<std::size_t>(ring) * static_cast<std::size_t>(sectors) + static_cast<std::size_t>(sector)] =
            context.occupied(ring, sector);
  }
  std::uint8_t at(int ring, int sector) const {
    return cells[static_cast<std::size_t>(ring) * static_cast<std::size_t>(sectors) + static_cast<std::size_t>(sector)];
  }
};

/// Its pair test, as described: for every shift, column by column and cell by cell, equal cells are counted.
inline int byte_pair(const ByteImage& query, const ByteImage& place) {
  int best = 0;
  for (int shift = 0; shift < query.sectors; ++shift) {
    int equal = 0;
    for (int sector = 0; sector < query.sectors; ++sector) {
      const int other = sector + shift < query.sectors ? sector + shift : sector + shift - query.sectors;
      for (int ring = 0; ring < query.rings; ++ring)
        if ((query.at(ring, sector) != 0) == (place.at(ring, other) != 0)) ++equal;
    }
    best = std::max(best, equal);
  }
  return best;
}

/// Scan Context's search: the occupied share of each ring is a key, a k-d tree gives the places of the nearest keys,
/// and those alone are compared in full (with our packed comparison).
class RingKeyTree {
 public:
  static constexpr bool kIsExact = false;
  RingKeyTree(const retrieval_internal::PlaceStore& store, std::size_t count) : store_(store) {
    const auto rings = static_cast<std::size_t>(store.rings());
    keys_.rings = rings;
    keys_.values.resize(count * rings);
    for (std::size_t i = 0; i < count; ++i)
      key_of(retrieval_internal::PlaceStore::image_of(store.place(i)), keys_.values.data() + i * rings);
    tree_ = std::make_unique<Tree>(store.rings(), keys_, nanoflann::KDTreeSingleIndexAdaptorParams(10));
    memory_.resize(revisit_bits_query_bytes(static_cast<std::uint32_t>(store.rings()),
                                            static_cast<std::uint32_t>(store.sectors())));
  }

  /// The distance to the nearest of the `candidates` places of nearest keys.
  std::uint32_t nearest(const IntensityScanContext& query, std::size_t candidates) {
    std::vector<float> key(keys_.rings);
    key_of(query.occupancy.data(), key.data());
    std::vector<std::uint32_t> found(candidates);
    std::vector<float> squared(candidates);
    const std::size_t count = tree_->knnSearch(key.data(), candidates, found.data(), squared.data());
    revisit_bits_query prepared;
    revisit_bits_prepare(query.occupancy.data(), static_cast<std::uint32_t>(query.rings),
                         static_cast<std::uint32_t>(query.sectors), memory_.data(), &prepared);
    std::uint32_t best = UINT32_MAX, distances[64], shifts[64];
    for (std::size_t i = 0; i < count; ++i)
      if (revisit_bits_compare(&prepared, store_.place(found[i]), store_.place_bytes(), 1, best, distances, shifts) !=
          0)
        best = distances[0];
    return best;
  }

 private:
  void key_of(const std::uint64_t* image, float* key) const {
    const auto rings = static_cast<std::size_t>(store_.rings()), sectors = static_cast<std::size_t>(store_.sectors());
    std::fill_n(key, rings, 0.f);
    for (std::size_t sector = 0; sector < sectors; ++sector)
      for (std::size_t ring = 0; ring < rings; ++ring) {
        const std::size_t bit = sector * rings + ring;
        if ((image[bit / 64] >> (bit % 64) & 1) != 0) key[ring] += 1.f / static_cast<float>(sectors);
      }
  }
  struct Keys {
    std::size_t rings = 0;
    std::vector<float> values;
    std::size_t kdtree_get_point_count() const { return values.size() / rings; }
    float kdtree_get_pt(std::size_t i, std::size_t ring) const { return values[i * rings + ring]; }
    template <typename Box>
    bool kdtree_get_bbox(Box&) const {
      return false;
    }
  };
  using Tree = nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<float, Keys>, Keys>;

  const retrieval_internal::PlaceStore& store_;
  Keys keys_;
  std::unique_ptr<Tree> tree_;
  retrieval_internal::AlignedVector<std::uint8_t> memory_;
};

/// FAISS, which knows no shifts: every turn of the query is a query of its own.
class FaissOfAllShifts {
 public:
  static constexpr bool kIsExact = true;
  FaissOfAllShifts(const retrieval_internal::PlaceStore& store, std::size_t count)
      : bytes_(static_cast<std::size_t>(store.rings()) * static_cast<std::size_t>(store.sectors()) / 8),
        index_(static_cast<faiss::IndexBinary::idx_t>(bytes_ * 8)) {
    omp_set_num_threads(1);
    std::vector<std::uint8_t> images(count * bytes_);
    for (std::size_t i = 0; i < count; ++i)
      std::memcpy(images.data() + i * bytes_, retrieval_internal::PlaceStore::image_of(store.place(i)), bytes_);
    index_.add(static_cast<faiss::IndexBinary::idx_t>(count), images.data());
    memory_.resize(revisit_bits_query_bytes(static_cast<std::uint32_t>(store.rings()),
                                            static_cast<std::uint32_t>(store.sectors())));
  }

  std::uint32_t nearest(const IntensityScanContext& query, std::size_t k) {
    const auto sectors = static_cast<std::size_t>(query.sectors);
    revisit_bits_query prepared;
    revisit_bits_prepare(query.occupancy.data(), static_cast<std::uint32_t>(query.rings),
                         static_cast<std::uint32_t>(query.sectors), memory_.data(), &prepared);
    std::vector<std::uint8_t> turns(sectors * bytes_);
    const std::size_t stride = (query.occupancy.size() + 7) / 8 * 8;
    for (std::size_t turn = 0; turn < sectors; ++turn)
      std::memcpy(turns.data() + turn * bytes_, prepared.images + turn * stride, bytes_);
    std::vector<std::int32_t> distances(sectors * k);
    std::vector<faiss::IndexBinary::idx_t> places(sectors * k);
    index_.search(static_cast<faiss::IndexBinary::idx_t>(sectors), turns.data(),
                  static_cast<faiss::IndexBinary::idx_t>(k), distances.data(), places.data());
    return static_cast<std::uint32_t>(*std::min_element(distances.begin(), distances.end()));
  }

 private:
  std::size_t bytes_;
  faiss::IndexBinaryFlat index_;
  retrieval_internal::AlignedVector<std::uint8_t> memory_;
};

}  // namespace revisit::bench
