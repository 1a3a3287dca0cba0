// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <revisit/config/parameters.hpp>
#include <revisit/core/exclusion.hpp>
#include <revisit/core/loop.hpp>
#include <revisit/core/result.hpp>
#include <revisit/descriptors/intensity_scan_context.hpp>
#include <revisit/retrieval/place_range.hpp>

namespace revisit {
namespace retrieval_internal {
class PlaceStore;
}

/// How much of an index a search looked at.
struct SearchEffort {
  std::size_t places = 0;  ///< that were to be searched
  std::size_t compared =
      0;  ///< whose occupancy images were compared; the others were excluded by a bound, without loss
};

/// Every place seen so far, by its descriptor, searched in the paper's two stages (section III-C): geometry over the
/// whole allowed past, then intensity for those of best geometry score. The answer is that of comparing every place
/// (docs/retrieval.md). Some 1.0 kB a place at the default grid, 1.5 kB on one of 1200 cells; nothing moves as it
/// grows. One thread may add while any number of others search. An index can be saved, and opened again in milliseconds
/// however large it is: it is mapped, not read. What is mapped is checked before it is used: a search that meets
/// altered bytes gives an error that names the file. A file that is shortened while it is mapped ends the program, as
/// with any mapped file; replacing it is fine.
class PlaceIndex {
 public:
  explicit PlaceIndex(const RetrievalOptions& options);
  ~PlaceIndex();
  PlaceIndex(PlaceIndex&&) noexcept;
  PlaceIndex& operator=(PlaceIndex&&) noexcept;

  /// A frame that does not increase, or a descriptor of another grid than the first, throws std::invalid_argument.
  void add(FrameId frame, double stamp_s, const IntensityScanContext& descriptor);

  /// Places are searched by prefix: the first so many that were added. Those old enough for a query at this frame and
  /// time (ExclusionRule; where stamps run backwards, a place counts as old as the latest before it):
  std::size_t searchable(const FrameTime& query) const;
  /// Those of frames up to `newest`.
  std::size_t until(FrameId newest) const;
  /// All.
  std::size_t size() const;
  /// The frame of the place added as number `place`, below size().
  FrameId frame(std::size_t place) const;

  /// The best of these places, best first by geometry plus intensity score (ties: the earlier frame).
  /// `threads` share the work.
  Result<std::vector<LoopCandidate>> search(const IntensityScanContext& query, PlaceRange places, int threads = 1,
                                            SearchEffort* effort = nullptr) const;

  /// The descriptor of a frame, valid as long as the index. None where the file it lies in was altered.
  std::optional<DescriptorView> find(FrameId frame) const;

  /// Writes all places to a file, which is replaced only once the new one is complete. Not while a place is added.
  Status save(const std::string& path) const;
  /// Opens a saved index, to search and to go on adding. Refused are files that are no index, of another version, cut
  /// off or altered.
  static Result<PlaceIndex> open(const std::string& path, const RetrievalOptions& options);
  /// The same file in pieces, which lie within another one. Each is read as it was written, by one thread at a time:
  /// what is used first at first, the rest in the background; then `read` is destroyed. `size` is what they have
  /// together; `name` is for errors.
  using WritePiece = std::function<Status(std::size_t offset, std::span<const std::byte> bytes)>;
  using ReadPiece = std::function<Status(std::size_t offset, std::span<std::byte> to)>;
  Status save(const WritePiece& write) const;
  static Result<PlaceIndex> open(const std::string& name, std::size_t size, ReadPiece read,
                                 const RetrievalOptions& options);
  /// Reads all that open() left to be checked on first use.
  Status check() const;

 private:
  using Store = retrieval_internal::PlaceStore;
  PlaceIndex(const RetrievalOptions& options, std::unique_ptr<Store> store);

  RetrievalOptions options_;
  std::unique_ptr<Store> store_;
};

}  // namespace revisit
