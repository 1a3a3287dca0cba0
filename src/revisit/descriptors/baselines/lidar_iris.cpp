// SPDX-License-Identifier: Apache-2.0
// Wang, Sun, Xu, Sarma, Yang and Kong, "LiDAR Iris for Loop-Closure Detection", IROS 2020: an image of 80 ranges of 1 m
// by 360 degrees, each cell a number whose eight bits say which heights it holds; its rows are filtered by log-Gabor
// wavelets of four lengths (18 degrees and up, each 1.6 times the one before, sigma / f 0.75), and the signs of the
// responses' real and imaginary parts are the binary feature. Two scans are turned onto each other by the Fourier
// transform and compared by Hamming distance where both responses are not nothing. Heights are metres from half a metre
// below the ground here (in the authors' program: elevations of one sensor).
#include <algorithm>
#include <cmath>
#include <complex>
#include <vector>

#include <unsupported/Eigen/FFT>

#include <revisit/bits/occupancy_bits.h>
#include <revisit/core/pose.hpp>
#include <revisit/descriptors/internal/baselines.hpp>
#include <revisit/descriptors/internal/circular_correlation.hpp>

namespace revisit::descriptors_internal {
namespace lidar_iris {
namespace {

constexpr int kRanges = 80, kAzimuths = 360, kHeights = 8, kScales = 4, kFrequencies = kAzimuths / 2 + 1;
constexpr double kShortestWave = 18.0, kWaveRatio = 1.6, kSigmaOverF = 0.75;
constexpr float kLeastResponse = 1e-4f, kBelowGround_m = 0.5f;
constexpr int kReach = 2;  // columns beside the turn of the Fourier transform that are tried
constexpr std::size_t kWordsOfColumn = std::size_t{kRanges} * kScales * 2 / 64, kWords = kWordsOfColumn * kAzimuths;

using Complex = std::complex<float>;

Eigen::FFT<float>& fourier() {
  thread_local Eigen::FFT<float> transform;  // keeps its plans
  return transform;
}

Eigen::MatrixXf image_of(std::span<const Point> points, float ground_z_m) {
  Eigen::Matrix<std::uint8_t, kRanges, Eigen::Dynamic> heights(kRanges, kAzimuths);
  heights.setZero();
  for (const Point& p : points) {
    const float range_m = std::hypot(p.x, p.y);
    if (!(range_m < kRanges) || !std::isfinite(p.z)) continue;
    const auto azimuth = static_cast<int>((std::atan2(p.y, p.x) / static_cast<float>(kPi) + 1.f) * kAzimuths / 2);
    const float height = std::clamp(std::floor(p.z - ground_z_m + kBelowGround_m), 0.f, kHeights - 1.f);
    heights(static_cast<int>(range_m), std::min(azimuth, kAzimuths - 1)) |=
        static_cast<std::uint8_t>(1u << static_cast<unsigned>(height));
  }
  return heights.cast<float>();
}

// What each wavelet lets through, a frequency a row.
Eigen::MatrixXf make_wavelets() {
  Eigen::MatrixXf gain = Eigen::MatrixXf::Zero(kFrequencies, kScales);
  for (int scale = 0; scale < kScales; ++scale) {
    const double middle = 1.0 / (kShortestWave * std::pow(kWaveRatio, scale));
    for (int k = 1; k < kFrequencies; ++k) {
      const double octaves = std::log(static_cast<double>(k) / kAzimuths / middle) / std::log(kSigmaOverF);
      gain(k, scale) = static_cast<float>(std::exp(-octaves * octaves / 2.0));
    }
  }
  return gain;
}

class LidarIris final : public TurnMethod {
 public:
  LidarIris() : TurnMethod(kAzimuths) {}
  std::string name() const override { return "lidar-iris"; }
  std::string source() const override { return "Wang, Sun et al., IROS 2020"; }

  // `values`: the spectra of the rows; `bits`: the signs, a column after the other, then the masks.
  Signature describe(std::span<const Point> points, double ground_z_m) const override {
    const Eigen::MatrixXf image = image_of(points, static_cast<float>(ground_z_m));
    Signature signature{spectra_of_rows(image), std::vector<std::uint64_t>(2 * kWords)};
    std::vector<Complex> passed(kAzimuths), response;
    for (Eigen::Index range = 0; range < kRanges; ++range)
      for (Eigen::Index scale = 0; scale < kScales; ++scale) {
        for (Eigen::Index k = 0; k < kFrequencies; ++k)  // the others are let through by none
          passed[static_cast<std::size_t>(k)] =
              Complex(signature.values(range, k), signature.values(range, kFrequencies + k)) * wavelets_(k, scale);
        fourier().inv(response, passed);
        set_bits(signature.bits, response, static_cast<std::size_t>((range * kScales + scale) * 2));
      }
    return signature;
  }

 private:
  Turn best_turn(const Signature& query, const Signature& place) const override {
    Eigen::Index turn = 0;  // column j of the query lies on column j + turn of the place
    circular_correlation(query.values, place.values, kAzimuths).maxCoeff(&turn);
    Turn best;
    for (int offset = -kReach; offset <= kReach; ++offset) {
      const int columns = (static_cast<int>(turn) + offset + kAzimuths) % kAzimuths;
      const double share = alike(query.bits, place.bits, columns);
      if (share > best.similarity) best = {share, columns};
    }
    return best;
  }

  // The bit of the real part is `first` of its column, that of the imaginary part the next.
  static void set_bits(std::vector<std::uint64_t>& bits, const std::vector<Complex>& response, std::size_t first) {
    for (std::size_t column = 0; column < kAzimuths; ++column) {
      if (std::abs(response[column]) < kLeastResponse) continue;
      const std::uint64_t signs = (response[column].real() > 0.f ? 1u : 0u) | (response[column].imag() > 0.f ? 2u : 0u);
      const std::size_t word = column * kWordsOfColumn + first / 64;
      bits[word] |= signs << (first % 64);
      bits[kWords + word] |= std::uint64_t{3} << (first % 64);
    }
  }

  // The share of the bits that both have which agree. A sign is set only where the mask is.
  static double alike(const std::vector<std::uint64_t>& query, const std::vector<std::uint64_t>& place, int turn) {
    const std::size_t turned = static_cast<std::size_t>(turn) * kWordsOfColumn;
    const auto common = [&](const std::uint64_t* q, const std::uint64_t* p) {
      return revisit_bits_common(q, p + turned, kWords - turned) + revisit_bits_common(q + kWords - turned, p, turned);
    };
    const std::uint64_t *q = query.data(), *p = place.data(), *q_mask = q + kWords, *p_mask = p + kWords;
    const std::uint64_t both = common(q_mask, p_mask);
    const std::uint64_t different = common(q, p_mask) + common(q_mask, p) - 2 * common(q, p);
    return both == 0 ? 0.0 : 1.0 - static_cast<double>(different) / static_cast<double>(both);
  }

  const Eigen::MatrixXf wavelets_ = make_wavelets();
};

}  // namespace
}  // namespace lidar_iris

std::unique_ptr<Baseline> make_lidar_iris() { return std::make_unique<lidar_iris::LidarIris>(); }

}  // namespace revisit::descriptors_internal
