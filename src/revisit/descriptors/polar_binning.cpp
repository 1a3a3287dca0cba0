// SPDX-License-Identifier: Apache-2.0
// Compiled once for each instruction set by Highway's foreach_target; the best one is chosen at run time.
#include <revisit/descriptors/internal/polar_binning.hpp>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "revisit/descriptors/polar_binning.cpp"
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

#include <algorithm>

HWY_BEFORE_NAMESPACE();
namespace revisit::descriptors_internal {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using F = hn::ScalableTag<float>;
using I = hn::RebindToSigned<F>;
using VF = hn::Vec<F>;

constexpr float kPi = 3.14159265f;

// atan2 by an odd polynomial on the octant [0, 1], fitted to 4e-8; about 1e-6 rad in float.
HWY_INLINE VF Atan2(F f, VF y, VF x) {
  const VF ax = hn::Abs(x), ay = hn::Abs(y);
  const VF a = hn::Div(hn::Min(ax, ay), hn::Add(hn::Max(ax, ay), hn::Set(f, 1e-30f)));
  const VF s = hn::Mul(a, a);
  VF p = hn::Set(f, -0.00405421526f);
  for (const float c :
       {0.0218616318f, -0.0559103291f, 0.0964204435f, -0.139085672f, 0.199465528f, -0.333298597f, 0.999999335f})
    p = hn::MulAdd(p, s, hn::Set(f, c));
  VF r = hn::Mul(p, a);
  r = hn::IfThenElse(hn::Gt(ay, ax), hn::Sub(hn::Set(f, kPi / 2), r), r);
  r = hn::IfThenElse(hn::Lt(x, hn::Zero(f)), hn::Sub(hn::Set(f, kPi), r), r);
  return hn::CopySign(r, y);
}

// Whether a coordinate on the grid lies so near a border that float could put it on the wrong side.
HWY_INLINE hn::Mask<F> NearBorder(F f, VF coordinate, float margin) {
  return hn::Lt(hn::Abs(hn::Sub(coordinate, hn::Round(coordinate))), hn::Set(f, margin));
}

void BinPoints(const Point* HWY_RESTRICT points, size_t count, const PolarGrid& grid, const Levels& levels,
               uint16_t* HWY_RESTRICT cells, uint8_t* HWY_RESTRICT tops) {
  const F f;
  const I d;
  const size_t lanes = hn::Lanes(f);
  const auto rings = static_cast<float>(grid.rings), sectors = static_cast<float>(grid.sectors);
  const VF rings_per_m = hn::Set(f, static_cast<float>(grid.rings / grid.max_range_m));
  const VF sectors_per_rad = hn::Set(f, sectors / (2.f * kPi));
  // A few times the rounding of both coordinates.
  const float ring_margin = 1e-5f + rings * 1e-6f, sector_margin = 1e-5f + sectors * 1e-6f;
  const VF last_sector = hn::Set(f, sectors - 1.f);
  const auto trash = hn::Set(d, grid.rings * grid.sectors);

  constexpr size_t kMostLanes = HWY_MAX_BYTES / sizeof(float);
  HWY_ALIGN int32_t cell[kMostLanes];
  HWY_ALIGN int32_t value[kMostLanes];
  HWY_ALIGN int32_t top[kMostLanes];
  const VF lowest = hn::Set(f, levels.lowest_m), steps_per_m = hn::Set(f, levels.steps_per_m);
  const VF last_level = hn::Set(f, static_cast<float>(levels.count - 1));
  uint8_t border[kMostLanes / 8 + 8];

  size_t i = 0;
  for (; i + lanes <= count; i += lanes) {
    VF x, y, z, intensity;
    hn::LoadInterleaved4(f, &points[i].x, x, y, z, intensity);
    const VF rho = hn::Sqrt(hn::MulAdd(x, x, hn::Mul(y, y)));
    const VF ring = hn::Mul(rho, rings_per_m);
    const VF sector = hn::Mul(hn::Add(Atan2(f, y, x), hn::Set(f, kPi)), sectors_per_rad);
    const auto inside = hn::Lt(ring, hn::Set(f, rings));  // false for NaN
    const auto near = hn::Or(NearBorder(f, ring, ring_margin), NearBorder(f, sector, sector_margin));

    const VF sector_index = hn::Max(hn::Zero(f), hn::Min(hn::Floor(sector), last_sector));
    // Floats hold whole numbers up to 2^24 exactly, and there are fewer cells.
    const VF index = hn::MulAdd(sector_index, hn::Set(f, rings), hn::Floor(ring));
    const auto inside_index = hn::ConvertTo(d, hn::IfThenElseZero(inside, index));
    hn::Store(hn::IfThenElse(hn::RebindMask(d, inside), inside_index, trash), d, cell);

    const VF clamped = hn::Min(hn::Max(intensity, hn::Zero(f)), hn::Set(f, 1.f));
    const VF finite = hn::IfThenElseZero(hn::Ge(intensity, hn::Zero(f)), clamped);  // NaN becomes 0
    hn::Store(hn::Add(hn::NearestInt(hn::Mul(finite, hn::Set(f, 255.f))), hn::Set(d, 1)), d, value);

    const VF steps = hn::Mul(hn::Sub(z, lowest), steps_per_m);
    const VF level = hn::Add(hn::Min(hn::Floor(steps), last_level), hn::Set(f, 1.f));
    hn::Store(hn::ConvertTo(d, hn::IfThenElseZero(hn::Ge(steps, hn::Zero(f)), level)), d, top);

    if (HWY_UNLIKELY(!hn::AllFalse(f, near))) {
      hn::StoreMaskBits(f, near, border);
      for (size_t lane = 0; lane < lanes; ++lane) {
        if ((border[lane / 8] >> (lane % 8) & 1) == 0) continue;
        const int exact = cell_of(grid, points[i + lane].x, points[i + lane].y);
        cell[lane] = exact < 0 ? grid.rings * grid.sectors : exact;
      }
    }
    for (size_t lane = 0; lane < lanes; ++lane) {
      uint16_t& target = cells[cell[lane]];
      target = std::max(target, static_cast<uint16_t>(value[lane]));
      tops[cell[lane]] = std::max(tops[cell[lane]], static_cast<uint8_t>(top[lane]));
    }
  }
  bin_points_scalar(points + i, count - i, grid, levels, cells, tops);
}

}  // namespace HWY_NAMESPACE
}  // namespace revisit::descriptors_internal
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace revisit::descriptors_internal {

HWY_EXPORT(BinPoints);

void bin_points(const Point* points, std::size_t count, const PolarGrid& grid, const Levels& levels,
                std::uint16_t* cells, std::uint8_t* tops) {
  HWY_DYNAMIC_DISPATCH(BinPoints)(points, count, grid, levels, cells, tops);
}

}  // namespace revisit::descriptors_internal
#endif  // HWY_ONCE
