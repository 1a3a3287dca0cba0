// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <revisit/retrieval/baseline_search.hpp>

namespace revisit {
namespace {

// A place is a number, the x of its only point; 100 and more have nothing in common with anything.
class Numbers : public Baseline {
 public:
  explicit Numbers(std::size_t every, std::size_t nearest = 0) : every_(every), nearest_(nearest) {}
  std::string name() const override { return "numbers"; }
  std::string source() const override { return "a test"; }
  std::size_t place_every() const override { return every_; }
  double least_similarity() const override { return -100.0; }
  Signature describe(std::span<const Point> points, double) const override {
    return {Eigen::MatrixXf::Constant(1, 1, points[0].x)};
  }
  double similarity(const Signature& query, const Signature& place) const override {
    return std::max(-100.0, -std::abs(static_cast<double>(query.values(0, 0) - place.values(0, 0))));
  }
  Eigen::VectorXf key(const Signature& signature) const override { return signature.values.col(0) * -1.f; }
  std::size_t nearest_keys() const override { return nearest_; }

 private:
  std::size_t every_, nearest_;
};

// With an index that offers the last place alone.
class LastNumber final : public Numbers {
 public:
  using Numbers::Numbers;
  std::unique_ptr<BaselineIndex> make_index() const override {
    class Last final : public BaselineIndex {
     public:
      void add(const Baseline::Signature&) override { ++places_; }
      std::vector<std::size_t> look_up(const Baseline::Signature&, std::size_t searchable) const override {
        EXPECT_LE(searchable, places_);
        return searchable == 0 ? std::vector<std::size_t>{} : std::vector{searchable - 1};
      }
      std::size_t bytes() const override { return 0; }

     private:
      std::size_t places_ = 0;
    };
    return std::make_unique<Last>();
  }
};

// Scans 0, 1, ... 19, each a place of its own, then one at x.
std::optional<BaselineSearch::Answer> answer_after_twenty(std::unique_ptr<Baseline> method, float x) {
  BaselineSearch search(std::move(method), ExclusionRule{1, 0.0});
  for (int i = 0; i < 20; ++i) {
    const std::vector<Point> points{{static_cast<float>(i), 0.f, 0.f, 0.f}};
    EXPECT_EQ(search.process({FrameId{i}, 0.1 * i}, points, 0.0).has_value(), i > 0) << i;
  }
  const std::vector<Point> points{{x, 0.f, 0.f, 0.f}};
  return search.process({FrameId{20}, 2.0}, points, 0.0);
}

TEST(BaselineSearch, AnswersTheMostAlikeOfTheScansThatArePlaces) {
  for (const auto& [every, expected] : std::vector<std::pair<std::size_t, int>>{{1, 13}, {5, 15}, {10, 10}, {40, 0}}) {
    const auto answer = answer_after_twenty(std::make_unique<Numbers>(every), 13.f);
    ASSERT_TRUE(answer && answer->row.match) << every;
    EXPECT_EQ(answer->row.match->value, expected) << every;
    EXPECT_FALSE(answer->row.accepted);
  }
  const auto by_keys = answer_after_twenty(std::make_unique<Numbers>(5, 2), 13.f);
  ASSERT_TRUE(by_keys && by_keys->row.match);
  EXPECT_EQ(by_keys->row.match->value, 15);
  const auto by_index = answer_after_twenty(std::make_unique<LastNumber>(5), 0.f);
  ASSERT_TRUE(by_index && by_index->row.match);
  EXPECT_EQ(by_index->row.match->value, 15);
}

TEST(BaselineSearch, TheLastScanIsComparedWithAnyFrame) {
  BaselineSearch search(std::make_unique<Numbers>(1), ExclusionRule{1, 0.0});
  for (int i = 0; i < 5; ++i) {
    const std::vector<Point> points{{static_cast<float>(i), 0.f, 0.f, 0.f}};
    search.process({FrameId{2 * i}, 0.1 * i}, points, 0.0);
  }
  EXPECT_EQ(search.similarity_to(FrameId{2}), -3.0);
  EXPECT_FALSE(search.similarity_to(FrameId{3}));
  EXPECT_FALSE(search.similarity_to(FrameId{10}));
}

TEST(BaselineSearch, NothingInCommonIsNoAnswer) {
  const auto answer = answer_after_twenty(std::make_unique<Numbers>(1), 500.f);
  ASSERT_TRUE(answer);
  EXPECT_FALSE(answer->row.match);
  EXPECT_FALSE(answer->row.reason.empty());
}

}  // namespace
}  // namespace revisit
