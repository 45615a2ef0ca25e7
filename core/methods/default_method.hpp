#pragma once

#include <diracstep/core/dirac/discrete_rows.hpp>
#include <diracstep/core/system/scene.hpp>
#include <optional>
#include <string>

namespace diracstep {

/// The name that stands for the method the library would take.
inline constexpr const char* automatic_method = "auto";

/// What is asked of a method by those who name none.
struct MethodRequest {
  int order = 0;                            ///< p, or 0 for any
  double error = 0.0;                       ///< at the end of the motion, relative; 0 where none is asked for
  std::optional<ConstraintRule> rule = {};  ///< for Δ^d_Q
  int large = 40;                           ///< more unknowns n + m than this are many; see large_from()
};

/// What was taken for "auto", and why; `order` as in IntegratorOptions.
struct DefaultMethod {
  std::string method;
  int order = 0;
  std::string reason;
  double local_error = 0.0;     ///< of variable steps by their local error; 0 where the method takes none
  bool explicit_steps = false;  ///< nothing is solved in a step
};

/// The method for a scene where none is named; damping_survey.hpp asks first for damping.  First the order p:
///
///   an order was asked for             that one
///   an error e was asked for           p from e and the size n + m of the systems: what took least time to
///                                      reach e on the scenes of bench/error_control
///                                        n + m ≤ 12   6 for e > 1e-5, 8 for e > 2e-10, else 12
///                                        n + m ≤ 30   6 for e > 1e-8, else 8
///                                        larger       4 for e > 1e-7, else 6
///   neither                            6, the lowest order that is near the least time for errors of 1e-3
///
/// then the method of this order:
///
///   a rule for Δ^d_Q is given          type1/midpoint composed to p, at most 10, or alone where no order and
///                                      no error is asked for: rows inside the step know no such rule
///   more than `large` unknowns, no     type1/trapezoidal, explicit there, composed to p: a fifth of the time
///   rows, no force, L separable        of GL(3) on Toda lattices of 200 and 1000 sites
///   the same of a scene given by a      type2/euler with its adjoint, explicit there, composed to p
///   separable Hamiltonian alone
///   all others                         GL(p/2)
///
/// Through KLU GL(3) takes less time than compositions of the midpoint step on lattices and on chains of 16
/// and 64 links at errors of 1e-6 and 1e-9, the same on 256 links (bench/large_scenes_methods).  Throws
/// Misuse for an order that is odd or above 40.
DefaultMethod default_method(const Scene& scene, const MethodRequest& request);

}  // namespace diracstep
