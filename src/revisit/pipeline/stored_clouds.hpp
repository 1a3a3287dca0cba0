// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include <revisit/pipeline/place_clouds.hpp>
#include <revisit/store/map_store.hpp>

namespace revisit {

/// The clouds of a map's key frames, read from it when they are asked for; the latest `kept` stay in memory.
/// Who puts a cloud has it in the store already.
std::unique_ptr<PlaceClouds> clouds_in_store(std::shared_ptr<const MapStore> store, std::size_t kept = 256);

}  // namespace revisit
