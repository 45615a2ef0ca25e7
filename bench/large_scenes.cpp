/// Large scenes: processor time of a step and resident memory, for each unknown, from a thousand to a million
/// unknowns; beside it the bare KLU work and evaluations of such a step.
///   large_scenes [LARGEST]   default 1e6 unknowns, some minutes; memory is read from /proc and left out
///   elsewhere
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <diracstep/core/integrator.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>
#include <diracstep/validation/scene_catalogue.hpp>
#include <fstream>
#include <string>

#include "timing.hpp"

using namespace diracstep;

namespace {

/// Kilobytes of this program that are in memory; 0 where that cannot be known.
double resident_kilobytes() {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);)
    if (line.starts_with("VmRSS:")) return std::strtod(line.c_str() + 6, nullptr);
  return 0.0;
}

/// Step sizes that grow with the length of a link, so that every size has the same step beside its fastest
/// motion.
void measure(const char* scene, const char* method, int unknowns, int rows_of_each_site, double step) {
  const int sites = unknowns / rows_of_each_site;
  const CatalogueScene entry = make_scene(scene, {{"N", double(sites)}});
  const double before = resident_kilobytes();
  Integrator integrator(entry.scene, Registry::with_built_ins(), kinsol(), {.method = method, .step = step});
  const int warm_up = 8, steps = std::max(4, 40000 / unknowns);
  for (int k = 0; k < warm_up; ++k)
    if (!integrator.step().ok()) {
      std::printf("%-14s%-17s%10d  failed\n", scene, method, unknowns);
      return;
    }
  const Work start = integrator.work();
  const auto ns = fewest_nanoseconds({[&] {
                                       for (int k = 0; k < steps; ++k) (void)integrator.step();
                                     }},
                                     steps, 3);
  const Work end = integrator.work();
  const auto each = [&](long from, long to) { return double(to - from) / double(end.steps - start.steps); };
  std::printf(
      "%-14s%-17s%10d%12.1f%12.2f%12.2f%12.2f%12.3f\n", scene, method, unknowns, ns[0] / unknowns,
      each(start.iterations, end.iterations), each(start.residual_evaluations, end.residual_evaluations),
      each(start.jacobian_evaluations, end.jacobian_evaluations), (resident_kilobytes() - before) / unknowns);
}

constexpr const char* usage = "large_scenes [LARGEST | SCENE METHOD UNKNOWNS]\n";

}  // namespace

/// Each measurement is a program of its own, so that the memory of one is not that of the next.
int main(int argc, char** argv) {
  const auto number = [&](int k) { return std::strtod(argv[k], nullptr); };
  if (argc == 4) {
    const int n = static_cast<int>(number(3));
    const bool chain = std::string(argv[1]) == "hanging_chain";
    measure(argv[1], argv[2], n, chain ? 3 : 1, chain ? 0.25 * 3.0 / n : 0.05);
    return 0;
  }
  if (argc > 2) return std::fputs(usage, stderr), 2;
  const double largest = argc > 1 ? number(1) : 1e6;
  std::printf("%-14s%-17s%10s%12s%12s%12s%12s%12s\n", "scene", "method", "unknowns", "ns/unknown",
              "iterations", "residuals", "Jacobians", "kB/unknown");
  for (const char* what :
       {"hanging_chain type1/midpoint", "hanging_chain type1/trapezoidal", "toda_200 type1/midpoint"})
    for (double unknowns = 1000; unknowns <= largest; unknowns *= 10) {
      std::fflush(stdout);
      const std::string command =
          std::string("\"") + argv[0] + "\" " + what + " " + std::to_string(static_cast<long>(unknowns));
      if (std::system(command.c_str()) != 0) return 1;
    }
}
