// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include <revisit/store/map_store.hpp>
#include <revisit/verification/place_clouds.hpp>

namespace revisit {

/// The clouds of a map's key frames, read when they are needed; the `kept` latest used stay in memory. A cloud that is
/// put must be in the store already. One that has been taken out of the map since is empty.
std::unique_ptr<PlaceClouds> clouds_in_store(std::shared_ptr<const MapStore> store, std::size_t kept = 256);

/// Clouds that no map keeps, in a file of the folder for temporary files ($TMPDIR), which no other program sees and
/// which is gone with its owner; the `kept` latest used stay in memory, and so do those that the disk does not take.
std::unique_ptr<PlaceClouds> clouds_in_file(std::size_t kept = 1024);

}  // namespace revisit
