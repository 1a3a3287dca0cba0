// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>
#include <string_view>

#include <revisit/core/pose.hpp>
#include <revisit/simulation/internal/random.hpp>
#include <revisit/simulation/internal/world.hpp>

namespace revisit::simulation_internal {
namespace {

struct Junction {
  int column = 0, row = 0;
  bool operator==(const Junction&) const = default;
};
constexpr std::array<Junction, 4> kMoves = {{{1, 0}, {0, 1}, {-1, 0}, {0, -1}}};

// A crooked grid: junctions some 80 m apart, none quite where its neighbours would have it.
Eigen::Vector2d position(const Junction& j, std::uint64_t seed) {
  const auto key = mix(seed, as_key(j.column + 1000), as_key(j.row + 1000));
  return {84.0 * j.column + 24.0 * static_cast<double>(uniform(key) - 0.5f),
          78.0 * j.row + 24.0 * static_cast<double>(uniform(key + 1) - 0.5f)};
}

// Twice around a block, around its neighbour, and back through the same streets the other way; then on at random.
std::vector<Junction> junctions_of_drive(double length_m, std::uint64_t seed) {
  Random random(seed);
  const int turn = random.whole(0, 3);
  std::vector<int> moves;
  for (const char c : std::string_view("ENWSENNWSESW")) {
    const int move = c == 'E' ? 0 : c == 'N' ? 1 : c == 'W' ? 2 : 3;
    moves.push_back((move + turn) % 4);
  }
  std::vector<Junction> way = {{0, 0}};
  double driven_m = 0.0;
  constexpr int kReach = 3;  // it stays among so many blocks each way, so that streets come again
  const int reach = kReach + static_cast<int>(length_m / 4000.0);
  for (std::size_t i = 0; driven_m < length_m + 60.0; ++i) {
    int move = 0;
    if (i < moves.size()) {
      move = moves[i];
    } else {
      do {
        move = random.whole(0, 3);
      } while ((move + 2) % 4 == moves.back() ||
               std::max(std::abs(way.back().column + kMoves[static_cast<std::size_t>(move)].column),
                        std::abs(way.back().row + kMoves[static_cast<std::size_t>(move)].row)) > reach);
      moves.push_back(move);
    }
    const Junction& step = kMoves[static_cast<std::size_t>(move)];
    const Junction next{way.back().column + step.column, way.back().row + step.row};
    driven_m += (position(next, seed) - position(way.back(), seed)).norm();
    way.push_back(next);
  }
  return way;
}

Eigen::Vector2d left_of(const Eigen::Vector2d& direction) { return {-direction.y(), direction.x()}; }

// Where two lanes meet: each is a line beside the middle of its street.
Eigen::Vector2d meet(const Eigen::Vector2d& p, const Eigen::Vector2d& d, const Eigen::Vector2d& q,
                     const Eigen::Vector2d& e) {
  const double cross = d.x() * e.y() - d.y() * e.x();
  if (std::abs(cross) < 0.15) return 0.5 * (p + q);  // nearly straight on
  const Eigen::Vector2d gap = q - p;
  return p + d * ((gap.x() * e.y() - gap.y() * e.x()) / cross);
}

}  // namespace

StreetDrive drive_through_streets(double length_m, std::uint64_t seed) {
  constexpr double kLane_m = 1.45;
  const std::vector<Junction> way = junctions_of_drive(length_m, seed);
  Random random(mix(seed, 7));
  std::vector<Eigen::Vector2d> middle, direction, corners;
  std::vector<double> right_m;
  for (const Junction& junction : way) middle.push_back(position(junction, seed));
  for (std::size_t i = 0; i + 1 < way.size(); ++i) {
    direction.push_back((middle[i + 1] - middle[i]).normalized());
    right_m.push_back(random.chance(0.25) ? 3 * kLane_m : kLane_m);  // now and then in the outer lane
  }
  const auto lane_start = [&](std::size_t i) -> Eigen::Vector2d {
    return middle[i] - right_m[i] * left_of(direction[i]);
  };
  const auto lane_end = [&](std::size_t i) -> Eigen::Vector2d {
    return middle[i + 1] - right_m[i] * left_of(direction[i]);
  };
  corners.push_back(lane_start(0) + 10.0 * direction[0]);
  for (std::size_t i = 0; i + 1 < direction.size(); ++i)
    corners.push_back(meet(lane_end(i), direction[i], lane_start(i + 1), direction[i + 1]));
  corners.push_back(lane_end(direction.size() - 1) - 10.0 * direction.back());

  std::vector<Knot> knots =
      drive(corners, {.speed_mps = 11.0, .corner_speed_mps = 5.0, .acceleration_mps2 = 2.2, .corner_radius_m = 8.0});
  double driven_m = 0.0;
  std::size_t count = 1;
  for (; count < knots.size() && driven_m < length_m; ++count)
    driven_m += std::hypot(knots[count].x - knots[count - 1].x, knots[count].y - knots[count - 1].y);
  knots.resize(std::max<std::size_t>(count, 2));
  for (Knot& knot : knots)
    knot.ground_z = 5.0 * smooth_noise(mix(seed, 11), knot.x / 160.0, knot.y / 160.0) +
                    1.0 * smooth_noise(mix(seed, 12), knot.x / 45.0, knot.y / 45.0);

  // Streets that the drive passes by, as their right lanes.
  StreetDrive result{Path(std::move(knots)), {}};
  for (const Junction& junction : way)
    for (const Junction& step : kMoves) {
      const Eigen::Vector2d a = position(junction, seed),
                            b = position({junction.column + step.column, junction.row + step.row}, seed);
      const Eigen::Vector2d d = (b - a).normalized(), offset = -kLane_m * left_of(d);
      const double yaw_rad = std::atan2(d.y(), d.x());
      result.streets.push_back(
          {{(a + offset).x(), (a + offset).y(), yaw_rad, 0.0}, {(b + offset).x(), (b + offset).y(), yaw_rad, 0.0}});
    }
  return result;
}

}  // namespace revisit::simulation_internal
