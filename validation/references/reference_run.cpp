#include <cmath>
#include <ctime>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/spaces/space.hpp>
#include <diracstep/validation/references/reference_run.hpp>
#include <limits>
#include <sstream>

namespace diracstep {

const char* name(DaeFormulation formulation) {
  switch (formulation) {
    case DaeFormulation::rates:
      return "rates";
    case DaeFormulation::rates_loose:
      return "rates-loose";
    case DaeFormulation::index_2:
      return "index-2";
    case DaeFormulation::velocity:
      return "velocity";
  }
  return "unknown";
}

void require_reference(const char* integrator, const Scene& scene, double t_end,
                       const ReferenceOptions& options) {
  const auto require = [&](bool allowed, const char* option, double value, const char* which) {
    if (allowed) return;
    std::ostringstream message;
    message << integrator << ": " << option << " = " << value << "; " << which;
    throw Misuse(message.str());
  };
  require_consistent(scene, scene.start);
  require(t_end > scene.start.time && std::isfinite(t_end), "t_end", t_end,
          "a finite time after the start is needed");
  require(options.rtol >= 1e-14 && options.rtol <= 1e-1, "rtol", options.rtol,
          "it must lie in [1e-14, 1e-1]");
  if (options.sizes.size() != 0 && options.sizes.size() != scene.storage_size() + 2 * scene.dimension())
    throw Misuse("the sizes of a baseline are those of q, v and p");
  require(options.atol >= 0.0 && std::isfinite(options.atol), "atol", options.atol,
          "a finite number, 0 or more, is needed");
  require(options.max_steps >= 1, "max_steps", static_cast<double>(options.max_steps), "1 or more is needed");
}

void put_on_space(const Scene& scene, ReferenceRun& run) {
  if (!scene.space) return;
  const Vector numbers = run.end.q;
  run.end.q = scene.space->normalised(numbers);
  run.off_space = (run.end.q - numbers).lpNorm<Eigen::Infinity>();
}

int largest_full_system() {
#ifdef DIRACSTEP_WITH_KLU
  return 40;
#else
  return std::numeric_limits<int>::max();
#endif
}

double thread_seconds() {
  std::timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

}  // namespace diracstep
