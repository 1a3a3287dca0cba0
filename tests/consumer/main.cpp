// SPDX-License-Identifier: Apache-2.0
#include <cstdio>

#include <revisit/pipeline/loop_detector.hpp>

// Feeds a detector two scans of the same few walls, long apart: the second must be recognised.
int main() {
  revisit::LoopDetector detector{revisit::Parameters{}};
  for (const int frame : {0, 1000}) {
    revisit::Scan scan;
    scan.frame = revisit::FrameId{frame};
    scan.stamp_s = 0.1 * frame;
    for (int i = 0; i < 6000; ++i) {
      const float along = static_cast<float>(i % 600) * 0.06f - 18.f, up = static_cast<float>(i / 600) * 0.5f;
      const float shade = static_cast<float>((i / 50) % 7) / 7.f;
      scan.points.push_back({along, 9.f, up, shade});
      scan.points.push_back({along, -6.f + 0.2f * along, up, 1.f - shade});
      if (i % 2 == 0) scan.points.push_back({15.f, 0.4f * along, up, 0.5f});
    }
    const auto detection = detector.process(scan);
    if (!detection) {
      std::printf("%s\n", detection.error().message.c_str());
      return 1;
    }
    std::printf("frame %d: %s\n", frame, detection->loop ? "a loop" : detection->reason().c_str());
    if (frame == 1000) return detection->loop ? 0 : 1;
  }
  return 1;
}
