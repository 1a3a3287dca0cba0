// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>

#include <revisit/core/pose.hpp>
#include <revisit/registration/surface.hpp>

namespace revisit {

struct IcpResult {
  Pose T_target_source = Pose::Identity();
  /// Settled, or going to and fro by less than a centimetre 20 m away as neighbours change.
  bool converged = false;
  int iterations = 0;
  double last_step_m = 0.0;  ///< how far the last step moved points 20 m away
  /// Share of the source's points that lie on a patch, each counted by its weight in the last step.
  double matched = 0.0;
  /// The same, each point weighed by the squared part of its patch's normal across the source's z axis, [0, 1]: rings
  /// of beams on the ground match wherever the sensor went, and count for nothing here.
  double matched_sideways = 0.0;
  double met = 0.0;  ///< share of them with any patch within reach, however far from its plane
  /// Inverse covariance of xi where the true pose is T_target_source * small_motion(xi): metres, then radians, in the
  /// source's frame. Small along what the scans do not fix. Zero where too few points met.
  Matrix6 information = Matrix6::Zero();
  /// Of the position alone, whatever the rotation, where all points share the errors of their surfaces: what counts is
  /// where these face, not how many points lie on them. In the source's frame. To be weighed against a prior.
  Eigen::Matrix3d position_information = Eigen::Matrix3d::Zero();
};

/// Where a source is thought to be before it is compared.
struct PosePrior {
  Pose T_target_source = Pose::Identity();
  /// Inverse covariances along the target's axes, 1/m2 and 1/rad2; zero where nothing is known.
  Eigen::Matrix3d position_information = Eigen::Matrix3d::Zero(), rotation_information = Eigen::Matrix3d::Zero();
};

struct IcpOptions {
  double coarse_m = 4.0, fine_m = 0.5;  ///< widths of the kernel, first and last
  double least_reach_m = 0.0;  ///< points look for a patch within the kernel's width, or this where it is larger
  double settled_m = 2e-4;     ///< done where a step at the last width moves points 20 m away less than this
  int most_iterations = 60;
  /// Points of the source, about, that give the steps until it hardly moves; then all of them do. 0: all throughout.
  std::size_t settles_with = 0;
  double least_matched = 0.0;  ///< given up where, at the last width, a smaller share matches: another place
  /// Directions in which the surfaces' normals have on average a smaller square share than this stay as guessed: along
  /// a bare corridor normals are noise. Turns count as the motion of a point 10 m away.
  double least_seen = 0.0;
  /// Point-to-plane, of a source that was seen by rings of beams about its z axis: patches that face along that axis,
  /// to within so many degrees, fix nothing across it. 0: all fix what they face.
  double level_deg = 0.0;
  /// Point-to-plane, where above 0: once settled, height, roll and pitch along the source's axes settle again with each
  /// pair weighed by the noise of points (this, a standard deviation) and the variance of its patch. Only they: along
  /// the ground a lorry beside is as certain as any wall.
  double noise_m = 0.0;
  /// Weighed against what the surfaces say, as points count in IcpResult::position_information.
  std::optional<PosePrior> prior = {};
  /// Normals of the source, one a point: plane-to-plane (generalised ICP, Segal et al., RSS 2009, with the covariances
  /// of planes); empty: point-to-plane.
  std::span<const Eigen::Vector3f> source_normals = {};
};

/// ICP with a Geman-McClure kernel whose width shrinks: from a guess a few metres and some ten degrees off to the
/// nearest optimum. `source` in metres. Deterministic, whatever the number of threads.
IcpResult align_icp(const Surface& target, std::span<const Eigen::Vector3f> source, const Pose& T_guess_target_source,
                    const IcpOptions& options = {});

/// Standard deviation of the position along the direction in which it is largest, metres; infinite where nothing fixes
/// one of them. `information` is an inverse covariance as in IcpResult.
double largest_stddev_m(const Matrix6& information);

}  // namespace revisit
