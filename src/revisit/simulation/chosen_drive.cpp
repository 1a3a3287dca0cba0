// SPDX-License-Identifier: Apache-2.0
#include <revisit/core/text.hpp>
#include <revisit/simulation/internal/world.hpp>

namespace revisit::simulation_internal {

Status choose_drive(World& world, const SimulationOptions& options) {
  world.day = options.day;
  const double end_m = world.path.length_m(), to_m = options.to_m > 0.0 ? options.to_m : end_m;
  if (options.from_m == 0.0 && to_m >= end_m && options.beside_m == 0.0 && !options.reverse) return ok();
  Path part = world.path.part(options.from_m, to_m, options.beside_m, options.reverse);
  if (part.knots().empty())
    return Error{format("simulation.from_m = %g and simulation.to_m = %g leave nothing of a way of %.0f m",
                        options.from_m, options.to_m, end_m)};
  world.path = std::move(part);
  return ok();
}

}  // namespace revisit::simulation_internal
