// SPDX-License-Identifier: Apache-2.0
// How do two scans lie to each other? example_register_scans SOURCE TARGET
#include <cstdio>

#include <revisit/io/scan_file.hpp>
#include <revisit/pipeline/register_scans.hpp>

int main(int, char** argv) {
  const auto source = revisit::read_scan(argv[1]), target = revisit::read_scan(argv[2]);
  if (!source || !target) return std::puts("cannot be read"), 1;
  const auto found = revisit::register_scans(*source, *target);
  if (!found) return std::puts(found.error().message.c_str()), 1;
  if (!found->is_accepted()) return std::puts("not the same place"), 0;
  const revisit::Pose& T = found->T_target_source;
  std::printf("the source stands at (%.2f, %.2f, %.2f) m in the target, turned by %.1f degrees; probability %.3f\n",
              T.translation().x(), T.translation().y(), T.translation().z(), revisit::to_degrees(revisit::yaw_of(T)),
              found->probability);
}
