/// What a gradient by the adjoint takes in units of the motion's own processor time: the gradient of a
/// function of the end by the whole start, on scenes from two coordinates to hundreds; and what the forward
/// derivatives by the whole start take.  SCENE METHOD as arguments: those alone.
#include <cstdio>
#include <diracstep/scene_format/scene_catalogue.hpp>
#include <diracstep/sensitivities/sensitivities.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>
#include <string>

#include "timing.hpp"

using namespace diracstep;

namespace {

constexpr long steps = 200;

void measure(const std::string& name, const std::string& method) {
  const CatalogueScene entry = make_scene(name);
  const Registry registry = Registry::with_built_ins();
  const IntegratorOptions options{.method = method, .step = entry.natural_step};
  Integrator integrator(entry.scene, registry, kinsol(), options);
  const int n = entry.scene->dimension();
  Sensitivities sensitivities(integrator, registry);
  ReadDirections weights{Columns::Ones(n, 1), {}, {}};
  const auto gradient = [&](long every) {
    integrator.reset();
    (void)sensitivities.gradient(steps, [&](long, const Sample&) { return weights; }, 0, {every});
  };
  const auto motion = [&] {
    integrator.record_stages(false);
    integrator.reset();
    for (long k = 0; k < steps; ++k) (void)integrator.step();
    integrator.record_stages(true);
  };
  const auto forward = [&] {
    integrator.reset();
    Directions z = Directions::Identity(2 * n, 2 * n);
    (void)sensitivities.jvp(steps, z);
  };
  const std::vector<double> times =
      fewest_nanoseconds({motion, [&] { gradient(steps); }, [&] { gradient(20); }, forward}, steps, 5);
  std::printf("%-20s %-30s %4d %8.2f %8.2f %8.2f %8.2f\n", name.c_str(), method.c_str(), n, 1e-3 * times[0],
              times[1] / times[0], times[2] / times[0], times[3] / times[0]);
}

}  // namespace

int main(int count, char** arguments) {
  std::printf("%-20s %-30s %4s %8s %8s %8s %8s\n", "scene", "method", "n", "us/step", "gradient", "by 20",
              "forward");
  if (count > 2) return measure(arguments[1], arguments[2]), 0;
  for (const char* scene :
       {"kepler_e06", "chaplygin_sleigh", "pendulum_cartesian", "double_pendulum", "pleiades", "lc_circuit",
        "ida_slider_crank", "fput", "toda_200", "hanging_chain"})
    for (const char* method : {"type1/gl:2", "type1/gl:4"}) measure(scene, method);
  for (const char* scene : {"kepler_e06", "chaplygin_sleigh", "pleiades"})
    for (const char* method : {"type1/trapezoidal", "type2/legendre(type1/midpoint)", "damped/radau:3"})
      measure(scene, method);
}
