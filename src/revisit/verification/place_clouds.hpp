// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <list>
#include <memory>
#include <utility>

#include <revisit/core/ids.hpp>
#include <revisit/core/result.hpp>
#include <revisit/registration/surface_cloud.hpp>
#include <revisit/verification/geometric.hpp>

namespace revisit {

/// Where the thin clouds of places are kept, by which candidates are registered. Belongs to one thread at a time; a
/// cloud that was given out does not change.
class PlaceClouds {
 public:
  PlaceClouds() = default;
  PlaceClouds(const PlaceClouds&) = delete;
  PlaceClouds& operator=(const PlaceClouds&) = delete;
  virtual ~PlaceClouds() = default;

  virtual Status put(FrameId frame, ThinCloud cloud) = 0;
  /// The cloud of a frame that was put; an error where it cannot be read.
  virtual Result<std::shared_ptr<const ThinCloud>> get(FrameId frame) = 0;
};

/// What the last few places that scans were registered onto look like: those that follow are often registered onto the
/// same. Belongs to one thread at a time.
class PlaceGeometries {
 public:
  /// Nothing where it was not kept.
  std::shared_ptr<const ScanGeometry> find(FrameId place);
  void keep(FrameId place, std::shared_ptr<const ScanGeometry> geometry);

 private:
  static constexpr std::size_t kKept = 12;                                     ///< a megabyte each
  std::list<std::pair<FrameId, std::shared_ptr<const ScanGeometry>>> by_use_;  ///< the latest first
};

/// All of them, in memory: some 80 kB a place for a sensor of 64 lines.
std::unique_ptr<PlaceClouds> clouds_in_memory();

}  // namespace revisit
