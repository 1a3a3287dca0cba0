// SPDX-License-Identifier: Apache-2.0
#include <tuple>

#include <gtest/gtest.h>

#include <revisit/retrieval/baseline_search.hpp>

namespace revisit {
namespace {

// A place is a number, the x of its only point; 100 and more have nothing in common with anything. Its key, the y, may
// say something else.
class Numbers : public Baseline {
 public:
  explicit Numbers(std::size_t every, std::size_t nearest = 0) : every_(every), nearest_(nearest) {}
  std::string name() const override { return "numbers"; }
  std::string source() const override { return "a test"; }
  std::size_t place_every() const override { return every_; }
  double least_similarity() const override { return -100.0; }
  Signature describe(std::span<const Point> points, double) const override {
    return {Eigen::MatrixXf{{points[0].x}, {points[0].y}}};
  }
  double similarity(const Signature& query, const Signature& place) const override {
    return std::max(-100.0, -std::abs(static_cast<double>(query.values(0, 0) - place.values(0, 0))));
  }
  Eigen::VectorXf key(const Signature& signature) const override { return signature.values.row(1) * -1.f; }
  std::size_t nearest_keys() const override { return nearest_; }

 private:
  std::size_t every_, nearest_;
};

// With an index that offers the last two places.
class LastNumbers final : public Numbers {
 public:
  using Numbers::Numbers;
  std::unique_ptr<BaselineIndex> make_index() const override {
    class Last final : public BaselineIndex {
     public:
      explicit Last(std::size_t every) : every_(static_cast<float>(every)) {}
      void add(const Baseline::Signature& place) override {
        const float number = every_ * static_cast<float>(places_);
        if (number < 20.f) {
          EXPECT_EQ(place.values(0, 0), number) << "each place, and nothing else";
        }
        ++places_;
      }
      std::vector<std::size_t> look_up(const Baseline::Signature&, std::size_t searchable) const override {
        EXPECT_LE(searchable, places_);
        return searchable < 2 ? std::vector<std::size_t>{} : std::vector{searchable - 2, searchable - 1};
      }
      std::size_t bytes() const override { return 2000; }

     private:
      float every_;
      std::size_t places_ = 0;
    };
    return std::make_unique<Last>(place_every());
  }
};

std::vector<Point> scan_at(float x, float y) { return {{x, y, 0.f, 0.f}}; }

// Scans 0, 1, ... 19, each a place of its own whose key is the same number, then one at x with the key y.
BaselineSearch after_twenty(std::unique_ptr<Baseline> method) {
  BaselineSearch search(std::move(method), ExclusionRule{1, 0.0});
  for (int i = 0; i < 20; ++i) {
    const auto x = static_cast<float>(i);
    EXPECT_EQ(search.process({FrameId{i}, 0.1 * i}, scan_at(x, x), 0.0).has_value(), i > 0) << i;
  }
  return search;
}
std::optional<BaselineSearch::Answer> answer_after_twenty(std::unique_ptr<Baseline> method, float x, float y) {
  return after_twenty(std::move(method)).process({FrameId{20}, 2.0}, scan_at(x, y), 0.0);
}
void expect_answer(int expected, std::unique_ptr<Baseline> method, float x, float y) {
  const auto answer = answer_after_twenty(std::move(method), x, y);
  ASSERT_TRUE(answer && answer->row.match) << x << " " << y;
  EXPECT_EQ(answer->row.match->value, expected) << x << " " << y;
  EXPECT_FALSE(answer->row.accepted);
}

TEST(BaselineSearch, AnswersTheMostAlikeOfTheScansThatArePlaces) {
  for (const auto& [every, x, expected] : {std::tuple{1, 13.f, 13},
                                           {5, 13.f, 15},
                                           {10, 13.f, 10},
                                           {40, 13.f, 0},
                                           {1, 19.f, 19},
                                           {1, 0.f, 0},
                                           {19, 13.f, 19},
                                           {5, 18.f, 15}})
    expect_answer(expected, std::make_unique<Numbers>(every), x, x);
}

TEST(BaselineSearch, OnlyThePlacesWithTheNearestKeysAreCompared) {
  expect_answer(15, std::make_unique<Numbers>(5, 2), 13.f, 13.f);
  expect_answer(10, std::make_unique<Numbers>(5, 2), 0.f, 13.f);
  expect_answer(15, std::make_unique<Numbers>(5, 1), 0.f, 13.f);
  expect_answer(0, std::make_unique<Numbers>(5, 4), 0.f, 13.f);
  expect_answer(2, std::make_unique<Numbers>(1, 1), 0.f, 2.5f);  // of two as near the earlier
}

TEST(BaselineSearch, AnIndexSaysWhichPlacesAreCompared) {
  expect_answer(15, std::make_unique<LastNumbers>(5), 13.f, 13.f);
  expect_answer(10, std::make_unique<LastNumbers>(5), 0.f, 13.f);
  expect_answer(10, std::make_unique<LastNumbers>(5, 1), 0.f, 13.f);
}

TEST(BaselineSearch, AStampThatRunsBackwardsDoesNotMakeAPlaceOlder) {
  BaselineSearch search(std::make_unique<Numbers>(1), ExclusionRule{1, 5.0});
  int frame = 0;
  for (const double stamp_s : {0.0, 10.0, 5.0}) {
    const auto x = static_cast<float>(frame);
    search.process({FrameId{frame++}, stamp_s}, scan_at(x, x), 0.0);
  }
  const auto answer = search.process({FrameId{3}, 12.0}, scan_at(2.f, 2.f), 0.0);
  ASSERT_TRUE(answer && answer->row.match);
  EXPECT_EQ(answer->row.match->value, 0);
}

TEST(BaselineSearch, CountsWhatItKeeps) {
  EXPECT_EQ(after_twenty(std::make_unique<Numbers>(1)).bytes_a_place(), 12u) << "two numbers and a key";
  EXPECT_EQ(after_twenty(std::make_unique<LastNumbers>(1)).bytes_a_place(), 112u);
}

TEST(BaselineSearch, TheLastScanIsComparedWithAnyFrame) {
  BaselineSearch search(std::make_unique<Numbers>(1), ExclusionRule{1, 0.0});
  for (int i = 0; i < 5; ++i) {
    search.process({FrameId{2 * i}, 0.1 * i}, scan_at(static_cast<float>(i), 0.f), 0.0);
  }
  EXPECT_EQ(search.similarity_to(FrameId{2}), -3.0);
  EXPECT_FALSE(search.similarity_to(FrameId{3}));
  EXPECT_FALSE(search.similarity_to(FrameId{10}));
}

TEST(BaselineSearch, NothingInCommonIsNoAnswer) {
  const auto answer = answer_after_twenty(std::make_unique<Numbers>(1), 500.f, 0.f);
  ASSERT_TRUE(answer);
  EXPECT_FALSE(answer->row.match);
  EXPECT_FALSE(answer->row.reason.empty());
}

}  // namespace
}  // namespace revisit
