// SPDX-License-Identifier: Apache-2.0
#include <revisit/simulation/internal/camera.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include <oneapi/tbb/parallel_for.h>

#include <revisit/simulation/internal/random.hpp>

namespace revisit::simulation_internal {
namespace {

constexpr std::size_t kWidth = 640, kHeight = 240;
constexpr float kFocal = 320.f, kFarthest_m = 150.f;
constexpr std::array kGrain_m{1.6f, 0.5f, 0.16f};  // wave lengths of what surfaces look like
constexpr float kLeastGrain = 0.12f, kGrainOfRelief = 8.f, kMostGrain = 0.4f;  // painted; a metre of relief; grass
constexpr float kMean = 105.f, kMostGain = 900.f, kNoise = 2.f;
constexpr float kLamp_m = 9.f;     // at which the own lamp is as bright as daylight in the shade
constexpr double kCloud_s = 90.0;  // in which clouds come and go

float hash_at(std::uint64_t key, int i, int j) {
  return uniform(mix(key, as_key(i) << 32 ^ (as_key(j) & 0xffffffffu)));
}

// Smooth noise in [0, 1], in the plane.
float value_noise(std::uint64_t key, float x, float y) {
  const int i = floor_int(x), j = floor_int(y);
  const auto smooth = [](float t) { return t * t * (3.f - 2.f * t); };
  const float u = smooth(x - static_cast<float>(i)), v = smooth(y - static_cast<float>(j));
  const float low = hash_at(key, i, j) + u * (hash_at(key, i + 1, j) - hash_at(key, i, j));
  const float high = hash_at(key, i, j + 1) + u * (hash_at(key, i + 1, j + 1) - hash_at(key, i, j + 1));
  return low + v * (high - low);
}

// About 1: the grain of a surface at `p`, in coordinates of what it belongs to; what is finer than a pixel blurs.
float grain(std::uint64_t key, const Eigen::Vector3f& p, const Eigen::Vector3f& normal, float strength, float pixel_m) {
  Eigen::Index across = 0;
  normal.cwiseAbs().maxCoeff(&across);
  const float x = p[(across + 1) % 3], y = p[(across + 2) % 3];
  float sum = 1.f;
  for (std::size_t octave = 0; octave < kGrain_m.size(); ++octave) {
    const float sharp = std::clamp(kGrain_m[octave] / (2.f * pixel_m) - 0.5f, 0.f, 1.f);
    if (sharp == 0.f) continue;
    const float noise = value_noise(mix(key, octave), x / kGrain_m[octave], y / kGrain_m[octave]);
    sum += strength * sharp * (2.f * noise - 1.f);
  }
  return std::max(0.1f, sum);
}

}  // namespace

// What the pixels of one picture share.
struct Camera::View {
  Eigen::Vector3f origin, forward, left, up;
  Eigen::Vector3f to_sun;
  float sun = 0.f, sky = 1.f, lamp = 0.f;  // how bright, 1: daylight in the shade
  float season = 0.f;
  bool is_inside = false;
  Solids moving;
  std::unique_ptr<RayScene> scene;
};

Camera::Camera(const World& world) : world_(world), scene_(world.solids, world.terrain.cells()) {}

Met Camera::first_met(const View& view, const Ray& ray) const {
  Met met{kFarthest_m, Met::What::kNothing, 0};
  scene_.trace(std::span(&ray, 1), &met);
  if (view.scene) view.scene->trace(std::span(&ray, 1), &met);
  return met;
}

float Camera::brightness_at(const View& view, const Ray& ray, const Met& met) const {
  if (met.what == Met::What::kNothing) return view.is_inside ? 0.f : view.sky * (0.9f + 0.5f * ray.direction.z());
  Hit hit;
  Eigen::Vector3f in_object = ray.origin + met.range_m * ray.direction;
  const auto turned = [](const Solid& solid, const Eigen::Vector3f& v) {
    return Eigen::Vector3f(solid.cos_yaw * v.x() + solid.sin_yaw * v.y(), solid.cos_yaw * v.y() - solid.sin_yaw * v.x(),
                           v.z());
  };
  Eigen::Vector3f normal_in_object = Eigen::Vector3f::UnitZ();
  constexpr float kBeyond = std::numeric_limits<float>::infinity();
  if (met.what == Met::What::kGround) {
    hit.range_m = intersect(world_.terrain.cells()[met.index], ray, kBeyond, &hit.normal);
    hit.material = world_.ground_at(in_object.x(), in_object.y()).material;
  } else {
    const Solid& solid = met.what == Met::What::kSolid ? world_.solids[met.index] : view.moving[met.index];
    intersect(solid, ray, kBeyond, &hit);
    in_object = turned(solid, in_object - solid.centre);
    normal_in_object = turned(solid, hit.normal);
  }
  if (hit.normal.dot(ray.direction) > 0.f) hit.normal = -hit.normal;
  const Surface& surface = surface_of(hit.material);
  const std::uint64_t key = mix(hit.object, static_cast<std::uint64_t>(hit.material));
  float paint = std::min(surface.reflectance, 0.8f) * (1.f + 0.7f * surface.spread * (2.f * uniform(hit.object) - 1.f));
  const float strength = std::min(kMostGrain, kLeastGrain + kGrainOfRelief * surface.roughness_m);
  paint *= grain(key, in_object, normal_in_object, strength, hit.range_m / kFocal);
  float light = view.sky * (0.75f + 0.25f * hit.normal.z());
  if (const float facing = hit.normal.dot(view.to_sun); view.sun > 0.f && facing > 0.f) {
    const Ray to_sun{ray.origin + (hit.range_m - 0.02f) * ray.direction, view.to_sun, 0.f, ray.season};
    if (first_met(view, to_sun).what == Met::What::kNothing) light += view.sun * facing;
  }
  const float lamp = kLamp_m / std::max(1.f, hit.range_m);
  light += view.lamp * lamp * lamp * std::max(0.f, -hit.normal.dot(ray.direction));
  return paint * light;
}

void Camera::look(const View& view, std::size_t row, float* brightness) const {
  std::array<Ray, RayScene::kPacket> rays;
  std::array<Met, RayScene::kPacket> mets;
  for (std::size_t first = 0; first < kWidth; first += rays.size()) {
    for (std::size_t i = 0; i < rays.size(); ++i) {
      const float right = static_cast<float>(first + i) + 0.5f - kWidth / 2.f;
      const float down = static_cast<float>(row) + 0.5f - kHeight / 2.f;
      const Eigen::Vector3f direction = kFocal * view.forward - right * view.left - down * view.up;
      rays[i] = {view.origin, direction.normalized(), 0.f, view.season};
      mets[i] = {kFarthest_m, Met::What::kNothing, 0};
    }
    scene_.trace(rays, mets.data());
    if (view.scene) view.scene->trace(rays, mets.data());
    for (std::size_t i = 0; i < rays.size(); ++i) brightness[first + i] = brightness_at(view, rays[i], mets[i]);
  }
}

Image Camera::picture(const Pose& T_local_lidar, double time_s, ImageLight light, std::uint64_t key) const {
  View view;
  const Eigen::Matrix3f R = T_local_lidar.linear().cast<float>();
  view.origin = T_local_lidar.translation().cast<float>();
  view.forward = R.col(0);
  view.left = R.col(1);
  view.up = R.col(2);
  view.season = world_.season(time_s);
  view.is_inside = world_.roads.points().empty();
  const std::uint64_t day = world_.seed_of_day();
  if (light == ImageLight::kNight) {
    view.sky = view.is_inside ? 0.002f : 0.01f;
    view.lamp = 0.5f;
  } else if (!view.is_inside) {
    view.sun = 1.5f * std::clamp(0.5f + static_cast<float>(smooth_noise(mix(day, 82), time_s / kCloud_s)), 0.f, 1.f);
    const double azimuth = 2.0 * kPi * static_cast<double>(uniform(mix(day, 83)));
    view.to_sun = Eigen::Vector3d(std::cos(azimuth), std::sin(azimuth), 0.9).normalized().cast<float>();
  }
  view.moving = world_.movers.at(time_s, world_.path, [this](double x, double y) { return world_.stand_z(x, y); });
  if (!view.moving.empty()) view.scene = std::make_unique<RayScene>(scene_, view.moving, 0.f);

  std::vector<float> brightness(kWidth * kHeight);
  tbb::parallel_for(std::size_t{0}, kHeight, [&](std::size_t row) { look(view, row, &brightness[row * kWidth]); });
  const float mean = std::accumulate(brightness.begin(), brightness.end(), 0.f) / static_cast<float>(brightness.size());
  const float gain = std::min(kMostGain, kMean / std::max(1e-6f, mean));
  const float noise = kNoise * std::max(1.f, std::sqrt(gain / 200.f));  // dark pictures are amplified
  Image image{static_cast<int>(kWidth), static_cast<int>(kHeight), std::vector<std::uint8_t>(brightness.size())};
  for (std::size_t i = 0; i < brightness.size(); ++i)
    image.grey[i] =
        static_cast<std::uint8_t>(std::clamp(gain * brightness[i] + noise * gaussian(mix(key, i)) + 0.5f, 0.f, 255.f));
  return image;
}

}  // namespace revisit::simulation_internal
