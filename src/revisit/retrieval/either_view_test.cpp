// SPDX-License-Identifier: Apache-2.0
#include <revisit/retrieval/either_view.hpp>

#include <algorithm>
#include <random>

#include <gtest/gtest.h>

namespace revisit {
namespace {

constexpr int kSectors = 60, kNarrowSectors = 12, kPlaces = 40;

// Of a place: what is seen in the first sectors. The same seed is the same place.
unsigned place(int session, int i) { return static_cast<unsigned>(1000 * session + i); }
IntensityScanContext seen(unsigned place, int sectors, double density = 0.3) {
  std::mt19937 random(place);
  std::uniform_real_distribution<double> uniform;
  IntensityScanContext context;
  context.rings = 20;
  context.sectors = kSectors;
  context.intensity.resize(1200);
  context.occupancy.resize(19);
  for (std::size_t cell = 0; cell < 1200; ++cell) {
    const bool is_occupied = uniform(random) < density;
    if (!is_occupied || static_cast<int>(cell) / 20 >= sectors) continue;
    context.intensity[cell] = 100;
    context.occupancy[cell / 64] |= std::uint64_t{1} << (cell % 64);
  }
  return context;
}

// A session of a narrow sensor, one of a sensor that sees all round, elsewhere, and a denser one elsewhere again.
class EitherView : public testing::Test {
 protected:
  EitherView() {
    for (int i = 0; i < kPlaces; ++i) index_.add(in_map(0, FrameId{i}), i, seen(place(0, i), kNarrowSectors));
    for (int i = 0; i < kPlaces; ++i) index_.add(in_map(1, FrameId{i}), 100.0 + i, seen(place(1, i), kSectors, 0.3));
    for (int i = 0; i < kPlaces; ++i) index_.add(in_map(2, FrameId{i}), 200.0 + i, seen(place(2, i), kSectors, 0.5));
  }
  static RetrievalOptions options() {
    RetrievalOptions options;
    options.top_k = 6;
    options.shortlist = 10;
    options.separation_frames = 0;
    return options;
  }
  static std::vector<FrameId> of_session(const std::vector<LoopCandidate>& candidates, int session) {
    std::vector<FrameId> result;
    for (const LoopCandidate& each : candidates)
      if (session_of(each.match) == session) result.push_back(each.match);
    return result;
  }
  static void expect_plain(const PlaceIndex& index, const IntensityScanContext& query, std::size_t places) {
    const auto found = *search_either_view(index, query, places, options()), plain = *index.search(query, places);
    ASSERT_EQ(found.size(), plain.size());
    for (std::size_t i = 0; i < found.size(); ++i) EXPECT_EQ(found[i].match, plain[i].match);
  }
  PlaceIndex index_{options()};
};

TEST_F(EitherView, OfANarrowQueryTheBestOfEachSessionAreFound) {
  for (const int session : {1, 2}) {
    const IntensityScanContext query = seen(place(session, 7), kNarrowSectors, session == 1 ? 0.3 : 0.5);
    const auto plain = *index_.search(query, index_.size());
    EXPECT_EQ(of_session(plain, 0).size(), plain.size()) << "narrow views of other places differ in fewer cells";
    const auto found = *search_either_view(index_, query, index_.size(), options());
    for (const int each : {0, 1, 2}) EXPECT_EQ(of_session(found, each).size(), 6u);
    ASSERT_FALSE(of_session(found, session).empty());
    EXPECT_EQ(of_session(found, session).front(), in_map(session, FrameId{7}));
  }
}

TEST_F(EitherView, OnlyTheFirstPlacesAreSearched) {
  const auto found = *search_either_view(index_, seen(place(1, 7), kNarrowSectors), kPlaces + 5, options());
  EXPECT_EQ(found.size(), 11u) << "six of 40 and all five";
  for (const FrameId each : of_session(found, 1)) EXPECT_LT(in_recording(each), FrameId{5});
}

TEST_F(EitherView, OfManySessionsFewerEach) {
  for (int session = 3; session < 6; ++session)
    for (int i = 0; i < 4; ++i)
      index_.add(in_map(session, FrameId{i}), 300.0 + session, seen(place(session, i), kSectors));
  const auto found = *search_either_view(index_, seen(place(1, 7), kNarrowSectors), index_.size(), options());
  EXPECT_EQ(of_session(found, 0).size(), 4u) << "24 of six";
  for (int session = 6; session < 20; ++session)
    index_.add(in_map(session, FrameId{0}), 310.0 + session, seen(place(session, 0), kSectors));
  const auto of_many = *search_either_view(index_, seen(place(1, 7), kNarrowSectors), index_.size(), options());
  EXPECT_EQ(of_session(of_many, 0).size(), 3u);
}

TEST_F(EitherView, ElseTheSearchIsOneOfAllPlaces) {
  expect_plain(index_, seen(place(1, 7), kSectors), index_.size());  // of a wide query
  expect_plain(index_, seen(place(0, 7), kNarrowSectors), kPlaces);  // among the first session
  expect_plain(index_, seen(place(0, 7), kNarrowSectors), 0);
  PlaceIndex narrow(options());
  for (const int session : {0, 1})
    for (int i = 0; i < kPlaces; ++i)
      narrow.add(in_map(session, FrameId{i}), i + 100.0 * session, seen(place(session, i), kNarrowSectors));
  expect_plain(narrow, seen(place(1, 7), kNarrowSectors), narrow.size());
}

TEST_F(EitherView, ASessionBeginsWithItsFirstPlace) {
  for (const int session : {0, 1, 2}) {
    const IntensityScanContext query = seen(place(session, 0), kNarrowSectors, session < 2 ? 0.3 : 0.5);
    const auto found = *search_either_view(index_, query, index_.size(), options());
    ASSERT_FALSE(of_session(found, session).empty());
    EXPECT_EQ(of_session(found, session).front(), in_map(session, FrameId{0}));
  }
}

TEST_F(EitherView, PlacesThatAreNotSearchedDoNotCount) {
  PlaceIndex index(options());
  for (const int session : {0, 1, 2})
    for (int i = 0; i < kPlaces; ++i)
      index.add(in_map(session, FrameId{i}), i + 100.0 * session,
                seen(place(session, i), session < 2 ? kNarrowSectors : kSectors));
  expect_plain(index, seen(place(1, 7), kNarrowSectors), 2 * kPlaces);
}

TEST_F(EitherView, AViewOfHalfOfAllDirectionsIsNotNarrow) {
  const IntensityScanContext half = seen(place(1, 7), kSectors / 2);
  ASSERT_EQ(seen_share(half), 0.5);
  expect_plain(index_, half, index_.size());
  PlaceIndex index(options());
  for (int i = 0; i < kPlaces; ++i) index.add(in_map(0, FrameId{i}), i, seen(place(0, i), kNarrowSectors));
  for (int i = 0; i < kPlaces; ++i) index.add(in_map(1, FrameId{i}), 100.0 + i, half);
  const auto found = *search_either_view(index, seen(place(1, 7), kNarrowSectors), index.size(), options());
  EXPECT_EQ(found.size(), 12u) << "six of either";
}

// In a field a wide sensor sees little, too: one that ever sees all round is not narrow.
TEST_F(EitherView, ASessionIsNarrowWhereItNeverSeesMore) {
  for (const int wide : {0, 20}) {
    PlaceIndex index(options());
    for (int i = 0; i < kPlaces; ++i) index.add(in_map(0, FrameId{i}), i, seen(place(0, i), kNarrowSectors));
    for (int i = 0; i < kPlaces; ++i)
      index.add(in_map(1, FrameId{i}), 100.0 + i, seen(place(1, i), i == wide ? kSectors : kNarrowSectors));
    const auto found = *search_either_view(index, seen(place(1, 7), kNarrowSectors), index.size(), options());
    EXPECT_EQ(found.size(), 12u) << "six of either; wide: " << wide;
  }
}

}  // namespace
}  // namespace revisit
