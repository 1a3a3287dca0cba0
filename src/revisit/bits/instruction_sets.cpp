// SPDX-License-Identifier: Apache-2.0
#include <revisit/bits/instruction_sets.hpp>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "revisit/bits/instruction_sets.cpp"
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace revisit::bits_internal::HWY_NAMESPACE {

size_t Lanes() { return hwy::HWY_NAMESPACE::Lanes(hwy::HWY_NAMESPACE::ScalableTag<uint64_t>()); }

}  // namespace revisit::bits_internal::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace revisit {
namespace bits_internal {
HWY_EXPORT(Lanes);
}

std::vector<std::int64_t> supported_instruction_sets() {
  std::vector<std::int64_t> targets;
  const std::int64_t compiled = hwy::SupportedTargets() & HWY_TARGETS;
  for (int bit = 0; bit < 63; ++bit)
    if (compiled >> bit & 1) targets.push_back(std::int64_t{1} << bit);
  return targets;
}

void force_instruction_set(std::int64_t target) {
  hwy::SetSupportedTargetsForTest(target);
  hwy::GetChosenTarget().Update(hwy::SupportedTargets());
}

const char* instruction_set_name() {
  const std::int64_t runnable = hwy::SupportedTargets() & HWY_TARGETS;
  return hwy::TargetName(runnable & -runnable);  // the lowest bit is the best target
}

std::size_t instruction_set_lanes() {
  using namespace bits_internal;
  return HWY_DYNAMIC_DISPATCH(Lanes)();
}

}  // namespace revisit
#endif  // HWY_ONCE
