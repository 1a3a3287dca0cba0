// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

namespace revisit::descriptors_internal {

/// Fourier transforms of the rows: real parts, then imaginary parts, of the frequencies from 0 to half the columns.
Eigen::MatrixXf spectra_of_rows(const Eigen::MatrixXf& rows);

/// c[s]: the sum over rows r and columns j of query(r, j) * place(r, j + s), j + s counted in circles of `columns`;
/// both as spectra_of_rows() gives them.
Eigen::VectorXf circular_correlation(const Eigen::MatrixXf& query, const Eigen::MatrixXf& place, Eigen::Index columns);

}  // namespace revisit::descriptors_internal
