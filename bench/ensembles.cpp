/// Many starts of one scene over threads: wall-clock time of an ensemble, and whether the ends have the same
/// bits as on one thread.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <diracstep/core/runs/ensemble.hpp>
#include <diracstep/scene_format/scene_catalogue.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>
#include <thread>

#include "timing.hpp"

using namespace diracstep;

namespace {

constexpr int members = 256;
constexpr long steps = 2000;

std::vector<EnsembleMember> ends(const CatalogueScene& entry, const std::vector<Start>& starts, int threads) {
  return run_ensemble(entry.scene, Registry::with_built_ins(), kinsol(),
                      {.method = "type1/gl:3", .step = 0.02}, starts, steps, Momentum::projected, threads);
}

bool same_bits(const std::vector<EnsembleMember>& a, const std::vector<EnsembleMember>& b) {
  for (std::size_t k = 0; k < a.size(); ++k)
    if (a[k].end.q != b[k].end.q || a[k].end.p != b[k].end.p) return false;
  return true;
}

}  // namespace

int main() {
  const CatalogueScene entry = make_scene("double_pendulum");
  std::vector<Start> starts(members, entry.scene->start);
  for (int k = 0; k < members; ++k) starts[static_cast<std::size_t>(k)].q[0] += 1e-3 * k;
  const int processors = static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
  std::printf("double_pendulum, type1/gl:3: %d starts of %ld steps on %d processors\n", members, steps,
              processors);
  std::printf("%8s%12s%10s%12s\n", "threads", "seconds", "speed-up", "same bits");
  std::vector<EnsembleMember> serial;
  double alone = 0.0;
  for (int threads = 1; threads <= processors; threads *= 2) {
    double fewest = HUGE_VAL;
    bool same = true;
    for (int round = 0; round < 3; ++round) {
      const auto before = std::chrono::steady_clock::now();
      auto found = ends(entry, starts, threads);
      fewest =
          std::min(fewest, std::chrono::duration<double>(std::chrono::steady_clock::now() - before).count());
      if (threads == 1)
        serial = std::move(found);
      else
        same = same && same_bits(found, serial);
    }
    if (threads == 1) alone = fewest;
    std::printf("%8d%12.3f%10.2f%12s\n", threads, fewest, alone / fewest, same ? "yes" : "NO");
  }
}
