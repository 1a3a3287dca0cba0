// SPDX-License-Identifier: Apache-2.0
// Scans in, loops out: example_loop_detector RECORDING
#include <cstdio>

#include <revisit/io/recording.hpp>
#include <revisit/pipeline/loop_detector.hpp>

int main(int, char** argv) {
  const auto recording = revisit::open_recording(argv[1]);
  if (!recording) return std::puts(recording.error().message.c_str()), 1;
  revisit::LoopDetector detector;
  for (std::size_t i = 0; i < (*recording)->size(); ++i) {
    auto scan = (*recording)->read(i);
    if (!scan) continue;
    const auto detection = detector.process(*std::move(scan));
    if (!detection) continue;
    for (const auto& loop : detection->loops()) {
      const Eigen::Vector3d t = loop.T_match_query.translation();
      std::printf("%ld -> %ld: %.2f %.2f %.2f m\n", loop.query.value, loop.match.value, t.x(), t.y(), t.z());
    }
  }
}
