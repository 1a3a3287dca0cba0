// SPDX-License-Identifier: Apache-2.0
#include <revisit/pose_graph/earth.hpp>

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include <revisit/pose_graph/internal/rough_place.hpp>

namespace revisit {
namespace {

using pose_graph_internal::FixPairs;
using pose_graph_internal::RoughPlace;

struct Placing {
  static constexpr double kLeast_m = 0.3;    ///< where on the vehicle the antenna is, nobody said
  static constexpr double kTilt_deg = 10.0;  ///< from upright, where a way is straight and tells nothing of it
};

// A graph with the earth in it, settled, and its truncated cost over all fixes, also those that it was settled without.
struct Attempt {
  PoseGraph graph;
  double cost = 0.0;
  bool all_agree = true;
};

Result<Attempt> settle_with(const PoseGraph& graph, const std::vector<PoseEdge>& fixes,
                            const std::vector<bool>& counts) {
  Attempt attempt{graph};
  for (std::size_t i = 0; i < fixes.size(); ++i)
    if (counts[i]) attempt.graph.add_edge(fixes[i]);
  if (const auto report = attempt.graph.optimise(PoseGraph::kExactly); !report) return report.error();
  const auto count = [&](const PoseEdge& edge) {
    const double error = squared_error(edge, attempt.graph.nodes()[edge.from], attempt.graph.nodes()[edge.to]);
    attempt.all_agree = attempt.all_agree && error <= PoseGraph::kTruncation;
    attempt.cost += edge.is_loop ? std::min(error, PoseGraph::kTruncation) : error;
  };
  std::for_each(graph.edges().begin(), graph.edges().end(), count);
  std::for_each(fixes.begin(), fixes.end(), count);
  return attempt;
}

// Graduated non-convexity begins where all fixes together pull the graph. Where many are wrong and agree with each
// other it may end with them; so the graph is settled with those alone that most speak for, too, and the lower cost
// counts.
Result<Attempt> settle_best(const PoseGraph& graph, const std::vector<PoseEdge>& fixes, const std::vector<bool>& near) {
  auto with_all = settle_with(graph, fixes, std::vector<bool>(fixes.size(), true));
  if (!with_all || with_all->all_agree) return with_all;
  auto with_near = settle_with(graph, fixes, near);
  return with_near && with_near->cost < with_all->cost ? std::move(with_near) : std::move(with_all);
}

}  // namespace

Result<std::vector<std::optional<Pose>>> settle_on_earth(PoseGraph& graph, std::span<const EarthFix> fixes,
                                                         std::span<const int> part_of_node) {
  const std::size_t parts =
      part_of_node.empty() ? 0
                           : static_cast<std::size_t>(*std::max_element(part_of_node.begin(), part_of_node.end())) + 1;
  std::vector<std::optional<Pose>> T_earth_world(parts);
  std::vector<FixPairs> pairs(parts);
  for (const EarthFix& fix : fixes) {
    FixPairs& of_part = pairs[static_cast<std::size_t>(part_of_node[fix.node])];
    of_part.world.push_back(graph.nodes()[fix.node].translation());
    of_part.earth.push_back(fix.position_m);
    of_part.deviation_m.push_back(std::max(Placing::kLeast_m, fix.deviation_m.head<2>().norm()));
  }
  // The earth is one more node for each part, whose pose is found with the others.
  PoseGraph extended = graph;
  std::vector<std::size_t> earth(parts);
  std::vector<std::optional<RoughPlace>> rough(parts);
  for (std::size_t part = 0; part < parts; ++part) {
    rough[part] = pose_graph_internal::place_roughly(pairs[part]);
    if (!rough[part]) continue;
    const Pose& T = rough[part]->T_earth_world;
    earth[part] = extended.add_node(T.inverse());
    const auto first = std::find(part_of_node.begin(), part_of_node.end(), static_cast<int>(part));
    const auto node = static_cast<std::size_t>(first - part_of_node.begin());
    PoseEdge upright{earth[part], node, T * graph.nodes()[node], Matrix6::Zero()};
    upright.information.diagonal().tail<3>().setConstant(std::pow(to_radians(Placing::kTilt_deg), -2));
    extended.add_edge(upright);
  }
  std::vector<PoseEdge> edges;
  std::vector<bool> near;
  std::vector<std::size_t> of_part(parts, 0);
  for (const EarthFix& fix : fixes) {
    const auto part = static_cast<std::size_t>(part_of_node[fix.node]);
    if (!rough[part]) continue;
    PoseEdge edge{earth[part], fix.node, Pose::Identity(), Matrix6::Zero(), true};
    edge.T_from_to.translation() = fix.position_m;
    edge.information.diagonal().head<3>() = fix.deviation_m.cwiseMax(Placing::kLeast_m).cwiseAbs2().cwiseInverse();
    edges.push_back(edge);
    near.push_back(rough[part]->is_near[of_part[part]++]);
  }
  const auto settled = settle_best(extended, edges, near);
  if (!settled) return settled.error();
  const std::vector<Pose>& nodes = settled->graph.nodes();
  std::size_t node = 0;
  for (const Pose& T : std::span(nodes).first(graph.nodes().size())) graph.move_node(node++, T);
  for (std::size_t part = 0; part < parts; ++part)
    if (rough[part]) T_earth_world[part] = nodes[earth[part]].inverse();
  return T_earth_world;
}

}  // namespace revisit
