// SPDX-License-Identifier: Apache-2.0
#include <revisit/mapping/tileset_writer.hpp>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <optional>
#include <string>
#include <utility>

#include <tbb/parallel_for.h>

#include <revisit/core/text.hpp>
#include <revisit/mapping/internal/glb_file.hpp>
#include <revisit/mapping/internal/octree.hpp>

namespace revisit {
namespace {

namespace fs = std::filesystem;
using mapping_internal::Octree;
using mapping_internal::OctreeNode;
using mapping_internal::split_square;
using mapping_internal::write_glb;

constexpr double kLeastSquare_m = 50.0;

int square_bits(double voxel_m) {
  int bits = Octree::kLeafBits;
  while (voxel_m * static_cast<double>(1 << bits) < kLeastSquare_m && bits < Octree::kMostBits) ++bits;
  return bits;
}

Octree octree_of(const TilesetBounds& bounds) {
  Octree octree;
  octree.low = bounds.low;
  octree.cell_m = bounds.voxel_m;
  octree.square_bits = square_bits(bounds.voxel_m);
  octree.root_bits = octree.square_bits;
  const double extent_m = (bounds.high - bounds.low).maxCoeff();
  while (octree.edge_m(octree.root_bits) <= extent_m && octree.root_bits < Octree::kMostBits) ++octree.root_bits;
  return octree;
}

struct Box {
  Eigen::Vector3d low = Eigen::Vector3d::Constant(1e30), high = Eigen::Vector3d::Constant(-1e30);
  void add(const Box& other) {
    low = low.cwiseMin(other.low);
    high = high.cwiseMax(other.high);
  }
};

Box box_of(std::span<const MapPoint> points) {
  Box box;
  for (const MapPoint& p : points) {
    const Eigen::Vector3d q(p.x, p.y, p.z);
    box.low = box.low.cwiseMin(q);
    box.high = box.high.cwiseMax(q);
  }
  return box;
}

OctreeNode parent_of(const OctreeNode& node) { return {node.bits + 1, node.x >> 1, node.y >> 1, node.z >> 1}; }

std::string name_of(const OctreeNode& node, int root_bits) {
  return format("%d_%u_%u_%u.glb", root_bits - node.bits, node.x, node.y, node.z);
}

}  // namespace

class TilesetWriter::Implementation {
 public:
  Implementation(fs::path folder, const TilesetBounds& bounds)
      : folder_(std::move(folder)), octree_(octree_of(bounds)) {}

  Status add(std::span<const Square> squares) {
    std::vector<Split> parts(squares.size());
    tbb::parallel_for(std::size_t{0}, squares.size(), [&](std::size_t i) { parts[i] = split(squares[i]); });
    for (std::size_t i = 0; i < squares.size(); ++i) {
      if (!parts[i].status) return parts[i].status;
      if (const Status status = close_nodes_apart_from(squares[i].x, squares[i].y); !status) return status;
      tiles_.insert(parts[i].tiles.begin(), parts[i].tiles.end());
      for (const auto& [node, point] : parts[i].larger) open_[node].push_back(point);
      points_ += squares[i].points.size();
    }
    return ok();
  }

  Status finish() {
    for (const auto& [node, points] : open_)
      if (const Status status = write(node, points, tiles_); !status) return status;
    open_.clear();
    for (auto tile = tiles_.begin(); tile != tiles_.end(); ++tile) {  // smaller nodes come first
      if (tile->first.bits == octree_.root_bits) continue;
      Tile& parent = tiles_[parent_of(tile->first)];
      parent.box.add(tile->second.box);
      parent.children.push_back(tile->first);
    }
    const fs::path file = folder_ / "tileset.json";
    std::ofstream stream(file, std::ios::trunc);
    const OctreeNode root{octree_.root_bits, 0, 0, 0};
    stream << format(R"({"asset":{"version":"1.1","generator":"revisit","extras":{"points":%zu,"voxel_m":%g}},)"
                     R"("geometricError":%g,"root":)",
                     points_, octree_.cell_m, octree_.edge_m(octree_.root_bits));
    if (tiles_.empty())
      stream << R"({"boundingVolume":{"box":[0,0,0,1,0,0,0,1,0,0,0,1]},"geometricError":0,"refine":"ADD"})";
    else
      write_node(stream, root);
    stream << "}\n";
    stream.close();
    return stream ? ok() : Status(Error{file.string() + ": cannot be written: " + std::strerror(errno)});
  }

  std::size_t points() const { return points_; }

 private:
  struct Tile {
    Box box;  // of its points and its children's
    std::size_t points = 0;
    std::vector<OctreeNode> children;
  };
  using Tiles = std::map<OctreeNode, Tile>;
  struct Split {
    Status status = ok();
    Tiles tiles;
    std::vector<std::pair<OctreeNode, MapPoint>> larger;  // of nodes that other squares share
  };

  Split split(const Square& square) const {
    Split result;
    split_square(octree_, square.x, square.y, square.points,
                 [&](const OctreeNode& node, std::span<const MapPoint> points) {
                   if (node.bits > octree_.square_bits)
                     for (const MapPoint& point : points) result.larger.emplace_back(node, point);
                   else if (result.status)
                     result.status = write(node, points, result.tiles);
                 });
    return result;
  }

  Status write(const OctreeNode& node, std::span<const MapPoint> points, Tiles& tiles) const {
    tiles[node] = {box_of(points), points.size(), {}};
    return write_glb(folder_ / name_of(node, octree_.root_bits), points, octree_.corner(node),
                     octree_.edge_m(node.bits));
  }

  // In Morton order nothing more comes to a node once a square lies outside.
  Status close_nodes_apart_from(std::uint32_t x, std::uint32_t y) {
    for (auto each = open_.begin(); each != open_.end();) {
      const auto& [node, points] = *each;
      const int shift = node.bits - octree_.square_bits;
      if (x >> shift == node.x && y >> shift == node.y) {
        ++each;
        continue;
      }
      if (const Status status = write(node, points, tiles_); !status) return status;
      each = open_.erase(each);
    }
    return ok();
  }

  void write_node(std::ofstream& stream, const OctreeNode& node) const {
    const Tile& tile = tiles_.at(node);
    const Eigen::Vector3d middle = 0.5 * (tile.box.low + tile.box.high);
    // A cell to spare: positions are rounded.
    const Eigen::Vector3d half = (0.5 * (tile.box.high - tile.box.low)).array() + octree_.cell_m;
    const double spacing_m = tile.children.empty() ? 0.0 : octree_.edge_m(node.bits - Octree::kLeafBits);
    stream << format(R"({"boundingVolume":{"box":[%.3f,%.3f,%.3f,%.3f,0,0,0,%.3f,0,0,0,%.3f]},"geometricError":%g,)"
                     R"("refine":"ADD")",
                     middle.x(), middle.y(), middle.z(), half.x(), half.y(), half.z(), spacing_m);
    if (tile.points > 0) stream << R"(,"content":{"uri":")" << name_of(node, octree_.root_bits) << "\"}";
    for (std::size_t i = 0; i < tile.children.size(); ++i) {
      stream << (i == 0 ? ",\"children\":[\n" : ",\n");
      write_node(stream, tile.children[i]);
    }
    stream << (tile.children.empty() ? "}" : "]}");
  }

  fs::path folder_;
  Octree octree_;
  Tiles tiles_;
  std::map<OctreeNode, std::vector<MapPoint>> open_;
  std::size_t points_ = 0;
};

TilesetWriter::TilesetWriter(fs::path folder, const TilesetBounds& bounds)
    : implementation_(std::make_unique<Implementation>(std::move(folder), bounds)) {}
TilesetWriter::~TilesetWriter() = default;

double TilesetWriter::square_m(double voxel_m) { return voxel_m * static_cast<double>(1 << square_bits(voxel_m)); }
std::uint64_t TilesetWriter::order(std::uint32_t x, std::uint32_t y) {
  return mapping_internal::morton_of_square(x, y);
}
Status TilesetWriter::add(std::span<const Square> squares) { return implementation_->add(squares); }
Status TilesetWriter::finish() { return implementation_->finish(); }
std::size_t TilesetWriter::points() const { return implementation_->points(); }

}  // namespace revisit
