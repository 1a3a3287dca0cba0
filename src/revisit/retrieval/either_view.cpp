// SPDX-License-Identifier: Apache-2.0
#include <revisit/retrieval/either_view.hpp>

#include <algorithm>

namespace revisit {
namespace {

constexpr double kNarrow = 0.5;      // share of all directions
constexpr std::size_t kSamples = 8;  // of a session's places: in a field a wide sensor sees little, too
constexpr std::size_t kMoreTogether = 4, kFewestOfASession = 3;

bool is_narrow(const PlaceIndex& index, const PlaceRange& session) {
  for (std::size_t i = 0; i < kSamples; ++i) {
    const auto descriptor = index.find(index.frame(session.first + i * session.size() / kSamples));
    if (descriptor && seen_share(*descriptor) >= kNarrow) return false;
  }
  return true;
}

std::vector<PlaceRange> sessions_of(const PlaceIndex& index, std::size_t places) {
  std::vector<PlaceRange> sessions;
  for (std::size_t first = 0; first < places; first = sessions.back().last) {
    const FrameId next = in_map(session_of(index.frame(first)) + 1, FrameId{0});
    sessions.emplace_back(first, std::min(places, index.until(FrameId{next.value - 1})));
  }
  return sessions;
}

}  // namespace

Result<std::vector<LoopCandidate>> search_either_view(const PlaceIndex& index, const IntensityScanContext& query,
                                                      std::size_t places, const RetrievalOptions& options) {
  if (seen_share(query) >= kNarrow) return index.search(query, places);
  const std::vector<PlaceRange> sessions = sessions_of(index, places);
  if (sessions.size() < 2 ||
      std::all_of(sessions.begin(), sessions.end(), [&](const auto& each) { return is_narrow(index, each); }))
    return index.search(query, places);
  const auto top_k = static_cast<std::size_t>(options.top_k);
  const std::size_t of_session = std::max(kFewestOfASession, kMoreTogether * top_k / sessions.size());
  std::vector<LoopCandidate> candidates;
  for (const PlaceRange& session : sessions) {
    const auto found = index.search(query, session);
    if (!found) return found.error();
    candidates.insert(candidates.end(), found->begin(),
                      found->begin() + static_cast<std::ptrdiff_t>(std::min(of_session, found->size())));
  }
  return candidates;
}

}  // namespace revisit
