// SPDX-License-Identifier: Apache-2.0
#include <revisit/evaluation/given_pose_table.hpp>
#include <revisit/evaluation/loop_table.hpp>
#include <revisit/evaluation/pair_table.hpp>
#include <revisit/evaluation/retrieval_table.hpp>

#include <fstream>
#include <sstream>

#include "shared_data.hpp"

namespace revisit {
namespace {

using testing_support::shared_data;

Pose at(double x, double y, double yaw_deg = 0.0) {
  Pose T = Pose::Identity();
  T.translation() << x, y, 0.0;
  T.linear() = Eigen::AngleAxisd(to_radians(yaw_deg), Eigen::Vector3d::UnitZ()).toRotationMatrix();
  return T;
}

// Out along x at 1 m a frame (frames 0..99), then back: frame 100 + i stands where 99 - i stood, turned about.
// With 1 s a frame and the standard exclusion, frames from 127 on see a place 50 frames and 30 s old within 4 m.
Reference there_and_back(double y_offset = 0.0) {
  Trajectory trajectory;
  for (int i = 0; i < 100; ++i) trajectory.entries[FrameId{i}] = {1.0 * i, at(i, 0)};
  for (int i = 0; i < 100; ++i) trajectory.entries[FrameId{100 + i}] = {100.0 + i, at(99 - i, y_offset, 180.0)};
  return Reference(trajectory, {});
}

TEST(Reference, FindsRevisitsByDistanceFramesAndTime) {
  const Reference reference = there_and_back();
  EXPECT_EQ(reference.revisits().begin()->first.value, 123) << "frame 123 stands at x = 76, 3 m from frame 73";
  EXPECT_EQ(reference.revisits().size(), 77u);
  EXPECT_EQ(reference.reverse_revisits(), 77u);
  EXPECT_EQ(reference.revisits().at(FrameId{150}).nearest.value, 49);
  EXPECT_TRUE(there_and_back(4.1).revisits().empty());
}

TEST(GivenPoseTable, CountsByHand) {
  const Reference reference = there_and_back();
  const auto given = [](int query, int match, Pose T_match_query) {
    return GivenPose{FrameId{query}, FrameId{match}, T_match_query};
  };
  Pose high = at(0.2, 0.0, 180.0);
  high.translation().z() = 0.6;
  const std::vector<GivenPose> poses = {given(150, 49, at(0.1, 0.0, 178.0)),   // right
                                        given(151, 38, at(10.3, 0.0, 180.0)),  // right, though of a frame 10 m away
                                        given(152, 47, at(0.0, 0.6, 180.0)),   // too far off
                                        given(153, 46, at(0.0, 0.0, 90.0)),    // turned
                                        given(154, 45, high),                  // right in the plane
                                        given(110, 89, at(0.0, 0.0, 180.0))};  // no revisit: too soon
  const GivenPoseTable table = evaluate_given_poses(poses, reference, false);
  EXPECT_EQ(table.revisits, 77u);
  EXPECT_EQ(table.right, 2u);
  EXPECT_EQ(table.answers, 5u);
  EXPECT_NEAR(table.p95_yaw_deg, 90.0, 1e-9);
  EXPECT_NEAR(table.median_yaw_deg, 0.0, 1e-9);
  EXPECT_NEAR(table.p95_plane_m, 0.6, 1e-9);
  EXPECT_NEAR(table.p95_height_m, 0.6, 1e-9);
  EXPECT_EQ(evaluate_given_poses(poses, reference, true).right, 3u);
}

TEST(PairLists, AreOfOnePlaceOrOfTwoFarFromEachOther) {
  const Reference reference = there_and_back();
  const PairLists lists = make_pair_lists(reference.trajectory());
  std::size_t same = 0, others = 0;
  for (const auto& [query, pairs] : lists)
    for (const FramePair& pair : pairs) {
      const double distance_m = *reference.distance_m(pair.match, query);
      EXPECT_LT(pair.match, query);
      if (pair.is_same_place) {
        EXPECT_LT(distance_m, 3.0);
        EXPECT_GT(query.value - pair.match.value, 50);
      } else {
        EXPECT_GT(distance_m, 20.0);
      }
      (pair.is_same_place ? same : others) += 1;
    }
  // Frame 100 + i lies 0, 1 and 2 m from five frames; of these 75, twice 74 and twice 74 are more than 50 frames
  // before.
  EXPECT_EQ(same, 371u);
  EXPECT_EQ(others, 100 * same);
  const RetrievalTable table = evaluate_pairs({{0.9, true}, {0.8, false}, {0.7, true}, {0.1, false}});
  EXPECT_EQ(table.revisits, 2u);
  EXPECT_NEAR(table.f1_max, 0.8, 1e-12);
  EXPECT_NEAR(table.extended_precision, 0.75, 1e-12);
}

CandidateRow answer(int query, int match, double score) { return {FrameId{query}, FrameId{match}, score, false, ""}; }

TEST(RetrievalTable, CountsByHand) {
  const Reference reference = there_and_back();
  // 150 <-> 49, 151 <-> 48: right. 152 -> 10: wrong place. 110 is no revisit: false. 199 has no answer.
  const std::vector<CandidateRow> rows = {answer(150, 49, 0.9),
                                          answer(152, 10, 0.8),
                                          answer(151, 48, 0.7),
                                          answer(110, 3, 0.6),
                                          {FrameId{199}, std::nullopt, 0.0, false, ""}};
  const RetrievalTable table = evaluate_retrieval(rows, reference);
  EXPECT_EQ(table.answers, 4u);
  EXPECT_EQ(table.right, 2u);
  EXPECT_DOUBLE_EQ(table.recall_at_1, 2.0 / 77.0);
  EXPECT_DOUBLE_EQ(table.recall_at_p100, 1.0 / 77.0) << "before the false answer of score 0.8";
  EXPECT_DOUBLE_EQ(table.extended_precision, (1.0 + 1.0 / 77.0) / 2.0);
  // Steps: recall grows by 1/77 at precision 1, and by 1/77 at precision 2/3.
  EXPECT_NEAR(table.average_precision, (1.0 + 2.0 / 3.0) / 77.0, 1e-12);
  const double p = 2.0 / 3.0, r = 2.0 / 77.0;
  EXPECT_NEAR(table.f1_max, 2 * p * r / (p + r), 1e-12);
  ASSERT_EQ(table.curve.size(), 4u);
}

TEST(RetrievalTable, AFrameThatMayNotBeMatchedIsNoRightAnswer) {
  // Frames 102 and 99 are 2 m apart, but 3 frames: 102 is no revisit, and an answer to it is false.
  const RetrievalTable table = evaluate_retrieval({answer(102, 99, 0.9), answer(150, 49, 0.8)}, there_and_back());
  EXPECT_EQ(table.right, 1u);
  EXPECT_EQ(table.recall_at_p100, 0.0);
}

TEST(RetrievalTable, EqualScoresAreOneStep) {
  const Reference reference = there_and_back();
  const std::vector<CandidateRow> rows = {answer(150, 49, 0.9), answer(152, 10, 0.9), answer(151, 48, 0.9)};
  const RetrievalTable table = evaluate_retrieval(rows, reference);
  ASSERT_EQ(table.curve.size(), 1u);
  EXPECT_EQ(table.recall_at_p100, 0.0) << "no threshold parts the right from the false";
}

TEST(RetrievalTable, NoRowsNoRevisits) {
  const RetrievalTable table = evaluate_retrieval({}, Reference({}, {}));
  EXPECT_EQ(table.revisits, 0u);
  EXPECT_EQ(table.recall_at_1, 0.0);
}

LoopConstraint loop(int query, int match, const Pose& T_match_query) {
  LoopConstraint loop;
  loop.query = FrameId{query};
  loop.match = FrameId{match};
  loop.T_match_query = T_match_query;
  return loop;
}

TEST(LoopTable, RightWithinHalfAMetreAndThreeDegrees) {
  const Reference reference = there_and_back();
  const std::vector<LoopConstraint> rows = {
      loop(150, 49, at(0.4, 0, 180)),  // 0.4 m off
      loop(151, 48, at(0.6, 0, 180)),  // too far
      loop(152, 47, at(0, 0, 176)),    // too much turned
      loop(153, 40, at(6, 0, 180)),    // a right pose to a frame 6 m away is no false loop
      loop(900, 47, at(0, 0, 0)),      // no reference
  };
  const LoopTable table = evaluate_loops(rows, reference);
  EXPECT_EQ(table.accepted, 4u);
  EXPECT_EQ(table.false_loops, 2u);
  EXPECT_EQ(table.without_reference, 1u);
  EXPECT_DOUBLE_EQ(table.precision, 0.5);
  EXPECT_DOUBLE_EQ(table.recall, 2.0 / 77.0);
  EXPECT_DOUBLE_EQ(table.reverse_recall, 2.0 / 77.0);
  EXPECT_NEAR(table.p95_translation_m, 0.6, 1e-9);
  EXPECT_NEAR(table.p95_rotation_deg, 4.0, 1e-9);
}

// Counts that the data's README publishes for these trajectories: within 4 m, at least 50 frames before. Its "the other
// way" means a heading that differs by more than 150 degrees, from the nearest of those frames.
TEST(Reference, RevisitsOfKittiAsPublished) {
  REVISIT_NEEDS_SHARED_DATA();
  for (const auto& [name, revisits, reverse] : {std::tuple{"00", 791u, 2u},
                                                {"02", 287u, 43u},
                                                {"05", 493u, 0u},
                                                {"06", 269u, 0u},
                                                {"07", 96u, 0u},
                                                {"08", 265u, 223u}}) {
    std::ifstream file(shared_data() / "poses" / (std::string("kitti_") + name + ".txt"));
    Trajectory trajectory;
    std::string line;
    for (int frame = 0; std::getline(file, line); ++frame) {
      std::istringstream numbers(line);
      Eigen::Matrix<double, 3, 4> M;
      for (int i = 0; i < 12; ++i) numbers >> M(i / 4, i % 4);
      Pose T = Pose::Identity();
      // The heading of a camera is its z axis; ours is x.
      T.linear().col(0) = M.col(2);
      T.linear().col(1) = -M.col(0);
      T.linear().col(2) = -M.col(1);
      T.translation() = M.col(3);
      trajectory.entries[FrameId{frame}] = {0.1 * frame, T};
    }
    EvaluationRules rules;
    rules.exclude_s = 0.0;
    rules.reverse_heading_deg = 150.0;
    const Reference reference(trajectory, rules);
    EXPECT_EQ(reference.revisits().size(), revisits) << name;
    EXPECT_EQ(reference.reverse_revisits(), reverse) << name;
  }
}

}  // namespace
}  // namespace revisit
