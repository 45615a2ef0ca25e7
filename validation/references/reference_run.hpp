#pragma once

#include <array>
#include <diracstep/core/integrator/integrator.hpp>
#include <diracstep/core/runs/frames.hpp>
#include <functional>
#include <string>

namespace diracstep {

/// How IDA is given the rows of a scene: as equations on (q, v, p) and the multipliers Λ of all rows, M of
/// holonomic ones.
enum class DaeFormulation {
  rates,        ///< multipliers as derivatives, φ = 0 beside A v + b = 0 (Gear, Gupta, Leimkuhler): index 1
  rates_loose,  ///< the same, no tolerance on the multipliers
  index_2,      ///< the multipliers themselves, without a tolerance: stabilised index 2
  velocity,     ///< multipliers as derivatives, A v + b = 0 alone: index 1, φ drifts
};
inline constexpr std::array<DaeFormulation, 4> all_formulations{
    DaeFormulation::rates, DaeFormulation::rates_loose, DaeFormulation::index_2, DaeFormulation::velocity};

/// "rates", "rates-loose", "index-2" or "velocity".
const char* name(DaeFormulation formulation);

struct ReferenceOptions {
  double rtol = 1e-8;  ///< relative tolerance, in [1e-14, 1e-1]
  double atol = 0.0;   ///< absolute tolerance on every component that has an error test; 0 takes rtol
  Vector sizes = {};   ///< of q, v, p, whose parts absolute tolerances are; empty: 1 for each; IDA only
  long max_steps = 5'000'000;
  DaeFormulation formulation = DaeFormulation::rates;  ///< of IDA
  /// Called now and then within the integration; what it throws ends it and passes through.
  std::function<void()> look = {};
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
  double off_space = 0.0;    ///< on groups and spheres: how far q had left the space before it was put back
  double cpu_seconds = 0.0;  ///< thread time of the start and the integration, without set-up

  bool ok() const { return failure.empty(); }
};

inline constexpr long evaluations_between_looks = 64;

/// Throws Misuse, naming the integrator, unless the scene's start is consistent, t_end is a finite time after
/// it, and the options are in their ranges.
void require_reference(const char* integrator, const Scene& scene, double t_end,
                       const ReferenceOptions& options);

/// Puts the stored numbers at the end onto the space and tells in `off_space` how far off they were; nothing
/// in R^n.
void put_on_space(const Scene& scene, ReferenceRun& run);

/// CPU time of the calling thread.
double thread_seconds();

/// Unknowns up to which a linear system is factored in full; larger ones are factored by KLU, where the build
/// has it.
int largest_full_system();

}  // namespace diracstep
