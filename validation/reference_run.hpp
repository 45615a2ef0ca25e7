#pragma once

#include <diracstep/core/integrator.hpp>
#include <string>

namespace diracstep {

struct ReferenceOptions {
  double rtol = 1e-8;  ///< relative tolerance, in [1e-14, 1e-1]
  double atol = 0.0;   ///< absolute tolerance on every component that has an error test; 0 takes rtol
  long max_steps = 5'000'000;
};

/// One run of an integrator of the continuous system.  `failure` is empty, or says why and where it stopped;
/// the state is then the last one reached.
struct ReferenceRun {
  std::string failure;
  Sample end;  ///< q, v, p, the multipliers as forces, and the energy at the end
  long steps = 0;
  long residual_evaluations = 0;  ///< of an explicit method: of the right-hand side
  long jacobian_evaluations = 0;
  long newton_iterations = 0;
  long error_test_failures = 0;
  double cpu_seconds = 0.0;  ///< thread time of the start and the integration, without set-up

  bool ok() const { return failure.empty(); }
};

/// Throws Misuse, naming the integrator, unless the scene's start is consistent, t_end is a finite time after
/// it, and the options are in their ranges.
void require_reference(const char* integrator, const Scene& scene, double t_end,
                       const ReferenceOptions& options);

/// CPU time of the calling thread.
double thread_seconds();

}  // namespace diracstep
