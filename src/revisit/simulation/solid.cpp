// SPDX-License-Identifier: Apache-2.0
#include <revisit/simulation/internal/solid.hpp>

#include <algorithm>
#include <cmath>

#include <revisit/simulation/internal/random.hpp>

namespace revisit::simulation_internal {
namespace {

using Eigen::Vector3f;

constexpr float kNone = std::numeric_limits<float>::infinity();

struct LocalRay {
  Vector3f origin, direction;
  float season;
  Vector3f at(float t) const { return origin + t * direction; }
};

LocalRay to_local(const Solid& s, const Ray& ray) {
  const float x = ray.origin.x() - s.centre.x() - s.velocity.x() * ray.time_s;
  const float y = ray.origin.y() - s.centre.y() - s.velocity.y() * ray.time_s;
  const Vector3f& d = ray.direction;
  return {{s.cos_yaw * x + s.sin_yaw * y, s.cos_yaw * y - s.sin_yaw * x, ray.origin.z() - s.centre.z()},
          {s.cos_yaw * d.x() + s.sin_yaw * d.y(), s.cos_yaw * d.y() - s.sin_yaw * d.x(), d.z()},
          ray.season};
}

Vector3f to_world(const Solid& s, const Vector3f& v) {
  return {s.cos_yaw * v.x() - s.sin_yaw * v.y(), s.sin_yaw * v.x() + s.cos_yaw * v.y(), v.z()};
}

// The part of the ray inside something convex, and the normal where it enters.
struct Span {
  float enter = 0.f, leave = kNone;
  Vector3f normal = Vector3f::Zero();
  bool empty() const { return !(enter < leave); }

  // Keeps what lies behind the plane: offset + slope t <= 0.
  void clip(float offset, float slope, const Vector3f& plane_normal) {
    if (slope == 0.f) {
      if (offset > 0.f) leave = -1.f;
      return;
    }
    const float t = -offset / slope;
    if (slope > 0.f) {
      leave = std::min(leave, t);
    } else if (t > enter) {
      enter = t;
      normal = plane_normal;
    }
  }
};

Span clip_to_box(const LocalRay& ray, const Vector3f& half) {
  Span span;
  int entered = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const float o = ray.origin[axis], d = ray.direction[axis], h = half[axis];
    if (d == 0.f) {
      if (std::abs(o) > h) span.leave = -1.f;
      continue;
    }
    const float inverse = 1.f / d, middle = -o * inverse, reach = std::abs(h * inverse);
    if (middle - reach > span.enter) {
      span.enter = middle - reach;
      entered = axis + 1;
    }
    span.leave = std::min(span.leave, middle + reach);
    if (span.empty()) return span;
  }
  if (entered != 0) span.normal[entered - 1] = ray.direction[entered - 1] > 0.f ? -1.f : 1.f;
  return span;
}

Span clip_to_ellipsoid(const LocalRay& ray, const Vector3f& half) {
  const Vector3f o = ray.origin.cwiseQuotient(half), d = ray.direction.cwiseQuotient(half);
  const float a = d.squaredNorm(), b = o.dot(d), c = o.squaredNorm() - 1.f, root = b * b - a * c;
  Span span;
  if (root < 0.f) {
    span.leave = -1.f;
    return span;
  }
  const float w = std::sqrt(root);
  span.enter = std::max(0.f, (-b - w) / a);
  span.leave = (-b + w) / a;
  return span;
}

Span clip_to_cylinder(const LocalRay& ray, const Vector3f& half) {
  Span span;
  span.clip(ray.origin.z() - half.z(), ray.direction.z(), Vector3f::UnitZ());
  span.clip(-ray.origin.z() - half.z(), -ray.direction.z(), -Vector3f::UnitZ());
  const float dx = ray.direction.x(), dy = ray.direction.y(), ox = ray.origin.x(), oy = ray.origin.y();
  const float a = dx * dx + dy * dy, b = ox * dx + oy * dy, c = ox * ox + oy * oy - half.x() * half.x();
  const float root = b * b - a * c;
  if (a == 0.f || root < 0.f) {
    if (a != 0.f || c > 0.f) span.leave = -1.f;
    return span;
  }
  const float w = std::sqrt(root), first = (-b - w) / a;
  if (first > span.enter) {
    span.enter = first;
    const float inverse = 1.f / half.x();
    span.normal = Vector3f((ox + first * dx) * inverse, (oy + first * dy) * inverse, 0.f);
  }
  span.leave = std::min(span.leave, (-b + w) / a);
  return span;
}

// Leaves: the space is cut into cells, some of which hold foliage; some of them change with the seasons, each at a
// time of its own, so that nothing changes in full view.
float through_leaves(const Solid& solid, const LocalRay& ray, const Span& span, float limit_m) {
  constexpr float kStep = 0.17f, kCellsPerMetre = 4.f;
  const std::uint64_t seed = static_cast<std::uint64_t>(solid.object) << 32;
  const float end = std::min(span.leave, limit_m + kStep);  // a leaf may hang up to a step before
  for (float t = span.enter + 0.5f * kStep; t < end; t += kStep) {
    const Vector3f p = ray.at(t) * kCellsPerMetre;
    const auto x = as_key(floor_int(p.x()) + 512), y = as_key(floor_int(p.y()) + 512),
               z = as_key(floor_int(p.z()) + 512);
    std::uint64_t key = mix(seed ^ (x << 20) ^ (y << 10) ^ z);
    if (((key >> 16) & 0xff) < solid.changing)
      key = mix(key, as_key(floor_int(ray.season + static_cast<float>((key >> 24) & 0xff) * (1.f / 256.f))));
    if ((key & 0xff) < solid.filled)
      return std::max(span.enter, t - kStep * static_cast<float>((key >> 8) & 0xff) * (1.f / 256.f));
  }
  return kNone;
}

float through_fence(const Solid& solid, const LocalRay& ray, float limit_m) {
  if (ray.direction.y() == 0.f) return kNone;
  const float t = -ray.origin.y() / ray.direction.y();
  if (!(t > 0.f && t < limit_m)) return kNone;
  const Vector3f p = ray.at(t);
  if (std::abs(p.x()) > solid.half.x() || std::abs(p.z()) > solid.half.z()) return kNone;
  constexpr float kPicketsPerMetre = 6.f, kFilled = 0.55f, kPostsPerMetre = 0.4f, kPost = 0.04f;
  const float along = p.x() + solid.half.x(), picket = along * kPicketsPerMetre, post = along * kPostsPerMetre;
  const bool filled = picket - static_cast<float>(floor_int(picket)) < kFilled ||
                      post - static_cast<float>(floor_int(post)) < kPost || std::abs(p.z()) > solid.half.z() - 0.08f;
  return filled ? t : kNone;
}

// Lets windows and doors into the wall that the span enters: deeper, or at their reveal.
float through_facade(const Solid& solid, const LocalRay& ray, Span& span, Material& material) {
  const int wall_axis = std::abs(span.normal.x()) > 0.5f ? 0 : 1, along_axis = 1 - wall_axis;
  const Facade& facade = kFacades[solid.facade];
  const Vector3f p = ray.at(span.enter);
  const float along = p[along_axis] + solid.half[along_axis], up = p.z() - solid.ground;
  const float length = 2.f * solid.half[along_axis];
  const auto windows = static_cast<float>(floor_int(length / facade.pitch_m));
  if (windows < 1.f || up < 0.f) return span.enter;
  const float pitch = length / windows, column = along / pitch, floor = up / facade.floor_m;
  const float u = (column - static_cast<float>(floor_int(column)) - 0.5f) * pitch;  // from the middle of the window
  const int storey = floor_int(floor);
  const float v = (floor - static_cast<float>(storey)) * facade.floor_m;
  const float top = solid.shape == Shape::kWedge ? solid.eaves : solid.half.z();
  if (static_cast<float>(storey + 1) * facade.floor_m > top - solid.ground + 0.3f) return span.enter;
  const auto key = mix(static_cast<std::uint64_t>(solid.object), static_cast<std::uint64_t>(floor_int(column)),
                       as_key(wall_axis + (span.normal[wall_axis] > 0.f ? 2 : 0)));
  const bool is_door = storey == 0 && (key & 3) == 0;
  const bool is_walled = !is_door && ((key >> (8 + 2 * (storey & 7))) & 3) == 0;  // every fourth window is missing
  const float sill = is_door ? 0.f : facade.sill_m, half_width = 0.5f * (is_door ? 1.2f : facade.window_m);
  const float lintel = is_door ? 2.1f : facade.sill_m + facade.height_m;
  if (is_walled || std::abs(u) > half_width || v < sill || v > lintel) return span.enter;
  const float inwards = -span.normal[wall_axis] * ray.direction[wall_axis];
  float deeper = facade.recess_m / std::max(inwards, 1e-3f);
  const float sideways = ray.direction[along_axis];
  if (std::abs(sideways) > 1e-6f) {
    const float to_reveal = ((sideways > 0.f ? half_width : -half_width) - u) / sideways;
    if (to_reveal < deeper) {
      span.normal = Vector3f::Zero();
      span.normal[along_axis] = sideways > 0.f ? -1.f : 1.f;
      return span.enter + to_reveal;
    }
  }
  material = is_door ? Material::kDoor : Material::kGlass;
  return span.enter + deeper;
}

}  // namespace

float intersect(const Solid& solid, const Ray& ray, float limit_m, Hit* hit) {
  const LocalRay local = to_local(solid, ray);
  Material material = solid.material;
  Span span;
  float t = kNone;
  switch (solid.shape) {
    case Shape::kBox:
    case Shape::kWedge:
      span = clip_to_box(local, solid.half);
      if (solid.shape == Shape::kWedge) {
        const float lean = solid.rise / solid.half.y(), top = solid.eaves + solid.rise;
        const float length = 1.f / std::sqrt(1.f + lean * lean);
        for (const float side : {1.f, -1.f})
          span.clip(local.origin.z() + side * lean * local.origin.y() - top,
                    local.direction.z() + side * lean * local.direction.y(),
                    Vector3f(0.f, side * lean * length, length));
      }
      if (span.empty() || span.enter <= 0.f || span.enter >= limit_m) return kNone;
      t = span.enter;
      if (span.normal.z() > 0.3f)
        material = solid.top_material;
      else if (solid.facade != 0 && std::abs(span.normal.z()) < 0.1f)
        t = through_facade(solid, local, span, material);
      break;
    case Shape::kCylinder:
      span = clip_to_cylinder(local, solid.half);
      t = span.empty() || span.enter <= 0.f ? kNone : span.enter;
      break;
    case Shape::kEllipsoid:
      span = clip_to_ellipsoid(local, solid.half);
      t = span.empty() || span.enter <= 0.f ? kNone : span.enter;
      if (t < limit_m && hit != nullptr)
        span.normal = local.at(t).cwiseQuotient(solid.half.cwiseProduct(solid.half)).normalized();
      break;
    case Shape::kFence:
      t = through_fence(solid, local, limit_m);
      span.normal = local.direction.y() < 0.f ? Vector3f::UnitY() : Vector3f(-Vector3f::UnitY());
      break;
    case Shape::kCrown:
    case Shape::kHedge:
      span = solid.shape == Shape::kCrown ? clip_to_ellipsoid(local, solid.half) : clip_to_box(local, solid.half);
      if (span.empty() || span.enter >= limit_m) return kNone;
      t = through_leaves(solid, local, span, limit_m);
      span.normal = -local.direction;
      break;
  }
  if (!(t > 0.f && t < limit_m)) return kNone;
  if (hit != nullptr) *hit = {t, to_world(solid, span.normal), material, solid.object};
  return t;
}

Eigen::Vector3f bounding_half(const Solid& solid) {
  const float c = std::abs(solid.cos_yaw), s = std::abs(solid.sin_yaw);
  const float depth = solid.shape == Shape::kFence ? 0.02f : solid.half.y();
  const float width = solid.shape == Shape::kCylinder ? solid.half.x() : depth;
  return {c * solid.half.x() + s * width, s * solid.half.x() + c * width, solid.half.z()};
}

}  // namespace revisit::simulation_internal
