// SPDX-License-Identifier: Apache-2.0
#include <revisit/registration/overhead_search.hpp>

#include <algorithm>
#include <bit>
#include <cmath>

#include <revisit/bits/occupancy_bits.h>

namespace revisit {
namespace {

constexpr int kSide = OverheadImage::kSide;
constexpr int kSteps = 120;  // of the heading, to a whole turn
constexpr double kStep_rad = 2.0 * kPi / kSteps;
constexpr std::size_t kWordsARow = kSide / 64;

void count(OverheadImage& image) {
  image.count = 0;
  for (const std::uint64_t word : image.bits) image.count += static_cast<std::size_t>(std::popcount(word));
}

// Row by row, 128 bits: what lies `cells` (less than 64) farther along x; what leaves the image is lost.
OverheadImage moved_along_x(const OverheadImage& image, int cells) {
  OverheadImage result;
  for (std::size_t row = 0; row < image.bits.size(); row += kWordsARow) {
    const std::uint64_t low = image.bits[row], high = image.bits[row + 1];
    if (cells > 0) {
      result.bits[row] = low << cells;
      result.bits[row + 1] = high << cells | low >> (64 - cells);
    } else if (cells < 0) {
      result.bits[row] = low >> -cells | high << (64 + cells);
      result.bits[row + 1] = high >> -cells;
    } else {
      result.bits[row] = low;
      result.bits[row + 1] = high;
    }
  }
  return result;
}

// Each bit, and its eight neighbours.
OverheadImage grown(const OverheadImage& image) {
  const OverheadImage left = moved_along_x(image, -1), right = moved_along_x(image, 1);
  OverheadImage wide, result;
  for (std::size_t w = 0; w < image.bits.size(); ++w) wide.bits[w] = image.bits[w] | left.bits[w] | right.bits[w];
  for (std::size_t w = 0; w < image.bits.size(); ++w) {
    result.bits[w] = wide.bits[w];
    if (w >= kWordsARow) result.bits[w] |= wide.bits[w - kWordsARow];
    if (w + kWordsARow < image.bits.size()) result.bits[w] |= wide.bits[w + kWordsARow];
  }
  count(result);
  return result;
}

// Bits set in `fixed` and in `moving` moved by `rows` along y.
std::uint64_t common(const OverheadImage& fixed, const OverheadImage& moving, int rows) {
  const auto away = static_cast<std::size_t>(std::abs(rows)) * kWordsARow;
  const std::uint64_t* const f = fixed.bits.data() + (rows > 0 ? away : 0);
  const std::uint64_t* const m = moving.bits.data() + (rows > 0 ? 0 : away);
  return revisit_bits_common(f, m, OverheadImage::kWords - away);
}

}  // namespace

OverheadImage overhead_image(const ThinCloud& cloud, double yaw_rad) {
  OverheadImage image;
  const Eigen::Matrix3f turn = (planar_pose(0.0, 0.0, yaw_rad) * upright_pose(cloud.up)).linear().cast<float>();
  constexpr float kMiddle = 0.5f * kSide;
  for (std::size_t i = 0; i < cloud.points.size(); ++i) {
    if (cloud.is_ground[i] != 0) continue;
    const Eigen::Vector3f& p = cloud.points[i];
    const float x = turn.row(0).dot(p) + kMiddle, y = turn.row(1).dot(p) + kMiddle;
    if (!(x >= 0.f && x < kSide && y >= 0.f && y < kSide)) continue;
    const std::size_t bit = static_cast<std::size_t>(y) * kSide + static_cast<std::size_t>(x);
    image.bits[bit / 64] |= std::uint64_t{1} << (bit % 64);
  }
  count(image);
  return image;
}

const OverheadSearch::Turned& OverheadSearch::turned(int step, int reach_m) {
  auto [found, is_new] = turns_.try_emplace((step % kSteps + kSteps) % kSteps);
  Turned& turned = found->second;
  if (is_new) turned.image = overhead_image(query_, found->first * kStep_rad);
  if (turned.moved_along_x.size() != 2 * static_cast<std::size_t>(reach_m) + 1) {
    turned.moved_along_x.clear();
    for (int x = -reach_m; x <= reach_m; ++x) turned.moved_along_x.push_back(moved_along_x(turned.image, x));
  }
  return turned;
}

OverheadMatch OverheadSearch::search(const ThinCloud& match, double yaw_rad, double yaw_reach_rad, int reach_m) {
  const OverheadImage place = overhead_image(match), place_grown = grown(place);
  OverheadMatch best;
  best.yaw_rad = yaw_rad;
  std::uint64_t most = 0;
  const auto nearest = static_cast<int>(std::lround(yaw_rad / kStep_rad));
  const auto reach = static_cast<int>(std::floor(yaw_reach_rad / kStep_rad + 1e-9));
  const Turned* best_turn = nullptr;
  for (int step = nearest - reach; step <= nearest + reach; ++step) {
    const Turned& query = turned(step, reach_m);
    for (int x = -reach_m; x <= reach_m; ++x)
      for (int y = -reach_m; y <= reach_m; ++y) {
        const std::uint64_t shared = common(
            place_grown, query.moved_along_x[static_cast<std::size_t>(x) + static_cast<std::size_t>(reach_m)], y);
        if (shared <= most) continue;
        most = shared;
        best_turn = &query;
        best = {wrap_angle(step * kStep_rad), x * OverheadImage::kCell_m, y * OverheadImage::kCell_m, 0.0};
      }
  }
  if (best_turn == nullptr || place.count == 0) return best;
  // The other way round: the place on the query's grown image.
  const OverheadImage query_grown = grown(moved_along_x(best_turn->image, static_cast<int>(best.x_m)));
  const std::uint64_t back = common(place, query_grown, static_cast<int>(best.y_m));
  best.overlap = std::min(static_cast<double>(most) / static_cast<double>(best_turn->image.count),
                          static_cast<double>(back) / static_cast<double>(place.count));
  return best;
}

}  // namespace revisit
