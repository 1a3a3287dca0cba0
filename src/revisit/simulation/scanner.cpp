// SPDX-License-Identifier: Apache-2.0
#include <revisit/simulation/internal/scanner.hpp>

#include <algorithm>
#include <array>
#include <cmath>

#include <oneapi/tbb/parallel_for.h>

#include <revisit/simulation/internal/threads.hpp>

namespace revisit::simulation_internal {
namespace {

constexpr double kFalloffStep_m = 0.25;
constexpr double kWeather_s = 150.0;    // in which rain, sun and wet surfaces come and go
constexpr std::size_t kPoseKnots = 51;  // poses within a sweep, linear between them

// A number of its own for each cell of space: what a surface looks like there, at every visit.
float texture(const Eigen::Vector3f& p, float cells_per_metre) {
  const auto part = [&](float x) {
    return static_cast<std::uint64_t>(static_cast<std::uint32_t>(floor_int(x * cells_per_metre)) & 0xfffffu);
  };
  return uniform((part(p.x()) << 40) ^ (part(p.y()) << 20) ^ part(p.z()));
}

}  // namespace

// Everything about one sweep that its beams share.
struct Scanner::Sweep {
  double time_s = 0.0;
  float clear = 1.f;  ///< how far is seen, of what is seen on a clear day
  std::uint64_t key = 0;
  std::vector<Eigen::Matrix<float, 3, 4>> T_world_lidar;  ///< of each column; one where nothing moves
  std::vector<float> cos_azimuth, sin_azimuth;            ///< of each column
  Solids moving;
  std::unique_ptr<RayScene> scene;  ///< of what moves

  float offset_s(std::size_t column, const SensorModel& sensor) const {
    return static_cast<float>(((static_cast<double>(column) + 0.5) / sensor.columns - 0.5) * sensor.sweep_s);
  }
};

Scanner::Scanner(const World& world, SensorModel sensor, const Options& options)
    : world_(world),
      sensor_(std::move(sensor)),
      options_(options),
      scene_(world.solids, world.terrain.cells(), options.embree_options) {
  const std::size_t lines = std::max<std::size_t>(1, sensor_.elevations_deg.size());
  for (double range_m = 0.0; range_m <= sensor_.max_range_m + 2 * kFalloffStep_m; range_m += kFalloffStep_m)
    falloff_.push_back(range_m > sensor_.focus_m ? std::pow(sensor_.focus_m / range_m, sensor_.falloff) : 1.0);
  for (std::size_t i = 0; i < lines; ++i) {
    // All lines are off by the same, as the mounting or the maker's table is, and each by a little of its own.
    const double error_deg = world.difficulty * static_cast<double>(0.12f * gaussian(mix(world.seed_of_day(), 53)) +
                                                                    0.03f * gaussian(mix(world.seed_of_day(), 54, i)));
    const double elevation = sensor_.rotates() ? to_radians(sensor_.elevations_deg[i] + error_deg) : 0.0;
    cos_elevation_.push_back(static_cast<float>(std::cos(elevation)));
    sin_elevation_.push_back(static_cast<float>(std::sin(elevation)));
    // Lines differ as built: the same at every sweep, another sensor another seed.
    gain_.push_back(std::max(0.3f, 1.f + static_cast<float>(sensor_.gain_spread) * gaussian(mix(world.seed, 51, i))));
    bias_m_.push_back(static_cast<float>(sensor_.line_bias_m * (1.0 + world.difficulty)) *
                      gaussian(mix(world.seed, 52, i)));
  }
}

double Scanner::falloff_at(double range_m) const {
  const double position = range_m / kFalloffStep_m;
  const auto i = std::min(static_cast<std::size_t>(position), falloff_.size() - 2);
  return falloff_[i] + (position - static_cast<double>(i)) * (falloff_[i + 1] - falloff_[i]);
}

Pose Scanner::T_world_lidar(double time_s) const {
  Pose T = T_local_lidar(time_s);
  T.translation() += world_.origin;
  return T;
}

Pose Scanner::T_local_lidar(double time_s) const {
  const Knot at = world_.path.at(time_s);
  const double height_m = world_.vehicle.roof_m + sensor_.mast_m;
  Pose T = Pose::Identity();
  if (options_.tilt_deg > 0.0) {  // carried by hand: it sways about itself, now and then as far as it may
    Eigen::Vector3d tilt(1.6 * smooth_noise(mix(world_.seed_of_day(), 64), time_s / 2.3),
                         1.6 * smooth_noise(mix(world_.seed_of_day(), 65), time_s / 2.9), 0.0);
    tilt *= to_radians(options_.tilt_deg) / std::max(1.0, tilt.norm());
    T.translate(Eigen::Vector3d(at.x, at.y, world_.terrain.height(at.x, at.y) + height_m));
    T.rotate(Eigen::AngleAxisd(at.yaw_rad, Eigen::Vector3d::UnitZ()));
    if (tilt.norm() > 0.0) T.rotate(Eigen::AngleAxisd(tilt.norm(), tilt.normalized()));
    return T;
  }
  const double c = std::cos(at.yaw_rad), s = std::sin(at.yaw_rad);
  const auto ground = [&](double forward, double left) {
    return world_.terrain.height(at.x + c * forward - s * left, at.y + s * forward + c * left);
  };
  constexpr double kAxle_m = 1.35, kWheel_m = 0.75;
  const double front = ground(kAxle_m, 0), back = ground(-kAxle_m, 0);
  const double left = ground(0, kWheel_m), right = ground(0, -kWheel_m);
  double pitch = std::atan2(front - back, 2 * kAxle_m), roll = std::atan2(left - right, 2 * kWheel_m);
  double z = 0.25 * (front + back + left + right);
  if (!world_.roads.points().empty()) {             // springs
    const double shakes = 1.0 + world_.difficulty;  // and is loaded otherwise from drive to drive
    pitch += to_radians(0.4) * shakes * smooth_noise(mix(world_.seed_of_day(), 61), time_s / 0.9) +
             to_radians(0.8) * world_.difficulty * smooth_noise(mix(world_.seed_of_day(), 66), time_s / 9.0);
    roll += to_radians(0.5) * shakes * smooth_noise(mix(world_.seed_of_day(), 62), time_s / 1.1);
    z += 0.015 * smooth_noise(mix(world_.seed_of_day(), 63), time_s / 0.7);
  }
  T.translate(Eigen::Vector3d(at.x, at.y, z));
  T.rotate(Eigen::AngleAxisd(at.yaw_rad, Eigen::Vector3d::UnitZ()) *
           Eigen::AngleAxisd(-pitch, Eigen::Vector3d::UnitY()) * Eigen::AngleAxisd(roll, Eigen::Vector3d::UnitX()));
  T.translate(Eigen::Vector3d(0, 0, height_m));
  return T;
}

Eigen::Vector3f Scanner::direction(const Sweep& sweep, std::size_t line, std::size_t column) const {
  if (sensor_.rotates())
    return {cos_elevation_[line] * sweep.cos_azimuth[column], cos_elevation_[line] * sweep.sin_azimuth[column],
            sin_elevation_[line]};
  if (sensor_.is_dome()) {
    // Evenly over the dome, each beam far from the ones before (the Kronecker sequence of the plastic number).
    const double sweeps = std::round(sweep.time_s / sensor_.sweep_s);
    const double beam = sweeps * static_cast<double>(sensor_.columns) + static_cast<double>(column);
    const double azimuth = 2 * kPi * std::fmod(0.7548776662466927 * beam, 1.0);
    const double elevation = to_radians(sensor_.lowest_deg + (sensor_.highest_deg - sensor_.lowest_deg) *
                                                                 std::fmod(0.5698402909980532 * beam, 1.0));
    return Eigen::Vector3d(std::cos(elevation) * std::cos(azimuth), std::cos(elevation) * std::sin(azimuth),
                           std::sin(elevation))
        .cast<float>();
  }
  // Two prisms that turn against each other; their phases go on from sweep to sweep, so that none repeats.
  const double time_s = sweep.time_s + static_cast<double>(sweep.offset_s(column, sensor_)) + sensor_.sweep_s;
  const double a = 2 * kPi * 121.567 * time_s, b = -2 * kPi * 77.731 * time_s;
  const double half = 0.5 * to_radians(sensor_.rosette_half_angle_deg);
  // Six lasers side by side take turns.
  const double beside = to_radians(1.1) * (static_cast<double>(column % 6) - 2.5);
  const double azimuth = half * (std::cos(a) + std::cos(b)) + beside, elevation = half * (std::sin(a) + std::sin(b));
  return Eigen::Vector3d(std::cos(elevation) * std::cos(azimuth), std::cos(elevation) * std::sin(azimuth),
                         std::sin(elevation))
      .cast<float>();
}

// What a neighbouring beam has met is tried first: mostly it is met again, and the search need not look behind it.
Met Scanner::expect(const Ray& ray, const Met& neighbour) const {
  const auto reach_m = static_cast<float>(sensor_.max_range_m);
  float range_m = std::numeric_limits<float>::infinity();
  if (neighbour.what == Met::What::kSolid) range_m = intersect(world_.solids[neighbour.index], ray, reach_m);
  if (neighbour.what == Met::What::kGround) range_m = intersect(world_.terrain.cells()[neighbour.index], ray, reach_m);
  return range_m < reach_m ? Met{range_m, neighbour.what, neighbour.index} : Met{reach_m, Met::What::kNothing, 0};
}

Hit Scanner::look_at(const Sweep& sweep, const Ray& ray, const Met& met) const {
  constexpr float kBeyond = std::numeric_limits<float>::infinity();
  Hit hit;
  if (met.what != Met::What::kGround) {
    intersect(met.what == Met::What::kSolid ? world_.solids[met.index] : sweep.moving[met.index], ray, kBeyond, &hit);
    return hit;
  }
  hit.range_m = intersect(world_.terrain.cells()[met.index], ray, kBeyond, &hit.normal);
  const auto ground_at = [&](float range_m) {
    return world_.ground_at(ray.origin.x() + range_m * ray.direction.x(), ray.origin.y() + range_m * ray.direction.y());
  };
  const Ground ground = ground_at(hit.range_m);
  hit.material = ground.material;
  if (ground.lift_m > 0.f) {  // the surface lies higher: the beam meets it, or its kerb, earlier
    float outside = hit.range_m - ground.lift_m / std::max(0.02f, -hit.normal.dot(ray.direction)), inside = hit.range_m;
    if (outside > 0.f && ground_at(outside).lift_m > 0.f) {
      hit.range_m = outside;
    } else {
      outside = std::max(0.f, outside);
      for (int i = 0; i < 5; ++i) {
        const float middle = 0.5f * (outside + inside);
        (ground_at(middle).lift_m > 0.f ? inside : outside) = middle;
      }
      hit.range_m = inside;
      hit.normal = -Eigen::Vector3f(ray.direction.x(), ray.direction.y(), 0.f).normalized();
    }
  }
  return hit;
}

Scanner::Return Scanner::measure(const Ray& ray, const Met& met, const Hit& hit, std::size_t line, float clear,
                                 std::uint64_t key) const {
  const Surface& surface = surface_of(hit.material);
  const Eigen::Vector3f p = ray.origin + hit.range_m * ray.direction;
  const float facing = std::abs(hit.normal.dot(ray.direction));
  float range_m = hit.range_m;
  if (surface.roughness_m > 0.f && met.what != Met::What::kMoving)
    range_m += surface.roughness_m * (2.f * texture(p, 7.f) - 1.f) / std::max(0.3f, facing);
  const float facing2 = facing * facing, facing4 = facing2 * facing2, facing8 = facing4 * facing4;
  const float gloss = surface.gloss * facing8 * facing8;  // what comes straight back from a mirror
  const float response = (1.f - surface.gloss) * (1.f - surface.flatness * (1.f - facing)) + gloss;
  float strength = surface.reflectance * response * (1.f + surface.spread * (2.f * uniform(hit.object) - 1.f));
  if (met.what != Met::What::kMoving) strength *= 0.88f + 0.24f * texture(p, 2.f);

  // Weak answers get lost: sure to be seen well within the range, never beyond it.
  const float visible_m = static_cast<float>(sensor_.visible_10_percent_m) * clear;
  const float margin = strength * 10.f * (visible_m / range_m) * (visible_m / range_m);
  const std::uint64_t dice = mix(key, 1);
  const float luck = static_cast<float>(dice >> 40) * 0x1p-24f, chance = static_cast<float>(dice & 0xffffff) * 0x1p-24f;
  if (luck * 0.6f + 0.7f > margin || chance < static_cast<float>(sensor_.drop_out + 0.05 * world_.difficulty))
    return {};

  const double measured_m =
      static_cast<double>(range_m + bias_m_[line] + static_cast<float>(sensor_.range_noise_m) * gaussian(mix(key, 2)));
  const double stepped_m = sensor_.range_step_m * floor_int(measured_m / sensor_.range_step_m + 0.5);
  if (!(stepped_m >= sensor_.min_range_m && stepped_m <= sensor_.max_range_m)) return {};

  double reading = static_cast<double>(strength * gain_[line] *
                                       (1.f + static_cast<float>(sensor_.intensity_noise) * gaussian(mix(key, 3)))) *
                   sensor_.intensity_scale;
  reading *= falloff_at(stepped_m);
  if (chance > 1.f - static_cast<float>(sensor_.dark)) reading = 0.0;
  reading = std::clamp(sensor_.intensity_step * floor_int(reading / sensor_.intensity_step + 0.5), 0.0,
                       sensor_.intensity_max);
  Return result;
  result.is_there = true;
  result.point = {static_cast<float>(stepped_m), 0.f, 0.f, static_cast<float>(reading)};
  return result;
}

// A beam on an edge measures both of its sides: something in between.
void Scanner::mix_at_edge(const Return& before, Return& here, std::uint64_t key) const {
  constexpr float kNearest_m = 0.3f, kFarthest_m = 4.f;
  const float step_m = std::abs(before.point.x - here.point.x);
  if (!before.is_there || !here.is_there || step_m < kNearest_m || step_m > kFarthest_m) return;
  const float dice = uniform(mix(key, 5)), share = static_cast<float>(0.3 * world_.difficulty);
  if (dice >= share) return;
  here.point.x += dice / share * (before.point.x - here.point.x);
}

// Beams that look down on the vehicle itself come back from too near, and so do those that meet what stands behind the
// sensor. A sensor carried by hand has no roof below it.
bool Scanner::is_hidden_by_carrier(const Eigen::Vector3f& direction) const {
  if (options_.blind_deg > 0.0 &&
      std::abs(std::atan2(double{direction.y()}, -double{direction.x()})) < to_radians(0.5 * options_.blind_deg))
    return true;
  if (direction.z() >= 0.f || options_.tilt_deg > 0.0) return false;
  const float reach = static_cast<float>(sensor_.mast_m) / -direction.z();
  return std::abs(reach * direction.x()) < static_cast<float>(world_.vehicle.half_length_m) &&
         std::abs(reach * direction.y()) < static_cast<float>(world_.vehicle.half_width_m);
}

void Scanner::cast(const Sweep& sweep, std::size_t first, std::size_t count, Return* returns) const {
  Met neighbour;
  Return before;
  const float season = world_.season(sweep.time_s);
  std::array<Ray, RayScene::kPacket> rays;
  std::array<Met, RayScene::kPacket> mets;
  const auto columns = static_cast<std::size_t>(sensor_.columns);
  for (std::size_t packet = first; packet < first + count; packet += rays.size()) {
    const std::size_t size = std::min(rays.size(), first + count - packet);
    std::array<Eigen::Vector3f, RayScene::kPacket> in_lidar;
    for (std::size_t i = 0; i < size; ++i) {
      const std::size_t line = (packet + i) / columns, column = (packet + i) % columns;
      in_lidar[i] = direction(sweep, line, column);
      const auto& T = sweep.T_world_lidar[sweep.T_world_lidar.size() == 1 ? 0 : column];
      rays[i] = {T.col(3), T.leftCols<3>() * in_lidar[i],
                 options_.motion_distortion ? sweep.offset_s(column, sensor_) : 0.f, season};
      mets[i] = expect(rays[i], neighbour);
    }
    scene_.trace(std::span(rays).first(size), mets.data());
    if (sweep.scene) sweep.scene->trace(std::span(rays).first(size), mets.data());
    neighbour = mets[size - 1];
    for (std::size_t i = 0; i < size; ++i) {
      Return& result = returns[packet + i - first];
      result.is_there = false;
      if (mets[i].what == Met::What::kNothing || is_hidden_by_carrier(in_lidar[i])) {
        before.is_there = false;
        continue;
      }
      const std::size_t beam = packet + i;
      result = measure(rays[i], mets[i], look_at(sweep, rays[i], mets[i]), beam / columns, sweep.clear,
                       mix(sweep.key, beam));
      if (world_.difficulty > 0.0 && sensor_.rotates()) {
        const Return unmixed = result;
        mix_at_edge(before, result, mix(sweep.key, beam));
        before = unmixed;
      }
      const float range_m = result.point.x;
      result.point.x = range_m * in_lidar[i].x();
      result.point.y = range_m * in_lidar[i].y();
      result.point.z = range_m * in_lidar[i].z();
    }
  }
}

Scan Scanner::sweep(std::int64_t frame, double time_s) const {
  const auto columns = static_cast<std::size_t>(sensor_.columns);
  const double half_s = 0.5 * sensor_.sweep_s;
  Sweep sweep;
  sweep.time_s = time_s;
  sweep.clear = static_cast<float>(
      std::exp(-0.03 * world_.difficulty * (1.0 + smooth_noise(mix(world_.seed_of_day(), 55), time_s / kWeather_s))));
  sweep.key = mix(world_.seed_of_day(), 71, static_cast<std::uint64_t>(frame));
  sweep.moving = world_.movers.at(time_s, world_.path, [this](double x, double y) { return world_.stand_z(x, y); });
  if (!sweep.moving.empty()) sweep.scene = std::make_unique<RayScene>(scene_, sweep.moving, static_cast<float>(half_s));

  if (options_.motion_distortion) {
    std::vector<Eigen::Matrix<float, 3, 4>> knots;
    for (std::size_t k = 0; k < kPoseKnots; ++k)
      knots.push_back(T_local_lidar(time_s - half_s + sensor_.sweep_s * static_cast<double>(k) / (kPoseKnots - 1))
                          .matrix()
                          .topRows<3>()
                          .cast<float>());
    for (std::size_t c = 0; c < columns; ++c) {
      const float position =
          (static_cast<float>(c) + 0.5f) / static_cast<float>(columns) * static_cast<float>(kPoseKnots - 1);
      const auto k = std::min(static_cast<std::size_t>(position), kPoseKnots - 2);
      sweep.T_world_lidar.push_back(knots[k] + (position - static_cast<float>(k)) * (knots[k + 1] - knots[k]));
    }
  } else {
    sweep.T_world_lidar.push_back(T_local_lidar(time_s).matrix().topRows<3>().cast<float>());
  }
  const double phase = static_cast<double>(uniform(mix(sweep.key, 4)));
  for (std::size_t c = 0; c < columns && sensor_.rotates(); ++c) {  // from behind, over the left... to behind
    const double azimuth = 2 * kPi * (static_cast<double>(c) + phase) / sensor_.columns - kPi;
    sweep.cos_azimuth.push_back(static_cast<float>(std::cos(azimuth)));
    sweep.sin_azimuth.push_back(static_cast<float>(std::sin(azimuth)));
  }

  constexpr std::size_t kChunk = 1000;
  std::vector<Return> returns(sensor_.beams());
  tbb::task_arena arena(threads_to_use(options_.threads));
  arena.execute([&] {
    tbb::parallel_for(std::size_t{0}, (returns.size() + kChunk - 1) / kChunk, [&](std::size_t chunk) {
      const std::size_t first = chunk * kChunk;
      cast(sweep, first, std::min(kChunk, returns.size() - first), returns.data() + first);
    });
  });

  Scan scan;
  scan.frame = FrameId{frame};
  scan.stamp_s = time_s;
  const auto count = static_cast<std::size_t>(
      std::count_if(returns.begin(), returns.end(), [](const Return& r) { return r.is_there; }));
  scan.points.reserve(count);
  if (sensor_.rotates()) scan.rings.reserve(count);
  if (options_.motion_distortion) scan.times_s.reserve(count);
  for (std::size_t beam = 0; beam < returns.size(); ++beam) {
    if (!returns[beam].is_there) continue;
    scan.points.push_back(returns[beam].point);
    if (sensor_.rotates()) scan.rings.push_back(static_cast<std::uint16_t>(beam / columns));
    if (options_.motion_distortion) scan.times_s.push_back(sweep.offset_s(beam % columns, sensor_));
  }
  return scan;
}

}  // namespace revisit::simulation_internal
