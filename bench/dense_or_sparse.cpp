/// Full matrices against KLU on hanging_chain and toda: processor time of a step by size, from which the
/// default of IntegratorOptions::dense_limit is chosen.
#include <cstdio>
#include <diracstep/core/integrator.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>
#include <diracstep/validation/scene_catalogue.hpp>

#include "timing.hpp"

using namespace diracstep;

namespace {

void compare(const char* scene, const char* method, int sites, double step) {
  const CatalogueScene entry = make_scene(scene, {{"N", double(sites)}});
  constexpr int steps = 200, rounds = 6;
  const auto with_limit = [&](int limit) {
    return std::make_unique<Integrator>(
        entry.scene, Registry::with_built_ins(), kinsol(),
        IntegratorOptions{.method = method, .step = step, .dense_limit = limit});
  };
  const auto full = with_limit(1 << 30), sparse = with_limit(0);
  const auto run = [](Integrator& integrator) {
    return [&integrator] {
      integrator.reset();
      for (int k = 0; k < steps; ++k) (void)integrator.step();
    };
  };
  const auto ns = fewest_nanoseconds({run(*full), run(*sparse)}, steps, rounds);
  std::printf("%-14s%-15s%6d%10.0f%10.0f%8.2f\n", scene, method,
              entry.scene->dimension() + entry.scene->rows(), ns[0], ns[1], ns[0] / ns[1]);
}

}  // namespace

int main() {
  std::printf("%-14s%-15s%6s%10s%10s%8s\n", "scene", "method", "n+m", "full, ns", "KLU, ns", "ratio");
  for (const char* method : {"type1/midpoint", "type1/gl:3"}) {
    for (const int links : {2, 4, 6, 8, 12, 16, 24, 32}) compare("hanging_chain", method, links, 0.1 / links);
    for (const int sites : {4, 8, 12, 16, 24, 32, 48, 64}) compare("toda_200", method, sites, 0.05);
  }
}
