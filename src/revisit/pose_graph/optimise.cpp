// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include <ceres/ceres.h>
#include <ceres/rotation.h>
#include <Eigen/Cholesky>

#include <revisit/pose_graph/internal/gravity_terms.hpp>
#include <revisit/pose_graph/pose_graph.hpp>

namespace revisit {
namespace {

using pose_graph_internal::GravityTerms;

// Of right readings of gravity, of which there are many, the squared error stays below this in all but one of 100,000
// cases (chi-square, 2 degrees of freedom).
constexpr double kTruncationOfUp = 23.03;
constexpr double kSharpen = 2.0;
constexpr int kMostRounds = 60, kIterationsARound = 5, kIterationsAtLast = 20;

// A node as Ceres moves it.
struct Block {
  Eigen::Vector3d t;
  Eigen::Quaterniond q;
};

// The error of an edge, whitened by the square root of its information and weight.
class EdgeError {
 public:
  EdgeError(const PoseEdge& edge, double weight) : t_(edge.T_from_to.translation()), q_(edge.T_from_to.rotation()) {
    // Directions that an edge says nothing about have no information at all: LDLT bears that.
    const Eigen::LDLT<Matrix6> ldlt(edge.information);
    const Vector6 root = ldlt.vectorD().cwiseMax(0.0).cwiseSqrt();
    const Matrix6 upper = ldlt.matrixU();
    root_ = std::sqrt(weight) * (root.asDiagonal() * upper * ldlt.transpositionsP());
  }

  template <typename T>
  bool operator()(const T* t_from, const T* q_from, const T* t_to, const T* q_to, T* residual) const {
    using Vector = Eigen::Matrix<T, 3, 1>;
    const Eigen::Map<const Vector> ta(t_from), tb(t_to);
    const Eigen::Map<const Eigen::Quaternion<T>> qa(q_from), qb(q_to);
    const Eigen::Quaternion<T> inverse = qa.conjugate();
    const Eigen::Quaternion<T> turn = q_.conjugate().cast<T>() * (inverse * qb);
    Eigen::Map<Eigen::Matrix<T, 6, 1>> r(residual);
    r.template head<3>() = q_.conjugate().cast<T>() * (inverse * (tb - ta) - t_.cast<T>());
    // The rotation vector, by the quaternion's short way round.
    const T q[4] = {turn.w(), turn.x(), turn.y(), turn.z()};
    ceres::QuaternionToAngleAxis(q, residual + 3);
    r = (root_.cast<T>() * r).eval();
    return true;
  }

 private:
  Eigen::Vector3d t_;
  Eigen::Quaterniond q_;
  Matrix6 root_;
};

struct Solved {
  bool is_usable = false;
  double cost_before = 0.0, cost_after = 0.0;
  int iterations = 0;
  std::string message;
};

Solved solve(std::vector<Block>& blocks, const std::vector<PoseEdge>& edges, GravityTerms& gravity, int most_iterations,
             double settled) {
  ceres::Problem problem;
  auto* const manifold = new ceres::EigenQuaternionManifold;  // NOLINT(cppcoreguidelines-owning-memory): the problem's
  for (Block& block : blocks) {
    problem.AddParameterBlock(block.t.data(), 3);
    problem.AddParameterBlock(block.q.coeffs().data(), 4, manifold);
  }
  problem.SetParameterBlockConstant(blocks[0].t.data());
  problem.SetParameterBlockConstant(blocks[0].q.coeffs().data());
  for (const PoseEdge& edge : edges) {
    if (edge.weight <= 0.0) continue;
    // NOLINTNEXTLINE(cppcoreguidelines-owning-memory): the problem's
    auto* const cost = new ceres::AutoDiffCostFunction<EdgeError, 6, 3, 4, 3, 4>(new EdgeError(edge, edge.weight));
    problem.AddResidualBlock(cost, nullptr, blocks[edge.from].t.data(), blocks[edge.from].q.coeffs().data(),
                             blocks[edge.to].t.data(), blocks[edge.to].q.coeffs().data());
  }
  gravity.add_to(problem, [&](std::size_t node) { return blocks[node].q.coeffs().data(); });
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
  options.logging_type = ceres::SILENT;
  options.max_num_iterations = most_iterations;
  options.function_tolerance = settled;
  options.num_threads = 1;  // with more, sums and so poses would differ in their last bits from run to run
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  return {summary.IsSolutionUsable(), summary.initial_cost, summary.final_cost,
          static_cast<int>(summary.iterations.size()), summary.message};
}

// What a measurement counts at this convexity, by its squared error as a share of the truncation.
double weight_at(double error, double mu) { return std::clamp(std::sqrt(mu * (mu + 1.0) / error) - mu, 0.0, 1.0); }

}  // namespace

Result<PoseGraph::Report> PoseGraph::optimise(double settled) {
  Report report;
  if (nodes_.size() < 2) return report;
  std::vector<Block> blocks(nodes_.size());
  const auto start_over = [&] {
    std::transform(nodes_.begin(), nodes_.end(), blocks.begin(), [](const Pose& T) {
      return Block{T.translation(), Eigen::Quaterniond(T.rotation()).normalized()};
    });
  };
  start_over();
  const auto pose = [&](std::size_t i) {
    Pose T = Pose::Identity();
    T.linear() = blocks[i].q.normalized().toRotationMatrix();
    T.translation() = blocks[i].t;
    return T;
  };
  GravityTerms gravity(ups_, nodes_);
  // Of what may be wrong, the squared error as a share of the truncation. Readings of gravity that contradict one
  // another are no reason to doubt loops.
  bool loops_are_doubted = true;
  const auto for_each_loop = [&](const auto& visit) {
    for (PoseEdge& edge : edges_)
      if (edge.is_loop) visit(edge.weight, squared_error(edge, pose(edge.from), pose(edge.to)) / kTruncation);
  };
  const auto for_each_doubtful = [&](const auto& visit) {
    if (loops_are_doubted) for_each_loop(visit);
    for (UpReading& up : ups_) visit(up.weight, gravity.squared_error(up, blocks[up.node].q) / kTruncationOfUp);
  };
  const auto worst_of = [&](bool believed_only) {
    double worst = 0.0;
    for_each_doubtful([&](double weight, double error) {
      if (!believed_only || weight > 0.0) worst = std::max(worst, error);
    });
    return worst;
  };
  const auto solve_all = [&](int most_iterations) -> Status {
    const Solved solved = solve(blocks, edges_, gravity, most_iterations, settled);
    if (!solved.is_usable) return Error{"pose graph of " + std::to_string(nodes_.size()) + " nodes: " + solved.message};
    if (report.iterations == 0) report.cost_before = solved.cost_before;
    report.iterations += solved.iterations;
    report.cost_after = solved.cost_after;
    return ok();
  };
  // What was refused stays so while the others agree.
  for_each_doubtful([](double& weight, double) { weight = weight < 0.5 ? 0.0 : 1.0; });
  if (const Status status = solve_all(kIterationsAtLast); !status) return status.error();

  if (worst_of(true) > 1.0) {
    // Some contradict: all are tried again, from the poses that these did not bend, and those that cannot be satisfied
    // fade.
    loops_are_doubted = false;
    for_each_loop([&](double weight, double error) { loops_are_doubted |= weight > 0.0 && error > 1.0; });
    start_over();
    gravity = GravityTerms(ups_, nodes_);
    double mu = 1.0 / std::max(1.0, 2.0 * worst_of(false) - 1.0);
    for (int round = 0; round < kMostRounds; ++round, mu *= kSharpen) {
      bool all_decided = true;
      for_each_doubtful([&](double& weight, double error) {
        weight = weight_at(error, mu);
        all_decided = all_decided && (weight == 0.0 || weight == 1.0);
      });
      if (all_decided) break;
      if (const Status status = solve_all(kIterationsARound); !status) return status.error();
    }
    for_each_doubtful([](double& weight, double) { weight = weight < 0.5 ? 0.0 : 1.0; });
    if (const Status status = solve_all(kIterationsAtLast); !status) return status.error();
  }
  std::size_t i = 0;
  for (Pose& node : nodes_) node = pose(i++);
  const auto is_refused = [](const auto& each) { return each.weight < 0.5; };
  report.loops_refused = static_cast<std::size_t>(std::count_if(edges_.begin(), edges_.end(), is_refused));
  report.ups_refused = static_cast<std::size_t>(std::count_if(ups_.begin(), ups_.end(), is_refused));
  return report;
}

}  // namespace revisit
