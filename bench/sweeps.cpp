/// A sweep over a parameter of a small scene: how much of its processor time the steps take, the memory it
/// needs, and both processors at once.
#include <sys/resource.h>

#include <chrono>
#include <diracstep/core/runs/run.hpp>
#include <diracstep/scene_format/scene_file.hpp>
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

}  // namespace

int main(int count, char** arguments) {
  const long members = count > 1 ? std::stol(arguments[1]) : 20000;
  const Registry registry = Registry::with_built_ins();
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
