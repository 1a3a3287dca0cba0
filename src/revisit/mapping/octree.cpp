// SPDX-License-Identifier: Apache-2.0
#include <revisit/mapping/internal/octree.hpp>

#include <algorithm>
#include <bit>
#include <cmath>

namespace revisit::mapping_internal {
namespace {

// Every third bit of 21.
std::uint64_t spread(std::uint64_t value) {
  value = (value | value << 32) & 0x001F00000000FFFF;
  value = (value | value << 16) & 0x001F0000FF0000FF;
  value = (value | value << 8) & 0x100F00F00F00F00F;
  value = (value | value << 4) & 0x10C30C30C30C30C3;
  return (value | value << 2) & 0x1249249249249249;
}

std::uint32_t gather(std::uint64_t key) {
  key &= 0x1249249249249249;
  key = (key | key >> 2) & 0x10C30C30C30C30C3;
  key = (key | key >> 4) & 0x100F00F00F00F00F;
  key = (key | key >> 8) & 0x001F0000FF0000FF;
  key = (key | key >> 16) & 0x001F00000000FFFF;
  return static_cast<std::uint32_t>((key | key >> 32) & 0x1FFFFF);
}

struct Sorted {
  std::uint64_t key;
  std::uint32_t point;
  std::int32_t bits;  // of the node that holds it
};

OctreeNode node_at(std::uint64_t key, int bits) {
  return {bits, gather(key) >> bits, gather(key >> 1) >> bits, gather(key >> 2) >> bits};
}

class Splitter {
 public:
  using Take = std::function<void(const OctreeNode&, std::span<const MapPoint>)>;
  Splitter(std::span<const MapPoint> points, const Take& take) : points_(points), take_(take) {}

  // `range` lies in one node of so many bits, and holds no point of a larger one.
  void split(std::span<const Sorted> range, int bits) {
    const bool takes_all = range.size() <= Octree::kFew || bits == Octree::kLeafBits;
    own_.clear();
    std::vector<Sorted> rest;
    for (const Sorted& each : range) {
      if (takes_all || each.bits == bits)
        own_.push_back(points_[each.point]);
      else
        rest.push_back(each);
    }
    if (!own_.empty()) take_(node_at(range.front().key, bits), own_);
    split_each(rest, bits - 1);
  }

  void split_each(std::span<const Sorted> range, int bits) {
    while (!range.empty()) {
      const std::uint64_t node = range.front().key >> (3 * bits);
      const auto end =
          std::find_if(range.begin(), range.end(), [&](const Sorted& each) { return each.key >> (3 * bits) != node; });
      const auto count = static_cast<std::size_t>(end - range.begin());
      split(range.first(count), bits);
      range = range.subspan(count);
    }
  }

 private:
  std::span<const MapPoint> points_;
  const Take& take_;
  std::vector<MapPoint> own_;
};

}  // namespace

std::uint64_t Octree::key(const MapPoint& point, std::uint32_t square_x, std::uint32_t square_y) const {
  const auto cell = [&](float value, Eigen::Index axis, std::uint64_t first, std::uint64_t last) {
    const double index = std::floor((static_cast<double>(value) - low[axis]) / cell_m);
    return spread(static_cast<std::uint64_t>(std::clamp(index, static_cast<double>(first), static_cast<double>(last))));
  };
  const std::uint64_t side = std::uint64_t{1} << square_bits, x = square_x * side, y = square_y * side;
  return cell(point.x, 0, x, x + side - 1) | cell(point.y, 1, y, y + side - 1) << 1 |
         cell(point.z, 2, 0, (std::uint64_t{1} << root_bits) - 1) << 2;
}

void split_square(const Octree& octree, std::uint32_t square_x, std::uint32_t square_y,
                  std::span<const MapPoint> square,
                  const std::function<void(const OctreeNode&, std::span<const MapPoint>)>& take) {
  std::vector<Sorted> sorted(square.size());
  for (std::size_t i = 0; i < square.size(); ++i)
    sorted[i] = {octree.key(square[i], square_x, square_y), static_cast<std::uint32_t>(i), 0};
  std::sort(sorted.begin(), sorted.end(),
            [](const Sorted& a, const Sorted& b) { return a.key != b.key ? a.key < b.key : a.point < b.point; });
  std::vector<Sorted> within;
  within.reserve(sorted.size());
  for (std::size_t i = 0; i < sorted.size(); ++i) {
    // The first in its voxels of up to 2^h cells, where h is the highest bit of a cell's number in which it differs
    // from the point before.
    const std::uint64_t differs = i == 0 ? ~std::uint64_t{0} : sorted[i].key ^ sorted[i - 1].key;
    const int h = differs == 0 ? 0 : std::min((63 - std::countl_zero(differs)) / 3, octree.square_bits);
    sorted[i].bits = std::min(Octree::kLeafBits + h, octree.root_bits);
    if (sorted[i].bits > octree.square_bits)
      take(node_at(sorted[i].key, sorted[i].bits), square.subspan(sorted[i].point, 1));
    else
      within.push_back(sorted[i]);
  }
  Splitter(square, take).split_each(within, octree.square_bits);
}

std::uint64_t morton_of_square(std::uint32_t x, std::uint32_t y) { return spread(x) | spread(y) << 1; }

}  // namespace revisit::mapping_internal
