/// A sweep over a parameter of a small scene: how much of its processor time the steps take, the memory it
/// needs, and both processors at once.  Before that what a step by direct() takes in the first and in the
/// last members of a sweep over a scene of one's own, whose stage kernel is compiled on the way.
#include <sys/resource.h>

#include <chrono>
#include <cmath>
#include <cstdlib>
#include <diracstep/core/runs/run.hpp>
#include <diracstep/scene_format/scene_file.hpp>
#include <diracstep/scene_format/scene_text.hpp>
#include <diracstep/solvers/direct_solver.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>
#include <diracstep/sweeps/sweep_folder.hpp>
#include <filesystem>
#include <string>

#include "timing.hpp"

using namespace diracstep;

namespace {

constexpr long steps = 1000;

Sweep orbits(long members) {
  Sweep sweep;
  sweep.file = sweep.text = "bench/sweeps " + std::to_string(members);
  sweep.scene = "kepler_e06";
  sweep.method = "type1/gl:3";
  sweep.step = 0.05;
  sweep.end = 0.05 * steps;
  sweep.draws = members;
  sweep.drawn = {{"e", Drawn::Law::uniform, 0.0, 0.7}};
  sweep.values = {"x", "energy"};
  return sweep;
}

/// Of the steps alone, for members spread over the sweep.
double seconds_of_steps(const Sweep& sweep, const SceneFile& file, const Registry& registry) {
  constexpr long samples = 500;
  double seconds = 0.0;
  for (long k = 0; k < samples; ++k) {
    const CatalogueScene entry = file.load({{"e", sweep.member(k * sweep.members() / samples)[0]}});
    Integrator integrator(entry.scene, registry, kinsol(), {.method = sweep.method, .step = sweep.step});
    const double before = processor_seconds();
    for (long n = 0; n < steps; ++n)
      if (!integrator.step().ok()) break;
    seconds += processor_seconds() - before;
  }
  return seconds / samples * static_cast<double>(sweep.members());
}

void compare_members_of_own_scene(const Registry& registry) {
  constexpr long members = 1000, compared = 50;
  const auto cache = std::filesystem::temp_directory_path() / "diracstep_bench_sweeps_cache";
  std::filesystem::remove_all(cache);
  setenv("DIRACSTEP_CACHE", cache.c_str(), 1);
  std::string text = scene_text("kepler_e06");
  const std::string potential = "1/sqrt(x^2 + y^2)";
  text.replace(text.find(potential), potential.size(), "1.0625/sqrt(x^2 + y^2)");  // not in the catalogue
  const SceneFile file("own.toml", text);
  double first = HUGE_VAL, last = HUGE_VAL;  // the fastest member of each end
  for (long k = 0; k < members; ++k) {
    const CatalogueScene entry = file.load({{"e", 0.6 + 1e-6 * static_cast<double>(k)}});
    Integrator integrator(entry.scene, registry, direct(), {.method = "type1/gl:3", .step = 0.05});
    const double before = processor_seconds();
    for (long n = 0; n < steps; ++n)
      if (!integrator.step().ok()) std::printf("a step failed\n");
    const double ns = 1e9 * (processor_seconds() - before) / steps;
    if (k < compared) first = std::min(first, ns);
    if (k >= members - compared) last = std::min(last, ns);
  }
  std::printf("a scene of one's own, direct, ns a step: %.0f in the first members, %.0f in the last\n", first,
              last);
  std::filesystem::remove_all(cache);
}

}  // namespace

int main(int count, char** arguments) {
  const long members = count > 1 ? std::stol(arguments[1]) : 20000;
  const Registry registry = Registry::with_built_ins();
  compare_members_of_own_scene(registry);
  const SceneFile file = scene_source("kepler_e06");
  const auto folder = std::filesystem::temp_directory_path() / "diracstep_bench_sweeps";
  std::printf("kepler_e06, type1/gl:3, e varied, %ld steps a member\n", steps);
  std::printf("%10s%10s%10s%12s%12s%12s%12s%12s\n", "members", "checks", "threads", "seconds", "processor",
              "in steps", "processors", "memory");
  for (const auto& [size, checks] : {std::pair{members / 10, true}, {members / 10, false}, {members, false}})
    for (const int threads : {1, 2}) {
      std::filesystem::remove_all(folder);
      Sweep sweep = orbits(size);
      sweep.checks = checks;
      const auto begin = std::chrono::steady_clock::now();
      const double before = processor_seconds();
      const SweepReport report =
          run_sweep(sweep, [&](const Parameters& changes) { return file.load(changes); }, registry, kinsol(),
                    {.folder = folder.string(), .threads = threads});
      const double processor = processor_seconds() - before;
      const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
      rusage usage{};
      getrusage(RUSAGE_SELF, &usage);
      if (report.ok != size) std::printf("%ld members are not ok\n", size - report.ok);
      std::printf("%10ld%10s%10d%12.2f%12.2f%11.0f%%%12.2f%9ld MB\n", size, checks ? "yes" : "no", threads,
                  seconds, processor, 100.0 * seconds_of_steps(sweep, file, registry) / processor,
                  processor / seconds, usage.ru_maxrss / 1024);
    }
  std::filesystem::remove_all(folder);
}
