// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <revisit/store/stored_map.hpp>

namespace revisit {

/// Known ground adds nothing for good: of sessions that are joined with earlier ones, key frames go that are no places,
/// or places beside those of earlier sessions where they were recognised; those whose loops join what is new to the
/// rest stay. True where any went: the map is then to be read again.
Result<bool> remove_known_ground(MapStore& store, const StoredMap& map);

}  // namespace revisit
