// SPDX-License-Identifier: Apache-2.0
#include <revisit/descriptors/internal/circular_correlation.hpp>

#include <complex>
#include <vector>

#include <unsupported/Eigen/FFT>

namespace revisit::descriptors_internal {
namespace {

using Complex = std::complex<float>;

Eigen::FFT<float>& fourier() {
  thread_local Eigen::FFT<float> transform;  // keeps its plans
  return transform;
}

}  // namespace

Eigen::MatrixXf spectra_of_rows(const Eigen::MatrixXf& rows) {
  const Eigen::Index frequencies = rows.cols() / 2 + 1;
  Eigen::MatrixXf spectra(rows.rows(), 2 * frequencies);
  std::vector<float> row(static_cast<std::size_t>(rows.cols()));
  std::vector<Complex> spectrum;
  for (Eigen::Index r = 0; r < rows.rows(); ++r) {
    Eigen::Map<Eigen::RowVectorXf>(row.data(), rows.cols()) = rows.row(r);
    fourier().fwd(spectrum, row);
    for (Eigen::Index k = 0; k < frequencies; ++k) {
      spectra(r, k) = spectrum[static_cast<std::size_t>(k)].real();
      spectra(r, frequencies + k) = spectrum[static_cast<std::size_t>(k)].imag();
    }
  }
  return spectra;
}

Eigen::VectorXf circular_correlation(const Eigen::MatrixXf& query, const Eigen::MatrixXf& place, Eigen::Index columns) {
  const Eigen::Index frequencies = query.cols() / 2;
  const auto real = [&](const Eigen::MatrixXf& m) { return m.leftCols(frequencies).array(); };
  const auto imaginary = [&](const Eigen::MatrixXf& m) { return m.rightCols(frequencies).array(); };
  const Eigen::RowVectorXf re = (real(query) * real(place) + imaginary(query) * imaginary(place)).colwise().sum();
  const Eigen::RowVectorXf im = (real(query) * imaginary(place) - imaginary(query) * real(place)).colwise().sum();
  std::vector<Complex> product(static_cast<std::size_t>(columns)), correlation;
  for (Eigen::Index k = 0; k < columns; ++k) {
    const Eigen::Index folded = k < frequencies ? k : columns - k;
    product[static_cast<std::size_t>(k)] = {re[folded], k < frequencies ? im[folded] : -im[folded]};
  }
  fourier().inv(correlation, product);
  Eigen::VectorXf result(columns);
  for (Eigen::Index s = 0; s < columns; ++s) result[s] = correlation[static_cast<std::size_t>(s)].real();
  return result;
}

}  // namespace revisit::descriptors_internal
