// SPDX-License-Identifier: Apache-2.0
#include <revisit/registration/overhead_search.hpp>

#include <algorithm>
#include <bit>
#include <cmath>

#include <oneapi/tbb/parallel_for.h>

#include <revisit/bits/occupancy_bits.h>

namespace revisit {
namespace {

constexpr int kSide = OverheadImage::kSide;
constexpr int kSteps = 120;  // of the heading, to a whole turn
constexpr double kStep_rad = 2.0 * kPi / kSteps;
constexpr std::size_t kWordsARow = kSide / 64;
constexpr std::size_t kFewestCells = 20;  // that both of two narrow views hold; of fewer, nothing can be said

struct Coarse {
  static constexpr int kSteps = 2, kCells = 2;
};
// What lies so far away is still the same answer.
struct Beside {
  static constexpr int kSteps = 4, kCells = 3;
};

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

OverheadImage moved_along_y(const OverheadImage& image, int cells) {
  OverheadImage result;
  const auto away = static_cast<std::ptrdiff_t>(std::abs(cells)) * static_cast<std::ptrdiff_t>(kWordsARow);
  if (cells >= 0)
    std::copy(image.bits.begin(), image.bits.end() - away, result.bits.begin() + away);
  else
    std::copy(image.bits.begin() + away, image.bits.end(), result.bits.begin());
  return result;
}

OverheadImage both(const OverheadImage& a, const OverheadImage& b) {
  OverheadImage result;
  for (std::size_t w = 0; w < a.bits.size(); ++w) result.bits[w] = a.bits[w] & b.bits[w];
  count(result);
  return result;
}

// All cells in the sector of a sensor that stands `x` cells from the middle, set upright and turned by `yaw_rad`: by
// where they lie at its height.
OverheadImage image_of(const SeenSpace::Sector& sector, const Eigen::Vector3f& up, double yaw_rad, int x) {
  OverheadImage image;
  const Eigen::Matrix2f back =
      (planar_pose(0.0, 0.0, yaw_rad) * upright_pose(up)).linear().transpose().topLeftCorner<2, 2>().cast<float>();
  constexpr float kMiddle = 0.5f * kSide - 0.5f;
  for (int row = 0; row < kSide; ++row)
    for (int column = 0; column < kSide; ++column) {
      const Eigen::Vector2f at(static_cast<float>(column - x) - kMiddle, static_cast<float>(row) - kMiddle);
      if (!sector.holds(back * at)) continue;
      const std::size_t bit = static_cast<std::size_t>(row) * kSide + static_cast<std::size_t>(column);
      image.bits[bit / 64] |= std::uint64_t{1} << (bit % 64);
    }
  count(image);
  return image;
}

double share(std::uint64_t part, std::size_t of) {
  return static_cast<double>(part) / static_cast<double>(std::max<std::size_t>(1, of));
}

// Bits set in `fixed` and in `moving` moved by `rows` along y.
std::uint64_t common(const OverheadImage& fixed, const OverheadImage& moving, int rows) {
  const auto away = static_cast<std::size_t>(std::abs(rows)) * kWordsARow;
  const std::uint64_t* const f = fixed.bits.data() + (rows > 0 ? away : 0);
  const std::uint64_t* const m = moving.bits.data() + (rows > 0 ? 0 : away);
  return revisit_bits_common(f, m, OverheadImage::kWords - away);
}

}  // namespace

OverheadImage overhead_image(const ThinCloud& cloud, double cell_m, double yaw_rad) {
  OverheadImage image;
  const Eigen::Matrix3f turn =
      ((planar_pose(0.0, 0.0, yaw_rad) * upright_pose(cloud.up)).linear() / cell_m).cast<float>();
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

OverheadSearch::OverheadSearch(const ThinCloud& query)
    : query_(query), query_sector_(query.seen.sector()), turns_(kSteps) {}

OverheadSearch::Turned& OverheadSearch::turned(int step) {
  const int whole = (step % kSteps + kSteps) % kSteps;
  Turned& turn = turns_[static_cast<std::size_t>(whole)];
  if (!turn.image) turn.image = overhead_image(query_, cell_m_, whole * kStep_rad);
  return turn;
}

const OverheadImage& OverheadSearch::moved(int step, int x) {
  Turned& turn = turned(step);
  auto [found, is_new] = turn.moved_along_x.try_emplace(x);
  if (is_new) found->second = moved_along_x(*turn.image, x);
  return found->second;
}

// The overlap, both ways round: the query on the place's grown image, of which `shared` are common, and the other way.
OverheadMatch OverheadSearch::match_at(const OverheadImage& place, const OverheadImage& place_grown, const At& at) {
  OverheadMatch match{wrap_angle(at.step * kStep_rad), at.x * cell_m_, at.y * cell_m_, 0.0};
  const OverheadImage& query = moved(at.step, at.x);
  if (place_sector_.is_all_round() && query_sector_.is_all_round()) {
    const std::uint64_t back = common(place, grown(query), at.y);
    match.overlap = std::min(share(at.shared, turned(at.step).image->count), share(back, place.count));
    return match;
  }
  // Of each only what lies where the other one looks.
  OverheadImage place_there = place, query_there = moved_along_y(query, at.y);
  count(query_there);
  if (!query_sector_.is_all_round())
    place_there = both(place, moved_along_y(image_of(query_sector_, query_.up, match.yaw_rad, at.x), at.y));
  if (!place_sector_.is_all_round()) query_there = both(query_there, seen_by_place_);
  if (std::min(place_there.count, query_there.count) < kFewestCells) return match;
  match.overlap = std::min(share(common(place_grown, query_there, 0), query_there.count),
                           share(common(place_there, grown(moved_along_y(query, at.y)), 0), place_there.count));
  return match;
}

// The best of `at` and all that lie one step beside it.
OverheadSearch::At OverheadSearch::climb(const OverheadImage& place_grown, const At& at) {
  At best = at;
  for (int step = at.step - 1; step <= at.step + 1; ++step)
    for (int x = at.x - 1; x <= at.x + 1; ++x)
      for (int y = at.y - 1; y <= at.y + 1; ++y) {
        const auto shared = static_cast<std::uint32_t>(common(place_grown, moved(step, x), y));
        if (shared > best.shared) best = {step, x, y, shared};
      }
  return best;
}

// Images are grown by a cell, so that every other heading and cell shows where to look closely.
void OverheadSearch::try_headings(const OverheadImage& place_grown, int first_step, int last_step, int reach_cells) {
  const auto side = 2 * static_cast<std::size_t>(reach_cells) / Coarse::kCells + 1;
  const auto headings = static_cast<std::size_t>(last_step - first_step) / Coarse::kSteps + 1;
  coarse_.resize(headings * side * side);
  // Steps that are a whole turn apart share their images: only one of the two is tried beside others.
  const auto one_heading = [&](std::size_t heading) {
    const int step = first_step + static_cast<int>(heading) * Coarse::kSteps;
    At* at = coarse_.data() + heading * side * side;
    for (int x = -reach_cells; x <= reach_cells; x += Coarse::kCells) {
      const OverheadImage& query = moved(step, x);
      for (int y = -reach_cells; y <= reach_cells; y += Coarse::kCells)
        *at++ = {step, x, y, static_cast<std::uint32_t>(common(place_grown, query, y))};
    }
  };
  const bool comes_round = last_step - first_step == kSteps;
  tbb::parallel_for(std::size_t{0}, comes_round ? headings - 1 : headings, one_heading);
  if (comes_round) one_heading(headings - 1);
}

std::vector<OverheadMatch> OverheadSearch::search(const ThinCloud& match, double yaw_rad, double yaw_reach_rad,
                                                  double reach_m, std::size_t wanted) {
  const auto cell_m = static_cast<double>(std::max(match.voxel_m, query_.voxel_m));
  if (cell_m != cell_m_) turns_.assign(kSteps, {});
  cell_m_ = cell_m;
  place_sector_ = match.seen.sector();
  if (!place_sector_.is_all_round()) seen_by_place_ = image_of(place_sector_, match.up, 0.0, 0);
  const OverheadImage place = overhead_image(match, cell_m), place_grown = grown(place);
  const int reach_cells = static_cast<int>(std::lround(reach_m / cell_m));
  const auto nearest = static_cast<int>(std::lround(yaw_rad / kStep_rad));
  const int reach = std::min(static_cast<int>(std::floor(yaw_reach_rad / kStep_rad + 1e-9)), kSteps / 2);
  try_headings(place_grown, nearest - reach, nearest + reach, reach_cells);
  std::vector<At> found;
  while (found.size() < std::max<std::size_t>(1, wanted)) {
    const At most =
        *std::max_element(coarse_.begin(), coarse_.end(), [](const At& a, const At& b) { return a.shared < b.shared; });
    if (most.shared == 0) break;
    found.push_back(climb(place_grown, most));
    for (At& each : coarse_)  // what lies beside is the same answer
      if (is_beside(each, most)) each.shared = 0;
  }
  std::stable_sort(found.begin(), found.end(), [](const At& a, const At& b) { return a.shared > b.shared; });
  std::vector<OverheadMatch> matches;
  matches.reserve(found.size() + 1);
  for (const At& each : found) matches.push_back(match_at(place, place_grown, each));
  if (matches.empty()) matches.push_back({wrap_angle(yaw_rad), 0.0, 0.0, 0.0});
  return matches;
}

bool OverheadSearch::is_beside(const At& a, const At& b) {
  const int apart = std::abs(a.step - b.step) % kSteps;
  return std::min(apart, kSteps - apart) <= Beside::kSteps && std::abs(a.x - b.x) <= Beside::kCells &&
         std::abs(a.y - b.y) <= Beside::kCells;
}

}  // namespace revisit
