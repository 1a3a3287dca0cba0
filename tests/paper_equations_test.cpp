// SPDX-License-Identifier: Apache-2.0
// The paper's equations, written once more straight from the page: slow, in double, with no sharing of code. Equation
// numbers are those of the ICRA paper; where docs/method.md departs from the print, the line says so.
#include <algorithm>
#include <cmath>
#include <map>
#include <vector>

#include <revisit/descriptors/similarity.hpp>
#include <revisit/io/recording.hpp>
#include <revisit/pipeline/prepare.hpp>
#include <revisit/pipeline/recording_scale.hpp>
#include <revisit/verification/temporal.hpp>

#include "random_points.hpp"
#include "shared_data.hpp"

namespace revisit {
namespace {

using testing_support::shared_data;

constexpr double kTurn = 2.0 * 3.14159265358979323846;

struct PageDescriptor {
  int Nr, Ns;
  std::vector<std::vector<double>> omega;   // [i][j], eq. 5; 8-bit steps as decided
  std::vector<std::vector<bool>> occupied;  // decided: a hit is a hit, whatever its intensity (eq. 6)
};

PageDescriptor describe_by_the_page(const std::vector<Point>& P, int Nr, int Ns, double Lmax) {
  PageDescriptor d{Nr, Ns,
                   std::vector(static_cast<std::size_t>(Nr), std::vector<double>(static_cast<std::size_t>(Ns), 0.0)),
                   std::vector(static_cast<std::size_t>(Nr), std::vector<bool>(static_cast<std::size_t>(Ns), false))};
  for (const Point& p : P) {
    const double rho = std::sqrt(static_cast<double>(p.x) * p.x + static_cast<double>(p.y) * p.y);  // eq. 2
    double theta = std::atan2(static_cast<double>(p.y), static_cast<double>(p.x));
    if (theta >= kTurn / 2.0) theta -= kTurn;  // eq. 3 is half open
    for (int i = 0; i < Nr; ++i) {
      if (!(i * Lmax / Nr <= rho && rho < (i + 1) * Lmax / Nr)) continue;  // eq. 3
      for (int j = 0; j < Ns; ++j) {
        if (!(j * kTurn / Ns - kTurn / 2.0 <= theta && theta < (j + 1) * kTurn / Ns - kTurn / 2.0)) continue;
        const double eta = quantise_intensity(p.intensity) / 255.0;
        auto& cell = d.omega[static_cast<std::size_t>(i)][static_cast<std::size_t>(j)];
        cell = std::max(cell, eta);  // eq. 4
        d.occupied[static_cast<std::size_t>(i)][static_cast<std::size_t>(j)] = true;
      }
    }
  }
  return d;
}

// Decided: similarity is one minus the share of differing cells. k: query column j lies on candidate column j + k.
std::pair<double, int> geometry_by_the_page(const PageDescriptor& q, const PageDescriptor& c) {
  double best = -1.0;
  int best_k = 0;
  for (int k = 0; k < q.Ns; ++k) {
    int differing = 0;
    for (int i = 0; i < q.Nr; ++i)
      for (int j = 0; j < q.Ns; ++j)
        differing += q.occupied[static_cast<std::size_t>(i)][static_cast<std::size_t>(j)] !=
                     c.occupied[static_cast<std::size_t>(i)][static_cast<std::size_t>((j + k) % q.Ns)];
    const double phi = 1.0 - static_cast<double>(differing) / (q.Nr * q.Ns);  // eq. 7
    if (phi > best) best = phi, best_k = k;                                   // eq. 8
  }
  return {best, best_k};
}

double intensity_by_the_page(const PageDescriptor& q, const PageDescriptor& c, int k) {
  double sum = 0.0;
  int columns = 0;
  for (int j = 0; j < q.Ns; ++j) {
    double dot = 0.0, nq = 0.0, nc = 0.0;
    for (int i = 0; i < q.Nr; ++i) {
      const double a = q.omega[static_cast<std::size_t>(i)][static_cast<std::size_t>(j)];
      const double b = c.omega[static_cast<std::size_t>(i)][static_cast<std::size_t>((j + k) % q.Ns)];
      dot += a * b;
      nq += a * a;
      nc += b * b;
    }
    if (nq == 0.0 && nc == 0.0) continue;  // decided: does not count
    ++columns;
    if (nq > 0.0 && nc > 0.0) sum += dot / (std::sqrt(nq) * std::sqrt(nc));  // eq. 9
  }
  return columns == 0 ? 0.0 : sum / columns;
}

void expect_equal(const std::vector<Point>& query, const std::vector<Point>& candidate, int Nr, int Ns, double Lmax) {
  DescriptorOptions options;
  options.rings = Nr;
  options.sectors = Ns;
  options.levels = 0;
  options.max_range_m = Lmax;
  const IntensityScanContext fast_q = describe(query, options), fast_c = describe(candidate, options);
  const PageDescriptor q = describe_by_the_page(query, Nr, Ns, Lmax), c = describe_by_the_page(candidate, Nr, Ns, Lmax);
  for (int i = 0; i < Nr; ++i)
    for (int j = 0; j < Ns; ++j) {
      ASSERT_EQ(fast_q.occupied(i, j), q.occupied[static_cast<std::size_t>(i)][static_cast<std::size_t>(j)])
          << i << " " << j;
      ASSERT_EQ(fast_q.intensity[static_cast<std::size_t>(j * Nr + i)],
                std::lround(255.0 * q.omega[static_cast<std::size_t>(i)][static_cast<std::size_t>(j)]))
          << i << " " << j;
    }
  const LoopCandidate fast = match_descriptors(fast_q, fast_c);
  const auto [phi_g, k] = geometry_by_the_page(q, c);
  EXPECT_DOUBLE_EQ(fast.geometry_score, phi_g);
  EXPECT_EQ(fast.shift_columns, k);
  EXPECT_NEAR(fast.intensity_score, intensity_by_the_page(q, c, k), 1e-12);
}

using testing_support::random_points;

TEST(PaperEquations, HoldOnRandomScans) {
  for (unsigned seed = 0; seed < 6; ++seed) {
    const auto query = random_points(400 + 100 * seed, seed), candidate = random_points(600, 100 + seed);
    expect_equal(query, candidate, 60, 20, 50.0);
    expect_equal(query, candidate, 20, 60, 50.0);
    expect_equal(query, candidate, 7, 13, 33.0);
  }
  expect_equal({}, random_points(100, 1), 60, 20, 50.0);
}

TEST(PaperEquations, HoldOnRealScans) {
  REVISIT_NEEDS_SHARED_DATA();
  const auto recording = open_recording(shared_data() / "kitti00_mini");
  ASSERT_TRUE(recording);
  const Parameters parameters;
  const auto scale = intensity_scale_of(**recording, parameters.intensity);
  std::vector<std::vector<Point>> scans;
  for (const std::size_t index : {18u, 26u}) {  // frames 52 and 4501
    auto scan = (*recording)->read(index);
    ASSERT_TRUE(scan);
    normalise_intensity(*scan, *scale);
    std::vector<Point> thinned;  // the page's loops visit every cell for every point
    for (std::size_t i = 0; i < scan->points.size(); i += 20) thinned.push_back(scan->points[i]);
    scans.push_back(thinned);
  }
  expect_equal(scans[1], scans[0], 60, 20, 50.0);
  expect_equal(scans[1], scans[0], 20, 60, 50.0);
}

TEST(PaperEquations, TemporalConsistencyIsThePrintedMean) {
  std::map<FrameId, IntensityScanContext> past;
  std::map<FrameId, PageDescriptor> page;
  for (int frame = 0; frame < 30; ++frame) {
    const auto points = random_points(400, static_cast<unsigned>(frame % 11));
    past[FrameId{frame}] = describe(points, preset("paper")->descriptor);
    page[FrameId{frame}] = describe_by_the_page(points, 60, 20, 50.0);
  }
  const DescriptorLookup lookup = [&](FrameId frame) {
    return past.contains(frame) ? std::optional<DescriptorView>(past.at(frame)) : std::nullopt;
  };
  const int m = 25, n = 13, N = kTemporalPairs;
  for (const int direction : {1, -1}) {  // decided: a reverse visit runs the candidate's index the other way
    double sum = 0.0;
    for (int k = 1; k <= N; ++k) {  // eq. 11
      const auto &q = page.at(FrameId{m - k}), &c = page.at(FrameId{n - direction * k});
      const auto [phi_g, shift] = geometry_by_the_page(q, c);
      sum += phi_g + intensity_by_the_page(q, c, shift);
    }
    const TemporalEvidence evidence = check_temporal(FrameId{m}, FrameId{n}, lookup, lookup, TemporalOptions{});
    EXPECT_NEAR(direction == 1 ? evidence.forward_score : evidence.reverse_score, sum / N, 1e-12);
  }
}

}  // namespace
}  // namespace revisit
