/// A new Jacobian in each iteration against one kept for as long as it converges, from which
/// JacobianPolicy::automatic was chosen: nanoseconds of a step, and iterations.
#include <cstdio>
#include <diracstep/core/integrator/integrator.hpp>
#include <diracstep/scene_format/scene_catalogue.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>
#include <map>
#include <memory>
#include <string>

#include "timing.hpp"

using namespace diracstep;

namespace {

constexpr int steps = 200, rounds = 6;

struct Case {
  const char* scene;
  std::map<std::string, double> sizes = {};
};

std::unique_ptr<Integrator> integrator(const CatalogueScene& entry, const char* method,
                                       JacobianPolicy policy) {
  KinsolOptions options;
  options.jacobian = policy;
  return std::make_unique<Integrator>(entry.scene, Registry::with_built_ins(), kinsol(options),
                                      IntegratorOptions{.method = method, .step = entry.natural_step / 2.0});
}

void compare(const Case& of, const char* method) {
  const CatalogueScene entry = make_scene(of.scene, of.sizes);
  const auto fresh = integrator(entry, method, JacobianPolicy::fresh),
             kept = integrator(entry, method, JacobianPolicy::kept);
  const auto run = [](Integrator& from_start) {
    return [&from_start] {
      from_start.reset();
      for (int k = 0; k < steps; ++k)
        if (!from_start.step().ok()) return;
    };
  };
  const auto ns = fewest_nanoseconds({run(*fresh), run(*kept)}, steps, rounds);
  const Scene& scene = fresh->scene();
  const bool full = matrix_form(scene, as_measured).full;
  const auto problem = Registry::with_built_ins().method(method).make_step(scene, {.dense = full});
  const auto iterations = [](const Integrator& of_run) { return double(of_run.work().iterations) / steps; };
  std::printf("%-20s%-16s%9d%9d%10.0f%6.2f%10.0f%6.2f%12.2f\n", of.scene, method, problem->size(),
              problem->pattern().nonzeros(), ns[0], iterations(*fresh), ns[1], iterations(*kept),
              ns[1] / ns[0]);
}

}  // namespace

int main() {
  std::printf("%-20s%-16s%9s%9s%10s%6s%10s%6s%12s\n", "scene", "method", "unknowns", "entries", "fresh, ns",
              "it", "kept, ns", "it", "kept/fresh");
  for (const char* method : {"type1/midpoint", "type1/gl:2", "type1/gl:3"})
    for (const Case& of : {Case{"kepler_e06"},
                           {"pendulum_cartesian"},
                           {"chaplygin_sleigh"},
                           {"fput"},
                           {"car_axis"},
                           {"toda_200", {{"N", 4}}},
                           {"toda_200", {{"N", 12}}},
                           {"toda_200", {{"N", 16}}},
                           {"toda_200", {{"N", 40}}},
                           {"toda_200", {{"N", 200}}},
                           {"toda_200", {{"N", 1000}}},
                           {"andrews_squeezer"},
                           {"n_four_bar", {{"N", 3}}},
                           {"n_four_bar", {{"N", 8}}},
                           {"pleiades"},
                           {"outer_solar_system"},
                           {"hanging_chain", {{"N", 4}}},
                           {"hanging_chain", {{"N", 12}}}})
      compare(of, method);
}
