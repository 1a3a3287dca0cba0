// SPDX-License-Identifier: Apache-2.0
// How often two scans are registered without a guess (docs/accuracy.md): pairs of one recording, 2 to 10 m apart, the
// second turned to any heading; from different visits where the recording has them.
// Or pairs that show different places, FARTHEST_M apart and more, of which none may be given.
// usage: register_pairs RECORDING [PAIRS [FARTHEST_M [SEED [any|visits|elsewhere]]]]
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include <revisit/config/parameter_file.hpp>
#include <revisit/core/pose.hpp>
#include <revisit/core/refusal_text.hpp>
#include <revisit/io/recording.hpp>
#include <revisit/pipeline/register_scans.hpp>
#include <revisit/simulation/simulated_recording.hpp>

namespace {

using namespace revisit;

struct Pair {
  std::size_t target, source;
};

std::unique_ptr<Recording> open(const std::string& input) {
  const auto check = [](auto result) {
    if (result) return *std::move(result);
    std::fprintf(stderr, "%s\n", result.error().message.c_str());
    std::exit(1);
  };
  if (!input.ends_with(".toml")) return check(open_recording(input));
  return check(simulate(check(read_parameters(input)).simulation));
}

// Pairs of scans `least_m` to `most_m` apart, drawn at random; another visit is 300 scans or more before.
std::vector<Pair> draw_pairs(const Recording& recording, std::size_t wanted, double least_m, double most_m,
                             unsigned seed, bool visits) {
  constexpr std::size_t kOtherVisit = 300;
  std::mt19937 random(seed);
  std::vector<Pair> pairs;
  const auto position = [&](std::size_t i) -> std::optional<Eigen::Vector3d> {
    const auto pose = recording.trajectory().at(recording.frame(i));
    return pose ? std::optional<Eigen::Vector3d>(pose->translation()) : std::nullopt;
  };
  for (std::size_t trial = 0; trial < 200 * wanted && pairs.size() < wanted; ++trial) {
    const std::size_t source = random() % recording.size();
    const auto at = position(source);
    std::vector<std::size_t> near;
    for (std::size_t i = 0; at && i < recording.size(); ++i) {
      if (visits && i + kOtherVisit > source) break;
      const auto there = position(i);
      const double apart_m = there ? (*there - *at).norm() : 0.0;
      if (apart_m >= least_m && apart_m <= most_m) near.push_back(i);
    }
    if (!near.empty()) pairs.push_back({near[random() % near.size()], source});
  }
  return pairs;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2) {
    std::fprintf(stderr, "usage: register_pairs RECORDING [PAIRS [FARTHEST_M [SEED [any|visits|elsewhere]]]]\n");
    return 1;
  }
  const auto recording = open(argv[1]);
  const std::size_t wanted = argc > 2 ? std::strtoul(argv[2], nullptr, 10) : 120;
  const double most_m = argc > 3 ? std::atof(argv[3]) : 10.0;
  const auto seed = static_cast<unsigned>(argc > 4 ? std::atoi(argv[4]) : 1);
  const std::string kind = argc > 5 ? argv[5] : "any";
  const std::vector<Pair> pairs = kind == "elsewhere"
                                      ? draw_pairs(*recording, wanted, most_m, 1e6, seed, false)
                                      : draw_pairs(*recording, wanted, 2.0, most_m, seed, kind == "visits");
  std::mt19937 random(seed + 1);
  std::uniform_real_distribution<double> heading(-kPi, kPi);
  int near = 0, close = 0, wrong = 0, found_unaccepted = 0;
  double cpu_s = 0.0;
  std::printf("target,source,apart_m,off_m,off_deg,accepted,probability,inliers,reason\n");
  for (const Pair& pair : pairs) {
    auto target = recording->read(pair.target), source = recording->read(pair.source);
    if (!target || !source) continue;
    const Pose turn = planar_pose(0.0, 0.0, heading(random));  // of the source's sensor
    for (Point& p : source->points) {
      const Eigen::Vector3d q = turn.inverse() * Eigen::Vector3d(p.x, p.y, p.z);
      p.x = static_cast<float>(q.x()), p.y = static_cast<float>(q.y()), p.z = static_cast<float>(q.z());
    }
    const Pose T_true = recording->trajectory().at(recording->frame(pair.target))->inverse() *
                        *recording->trajectory().at(recording->frame(pair.source)) * turn;
    const std::clock_t begin = std::clock();
    const auto found = register_scans(*source, *target);
    cpu_s += static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
    if (!found) continue;
    const Pose error = T_true.inverse() * found->T_target_source;
    const double off_m = error.translation().norm(), off_deg = to_degrees(rotation_angle(error));
    const bool is_near = off_m <= 2.0 && off_deg <= 5.0;
    near += found->is_accepted() && is_near;
    close += found->is_accepted() && off_m <= 0.5 && off_deg <= 3.0;
    wrong += found->is_accepted() && !is_near;
    found_unaccepted += !found->is_accepted() && is_near;
    std::printf("%zu,%zu,%.2f,%.3f,%.2f,%d,%.12f,%.3f,\"%s\"\n", pair.target, pair.source, T_true.translation().norm(),
                off_m, off_deg, found->is_accepted(), found->probability, found->inlier_ratio,
                found->refusal ? to_text(*found->refusal).c_str() : "");
  }
  std::fprintf(stderr,
               "%s: of %zu pairs %d right within 2 m and 5 degrees, %d within 0.5 m and 3 degrees, %d wrong given; "
               "right but refused %d; %.3f s of CPU a pair\n",
               argv[1], pairs.size(), near, close, wrong, found_unaccepted, cpu_s / static_cast<double>(pairs.size()));
  return 0;
}
