// SPDX-License-Identifier: Apache-2.0
// Do two scans show the same place, and how do they lie to each other? example_two_scans EARLIER LATER
#include <cstdio>

#include <revisit/io/scan_file.hpp>
#include <revisit/pipeline/loop_detector.hpp>

int main(int argc, char** argv) {
  if (argc != 3) return std::puts("usage: example_two_scans EARLIER LATER"), 2;
  const auto earlier = revisit::read_scan(argv[1]), later = revisit::read_scan(argv[2]);
  for (const auto* scan : {&earlier, &later})
    if (!*scan) return std::puts(scan->error().message.c_str()), 1;

  revisit::LoopDetector detector{revisit::Parameters{}};
  if (const auto added = detector.add(*earlier); !added) return std::puts(added.error().message.c_str()), 1;
  const auto detection = detector.localise(*later);
  if (!detection) return std::puts(detection.error().message.c_str()), 1;
  if (!detection->loop) return std::printf("not the same place: %s\n", detection->reason.c_str()), 0;
  const auto& T = detection->loop->T_match_query;
  std::printf(
      "the same place: the later scan stands at (%.2f, %.2f, %.2f) m and heads %.1f degrees in the earlier one\n",
      T.translation().x(), T.translation().y(), T.translation().z(), revisit::to_degrees(revisit::yaw_of(T)));
}
