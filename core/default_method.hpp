#pragma once

#include <diracstep/core/scene.hpp>
#include <diracstep/core/step_nodes.hpp>
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

/// The method for a scene of which nothing is asked but an order, or not even that (0):
///
///   GL(3), order 6: in every scene class measured it needs the least time, or nearly, for errors from 1e-3
///   to 1e-8; below, GL(4) needs less (docs/at_error.md).  An even order p gives GL(p/2). A rule for Δ^d_Q
///   excludes GL(s), whose rows hold inside the step: type1/midpoint, composed to the order.
///
/// Throws Misuse for an order that is odd or above 40.
DefaultMethod default_method(const Scene& scene, int order, std::optional<StepRule> rule);

}  // namespace diracstep
