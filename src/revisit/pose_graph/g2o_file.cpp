// SPDX-License-Identifier: Apache-2.0
#include <cstdio>
#include <fstream>
#include <iomanip>
#include <map>
#include <sstream>

#include <revisit/pose_graph/pose_graph.hpp>

namespace revisit {
namespace {

// g2o takes the vector of a quaternion, half a rotation vector, for the rotational error.
Matrix6 with_rotations_scaled(Matrix6 information, double by) {
  information.bottomRows<3>() *= by;
  information.rightCols<3>() *= by;
  return information;
}

std::ostream& operator<<(std::ostream& stream, const Pose& T) {
  const Eigen::Quaterniond q(T.rotation());
  return stream << T.translation().x() << ' ' << T.translation().y() << ' ' << T.translation().z() << ' ' << q.x()
                << ' ' << q.y() << ' ' << q.z() << ' ' << q.w();
}

bool read(std::istream& stream, Pose& T) {
  Eigen::Matrix<double, 7, 1> values;  // x y z, quaternion x y z w
  for (double& each : values)
    if (!(stream >> each)) return false;
  const Eigen::Quaterniond q(values.tail<4>());
  if (!(std::abs(q.norm() - 1.0) < 0.01)) return false;
  T = Pose::Identity();
  T.linear() = q.normalized().toRotationMatrix();
  T.translation() = values.head<3>();
  return T.matrix().allFinite();
}

}  // namespace

Status PoseGraph::write_g2o(const std::filesystem::path& file) const {
  std::ofstream stream(file);
  stream << std::setprecision(12);
  for (std::size_t i = 0; i < nodes_.size(); ++i) stream << "VERTEX_SE3:QUAT " << i << ' ' << nodes_[i] << '\n';
  if (!nodes_.empty()) stream << "FIX 0\n";
  for (const PoseEdge& edge : edges_) {
    stream << "EDGE_SE3:QUAT " << edge.from << ' ' << edge.to << ' ' << edge.T_from_to;
    const Matrix6 information = with_rotations_scaled(edge.information, 2.0);
    for (Eigen::Index row = 0; row < 6; ++row)
      for (Eigen::Index column = row; column < 6; ++column) stream << ' ' << information(row, column);
    stream << '\n';
  }
  stream.flush();
  if (!stream) return Error{file.string() + ": cannot be written"};
  return ok();
}

Result<PoseGraph> PoseGraph::read_g2o(const std::filesystem::path& file) {
  std::ifstream stream(file);
  if (!stream) return Error{file.string() + ": cannot be opened"};
  PoseGraph graph;
  std::map<long long, std::size_t> node_of;
  std::string line;
  for (std::size_t number = 1; std::getline(stream, line); ++number) {
    std::istringstream row(line);
    const auto refuse = [&](const std::string& what) {
      return Error{file.string() + ":" + std::to_string(number) + ": " + what};
    };
    std::string kind;
    row >> kind;
    long long a = 0, b = 0;
    Pose T = Pose::Identity();
    if (kind == "VERTEX_SE3:QUAT") {
      if (!(row >> a) || !read(row, T)) return refuse("is no vertex: id x y z qx qy qz qw with a unit quaternion");
      if (!node_of.emplace(a, graph.nodes_.size()).second)
        return refuse("vertex " + std::to_string(a) + " comes twice");
      graph.add_node(T);
    } else if (kind == "EDGE_SE3:QUAT") {
      PoseEdge edge;
      if (!(row >> a >> b) || !read(row, edge.T_from_to))
        return refuse("is no edge: id id x y z qx qy qz qw and 21 numbers of information");
      for (Eigen::Index i = 0; i < 6; ++i)
        for (Eigen::Index j = i; j < 6; ++j) {
          if (!(row >> edge.information(i, j))) return refuse("has fewer than 21 numbers of information");
          edge.information(j, i) = edge.information(i, j);
        }
      const auto from = node_of.find(a), to = node_of.find(b);
      if (from == node_of.end() || to == node_of.end() || a == b)
        return refuse("leads from vertex " + std::to_string(a) + " to " + std::to_string(b) +
                      "; allowed: two different ones named above");
      if (!edge.information.allFinite()) return refuse("has information that is not finite");
      edge.information = with_rotations_scaled(edge.information, 0.5);
      edge.from = from->second;
      edge.to = to->second;
      edge.is_loop = edge.to != edge.from + 1;
      graph.edges_.push_back(edge);
    } else if (!kind.empty() && kind != "FIX" && kind[0] != '#') {
      return refuse("'" + kind + "' is not known; allowed: VERTEX_SE3:QUAT, EDGE_SE3:QUAT, FIX");
    }
  }
  if (graph.nodes_.empty()) return Error{file.string() + ": holds no vertex"};
  return graph;
}

}  // namespace revisit
