// SPDX-License-Identifier: Apache-2.0
#include <revisit/evaluation/pair_table.hpp>

#include <algorithm>
#include <random>
#include <utility>

#include <revisit/evaluation/internal/sweep.hpp>

namespace revisit {
namespace {

constexpr double kSame_m = 3.0, kOther_m = 20.0;
constexpr std::int64_t kFramesApart = 50;
constexpr std::size_t kOthersEach = 100;

}  // namespace

PairLists make_pair_lists(const Trajectory& trajectory, std::uint64_t seed) {
  struct At {
    FrameId frame;
    Eigen::Vector3d position;
  };
  std::vector<At> all;
  for (const auto& [frame, entry] : trajectory.entries) all.push_back({frame, entry.T_world_lidar.translation()});
  PairLists lists;
  std::size_t same = 0;
  for (std::size_t q = 0; q < all.size(); ++q)
    for (std::size_t m = 0; m < q; ++m)
      if (all[q].frame.value - all[m].frame.value > kFramesApart &&
          (all[q].position - all[m].position).norm() < kSame_m) {
        lists[all[q].frame].push_back({all[m].frame, true});
        ++same;
      }
  std::mt19937_64 random(seed);
  // As many tries as find enough wherever a drive leads farther than 20 m.
  for (std::size_t wanted = kOthersEach * same, tries = 20 * wanted; wanted > 0 && tries > 0; --tries) {
    const std::size_t a = random() % all.size(), b = random() % all.size();
    const std::size_t q = std::max(a, b), m = std::min(a, b);
    if ((all[q].position - all[m].position).norm() <= kOther_m) continue;
    lists[all[q].frame].push_back({all[m].frame, false});
    --wanted;
  }
  return lists;
}

RetrievalTable evaluate_pairs(const std::vector<ScoredPair>& pairs) {
  std::vector<evaluation_internal::Answer> answers;
  std::size_t same = 0;
  for (const ScoredPair& pair : pairs) {
    answers.push_back({pair.score, pair.is_same_place});
    same += pair.is_same_place;
  }
  return evaluation_internal::sweep(std::move(answers), same);
}

}  // namespace revisit
