// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <vector>

#include <revisit/config/parameters.hpp>
#include <revisit/retrieval/place_index.hpp>

namespace revisit {

/// The best of the first `places` places, as PlaceIndex::search() gives them, but for a narrow query (one that sees
/// less than half of all directions) in a map of several sessions of which any was made with a sensor that sees more.
/// There each session is searched by itself, and the candidates of one follow those of another. By cells that differ,
/// sparse descriptors of different places are nearer than a sparse and a dense one of the same place: in one search the
/// sparsest session would give all candidates. At most `options.top_k` of a session and four times as many together,
/// but at least three of each session. An error where the index was altered. Safe to call from several threads.
Result<std::vector<LoopCandidate>> search_either_view(const PlaceIndex& index, const IntensityScanContext& query,
                                                      std::size_t places, const RetrievalOptions& options);

}  // namespace revisit
