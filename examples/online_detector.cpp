// SPDX-License-Identifier: Apache-2.0
// The whole method on a recording, scan by scan as a robot would: example_online_detector RECORDING
#include <cstdio>

#include <revisit/io/recording.hpp>
#include <revisit/pipeline/loop_detector.hpp>

int main(int argc, char** argv) {
  if (argc != 2) return std::puts("usage: example_online_detector RECORDING"), 2;
  const auto print = [](revisit::LogLevel, const std::string& message) { std::puts(message.c_str()); };
  const auto recording = revisit::open_recording(argv[1], print);
  if (!recording) return std::puts(recording.error().message.c_str()), 1;

  revisit::LoopDetector detector(revisit::Parameters{}, std::nullopt, {}, print);
  for (std::size_t i = 0; i < (*recording)->size(); ++i) {
    auto scan = (*recording)->read(i);
    const auto detection =
        scan ? detector.process(*std::move(scan)) : revisit::Result<revisit::Detection>(scan.error());
    if (!detection) {
      std::puts(detection.error().message.c_str());  // this scan is of no use; go on with the next
      continue;
    }
    if (!detection->loop) continue;
    const auto& loop = *detection->loop;
    std::printf("frame %lld revisits frame %lld: %.2f m away, inlier ratio %.2f, rmse %.3f m\n",
                static_cast<long long>(loop.query.value), static_cast<long long>(loop.match.value),
                loop.T_match_query.translation().norm(), loop.inlier_ratio, loop.rmse_m);
  }
}
