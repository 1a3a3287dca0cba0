// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <vector>

#include <revisit/config/parameters.hpp>
#include <revisit/retrieval/place_index.hpp>

namespace revisit {

/// The best of the first `places` places, as PlaceIndex::search(). For a narrow query in a map that has sessions of
/// sensors that see all round, those of each session, and no order among sessions: fewer cells differ between two
/// sparse descriptors of different places than between those of one place of which one is dense, so that the sparsest
/// session would leave no candidate to the others. At most `options.top_k` of a session, and four times as many
/// together unless there are very many sessions. An error where the index was altered. Safe to call from several
/// threads.
Result<std::vector<LoopCandidate>> search_either_view(const PlaceIndex& index, const IntensityScanContext& query,
                                                      std::size_t places, const RetrievalOptions& options);

}  // namespace revisit
