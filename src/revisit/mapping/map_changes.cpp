// SPDX-License-Identifier: Apache-2.0
#include <revisit/mapping/map_changes.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <utility>

#include <revisit/mapping/internal/moving_points.hpp>

namespace revisit {
namespace {

using mapping_internal::VisibilityImage;
using Verdict = VisibilityImage::Verdict;

struct Comparing {
  static constexpr int kFewest = 2;           ///< visits that must agree
  static constexpr float kFarthest_m = 20.f;  ///< from the place: farther, errors of the heading count for metres
  static constexpr float kSame_m = 0.25f;     ///< edge of the voxels in which an addition has one point
};

struct Votes {
  int through = 0, surface = 0;
  bool is_gone() const { return through >= Comparing::kFewest && through > surface; }
  bool is_there() const { return surface >= Comparing::kFewest && surface > through; }
};

Eigen::Vector3f position(const Point& p) { return {p.x, p.y, p.z}; }

Votes ask(std::span<const Visit> visits, std::span<const Eigen::Isometry3f> T_visit_place, const Eigen::Vector3f& p) {
  Votes votes;
  for (std::size_t i = 0; i < visits.size(); ++i) {
    const Verdict verdict = visits[i].seen->image().look(T_visit_place[i] * p);
    votes.through += verdict == Verdict::kThrough;
    votes.surface += verdict == Verdict::kSurface;
  }
  return votes;
}

using Voxel = std::array<int, 3>;
using Voxels = std::set<Voxel>;

Voxel voxel_of(const Eigen::Vector3f& p) {
  const auto along = [](float x) { return static_cast<int>(std::floor(x / Comparing::kSame_m)); };
  return {along(p.x()), along(p.y()), along(p.z())};
}

// The voxel or one of those around it.
bool is_beside(const Voxels& voxels, const Voxel& at) {
  for (int x = at[0] - 1; x <= at[0] + 1; ++x)
    for (int y = at[1] - 1; y <= at[1] + 1; ++y) {
      const auto found = voxels.lower_bound({x, y, at[2] - 1});
      if (found != voxels.end() && *found <= Voxel{x, y, at[2] + 1}) return true;
    }
  return false;
}

}  // namespace

SeenFromKeyframe::SeenFromKeyframe(std::vector<Point> points)
    : points_(std::move(points)), image_(std::make_unique<const VisibilityImage>(points_)) {}

SeenFromKeyframe::~SeenFromKeyframe() = default;

bool update_place(PlacePoints& place, std::span<const Visit> visits, int session) {
  const auto now = static_cast<std::uint16_t>(session);
  std::vector<Eigen::Isometry3f> T_visit_place;
  T_visit_place.reserve(visits.size());
  for (const Visit& each : visits)
    T_visit_place.emplace_back((each.T_map_lidar.inverse() * place.T_map_lidar).cast<float>());
  // What the place itself saw, as the map has it now.
  std::vector<Point> standing;
  Voxels occupied, added;
  bool is_changed = false;
  for (std::size_t i = 0; i < place.points.size(); ++i) {
    PointHistory& history = place.history[i];
    if (!history.is_in_map()) continue;
    standing.push_back(place.points[i]);
    const Eigen::Vector3f p = position(place.points[i]);
    occupied.insert(voxel_of(p));
    if (p.norm() > Comparing::kFarthest_m) continue;
    const Votes votes = ask(visits, T_visit_place, p);
    if (votes.is_gone()) {
      is_changed = true;
      if (++history.missed >= kVisitsUntilGone) history.gone = now;
    } else if (votes.is_there() && history.missed > 0) {
      is_changed = true;
      history.missed = 0;
    }
  }
  const VisibilityImage own(standing);
  for (std::size_t i = 0; i < visits.size(); ++i) {
    const Eigen::Isometry3f T_place_visit = T_visit_place[i].inverse();
    for (const Point& each : visits[i].seen->points()) {
      const Eigen::Vector3f p = T_place_visit * position(each);
      if (p.norm() > Comparing::kFarthest_m || own.look(p) != Verdict::kThrough) continue;
      const Voxel voxel = voxel_of(p);
      if (is_beside(occupied, voxel) || added.contains(voxel) || !ask(visits, T_visit_place, p).is_there()) continue;
      added.insert(voxel);
      place.points.push_back({p.x(), p.y(), p.z(), each.intensity});
      place.history.push_back({now, PointHistory::kNever, 0});
      is_changed = true;
    }
  }
  return is_changed;
}

}  // namespace revisit
