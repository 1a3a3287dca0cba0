// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <revisit/core/loop.hpp>
#include <revisit/descriptors/intensity_scan_context.hpp>

namespace revisit {

/// Phi_g (eqs. 7-8) with the shift that reaches it. READING: the printed XOR / |I| measures difference; similarity is
/// one minus it.
struct GeometryMatch {
  double score = 0.0;     ///< 1 - min over k of popcount(I_k^q xor I^c) / (N_r N_s), in [0, 1]
  int shift_columns = 0;  ///< k: column j of the query lies on column j + k of the candidate
};
/// The score for a number of differing cells. Images with levels of height are mostly empty, and cells that are empty
/// in both say little: there it is the overlap (Dice), 1 - differing / (occupied cells of the one + of the other).
double geometry_score(const DescriptorView& query, const DescriptorView& candidate, std::uint32_t differing_cells);
GeometryMatch match_geometry(const DescriptorView& query, const DescriptorView& candidate);

/// Phi_i (eqs. 9-10): mean over columns of the cosine between the query shifted by k and the candidate. A column that
/// is empty in both does not count; empty in one of them counts as 0. In [0, 1]; 0 where no column counts.
double match_intensity(const DescriptorView& query, const DescriptorView& candidate, int shift_columns);

/// The heading of the query in the candidate's frame that a shift of k columns means, radians in [-pi, pi).
double yaw_of_shift(int shift_columns, int sectors);

/// All of the above for one pair: everything of a LoopCandidate but the frame. Grids must be the same; otherwise
/// std::invalid_argument.
LoopCandidate match_descriptors(const DescriptorView& query, const DescriptorView& candidate);

}  // namespace revisit
