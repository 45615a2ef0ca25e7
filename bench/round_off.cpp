/// Energy error by round-off over many steps of the contact oscillator, where truncation is below it, with
/// plain and with compensated sums.
///
///   round_off [STEPS]     10^6 without it
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <diracstep/core/integrator/integrator.hpp>
#include <diracstep/scene_format/scene_catalogue.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>

#include "timing.hpp"

namespace {

using namespace diracstep;

struct Rung {
  const char* method;
  int order;
  double step;
};

/// Mean energy error in each tenth, in units of 1e-15, and the time a step takes.
void follow(const CatalogueScene& scene, const Rung& rung, bool compensated, long steps) {
  Integrator integrator(
      scene.scene, Registry::with_built_ins(), kinsol(),
      {.method = rung.method, .order = rung.order, .step = rung.step, .compensated_sums = compensated});
  const Start start = scene.scene->start;
  const double energy = scene.scene->energy(start.time, start.q, start.v);
  constexpr long every = 97;
  std::array<double, 10> sum{};
  std::array<long, 10> count{};
  Sample sample;
  const double before = processor_seconds();
  double reading = 0.0;
  for (long k = 0; k < steps; ++k) {
    if (!integrator.step().ok()) return;
    if (k % every != 0) continue;
    const double pause = processor_seconds();
    if (!integrator.sample(Momentum::projected, sample).ok()) return;
    reading += processor_seconds() - pause;
    const auto tenth = static_cast<std::size_t>(10 * k / steps);
    sum.at(tenth) += sample.energy - energy;
    ++count.at(tenth);
  }
  const double seconds = processor_seconds() - before - reading;
  std::printf("| %s, order %d, h = %g | %s |", rung.method, rung.order, rung.step,
              compensated ? "compensated" : "plain");
  for (std::size_t i = 0; i < 10; ++i) std::printf(" %+.1f", 1e15 * sum[i] / static_cast<double>(count[i]));
  std::printf(" | %.2f µs |\n", 1e6 * seconds / static_cast<double>(steps));
  std::fflush(stdout);
}

}  // namespace

int main(int count, char** arguments) {
  const long steps = count > 1 ? std::atol(arguments[1]) : 1'000'000;
  const CatalogueScene scene = make_scene("contact_oscillator");
  std::printf("contact_oscillator, %ld steps: mean energy error in each tenth, in 1e-15\n\n", steps);
  std::printf("| step | sums | tenths | time a step |\n|---|---|---|---|\n");
  for (const Rung& rung :
       {Rung{"type1/gl:4", 8, 0.05}, Rung{"type1/gl:6", 12, 0.1}, Rung{"type1/midpoint", 8, 0.05}})
    for (const bool compensated : {false, true}) follow(scene, rung, compensated, steps);
  return 0;
}
