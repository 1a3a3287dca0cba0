// SPDX-License-Identifier: Apache-2.0
#include <revisit/mapping/map_changes.hpp>

#include <cmath>

#include <gtest/gtest.h>

namespace revisit {
namespace {

Pose at(double x) {
  Pose T = Pose::Identity();
  T.translation().x() = x;
  return T;
}

// Walls on both sides of a road, 10 m off, seen from (x, 0); and a box 4 m to the left at x = 2, if it is there. Points
// as a sensor sees them: a box hides what is behind it.
std::vector<Point> seen_from(double x, bool with_box) {
  std::vector<Point> points;
  for (int azimuth = 0; azimuth < 720; ++azimuth)
    for (int elevation = -24; elevation <= 24; ++elevation) {
      const double a = azimuth * kPi / 360.0, e = elevation * kPi / 360.0;
      const Eigen::Vector3d d(std::cos(e) * std::cos(a), std::cos(e) * std::sin(a), std::sin(e));
      if (std::abs(d.y()) < 0.2) continue;
      double range_m = 10.0 / std::abs(d.y());
      if (with_box && d.y() > 0.0) {
        const double to_box_m = 4.0 / d.y();
        if (std::abs(x + to_box_m * d.x() - 2.0) < 1.0) range_m = to_box_m;
      }
      const Eigen::Vector3f p = (range_m * d).cast<float>();
      points.push_back({p.x(), p.y(), p.z(), 0.5f});
    }
  return points;
}

std::vector<Visit> drive_by(bool with_box) {
  std::vector<Visit> visits;
  for (const double x : {-2.0, 0.5, 2.5, 4.0})
    visits.push_back({at(x), std::make_shared<SeenFromKeyframe>(seen_from(x, with_box))});
  return visits;
}

PlacePoints place(bool with_box) {
  PlacePoints result{at(1.0), seen_from(1.0, with_box), {}};
  result.history.resize(result.points.size());
  return result;
}

bool is_box(const Point& p) { return p.y > 3.0f && p.y < 5.0f; }

std::size_t boxes_in_map(const PlacePoints& place) {
  std::size_t count = 0;
  for (std::size_t i = 0; i < place.points.size(); ++i)
    count += is_box(place.points[i]) && place.history[i].is_in_map();
  return count;
}

TEST(MapChanges, WhatThreeVisitsSeeThroughIsGoneAndRemembered) {
  PlacePoints changing = place(true);
  const std::size_t before = boxes_in_map(changing), all = changing.points.size();
  ASSERT_GT(before, 100u);
  for (int session = 1; session <= 2; ++session) {
    EXPECT_TRUE(update_place(changing, drive_by(false), session));
    EXPECT_EQ(boxes_in_map(changing), before) << "after " << session << " visits";
  }
  update_place(changing, drive_by(false), 3);
  EXPECT_LT(boxes_in_map(changing), before / 20);
  std::size_t walls_gone = 0;
  for (std::size_t i = 0; i < all; ++i) {
    const PointHistory& history = changing.history[i];
    walls_gone += !is_box(changing.points[i]) && !history.is_in_map();
    if (is_box(changing.points[i]) && !history.is_in_map()) {
      EXPECT_TRUE(history.was_in_map(2) && !history.was_in_map(3));
    }
  }
  EXPECT_EQ(walls_gone, 0u);
}

TEST(MapChanges, WhatIsSeenAgainStays) {
  PlacePoints changing = place(true);
  const std::size_t before = boxes_in_map(changing);
  for (int session = 1; session <= 6; ++session) update_place(changing, drive_by(session % 3 == 0), session);
  EXPECT_EQ(boxes_in_map(changing), before);
}

TEST(MapChanges, WhatIsNewIsAddedOnceAndMayGoAgain) {
  PlacePoints changing = place(false);
  const std::size_t all = changing.points.size();
  ASSERT_EQ(boxes_in_map(changing), 0u);
  EXPECT_TRUE(update_place(changing, drive_by(true), 1));
  const std::size_t added = boxes_in_map(changing);
  EXPECT_GT(added, 30u);
  EXPECT_EQ(changing.points.size(), changing.history.size());
  EXPECT_EQ(changing.points.size() - all, added) << "nothing but the box";
  EXPECT_EQ(changing.history.back().since, 1);
  update_place(changing, drive_by(true), 2);
  EXPECT_EQ(boxes_in_map(changing), added) << "once";
  for (int session = 3; session <= 5; ++session) update_place(changing, drive_by(false), session);
  EXPECT_LT(boxes_in_map(changing), added / 10);
}

TEST(MapChanges, OneVisitAloneDecidesNothing) {
  PlacePoints changing = place(true);
  std::vector<Visit> one = drive_by(false);
  one.resize(1);
  EXPECT_FALSE(update_place(changing, one, 1));
  EXPECT_FALSE(update_place(changing, {}, 1));
}

}  // namespace
}  // namespace revisit
