// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include <revisit/core/ids.hpp>
#include <revisit/core/result.hpp>
#include <revisit/registration/surface_cloud.hpp>

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

/// All of them, in memory: some 80 kB a place for a sensor of 64 lines.
std::unique_ptr<PlaceClouds> clouds_in_memory();

}  // namespace revisit
