#pragma once

#include <diracstep/core/dirac/discrete_rows.hpp>
#include <diracstep/core/system/scene.hpp>
#include <optional>
#include <string>

namespace diracstep {

/// The name that stands for the method the library would take.
inline constexpr const char* automatic_method = "auto";

/// What was taken for "auto", and why; `order` as in IntegratorOptions.
struct DefaultMethod {
  std::string method;
  int order = 0;
  std::string reason;
};

/// The method for a scene where no method is asked for, and an order p or none (0):
///
///   a rule for Δ^d_Q is given          type1/midpoint composed to p: rows inside the step know no such rule
///   more than `large` unknowns, no     type1/trapezoidal, explicit there, composed to p or 6: a fifth of the
///   rows, no force, L separable        time of GL(3) on Toda lattices of 200 and 1000 sites
///   all others                         GL(p/2), or GL(3), the lowest order that is near the least time
///                                      for errors of 1e-3; small errors take p = 8 (docs/at_error.md)
///
/// `large` is 40, or the limit of full matrices where one was given (large_from).  Through KLU GL(3) takes
/// less time than compositions of the midpoint step on lattices and on chains of 16 and 64 links at errors of
/// 1e-6 and 1e-9, the same on 256 links (bench/large_scenes_methods).  Throws Misuse for an order that is odd
/// or above 40.
DefaultMethod default_method(const Scene& scene, int order, const std::optional<ConstraintRule>& rule,
                             int large);

}  // namespace diracstep
