#pragma once

#include <diracstep/core/spaces/space.hpp>
#include <string>
#include <vector>

namespace diracstep {

/// By how much a configuration space fails one of its axioms, at worst.
struct AxiomDefect {
  std::string axiom;  ///< "tau(-x) tau(x) = e"
  double defect;      ///< in parts of the numbers that are compared
};

/// For tests of a factor of one's own (groups.hpp): its axioms at `points` random x, some near zero, some
/// where coefficients change from a series to functions, some over nearly all that τ is injective on.
///
///   τ(0) = e,  τ(−x) τ(x) = e,  (g h) k = g (h k),  dτ_0 = 1,  B(g τ(x)) dτ_x v = ∂(g τ(x))/∂x v by jets,
///   dτ_{−x} = Ad_{τ(x)} dτ_x,  Ad_{gh} = Ad_g Ad_h,  d/dε Ad_{τ(εv)} w = ad_v w,  ad_v w = −ad_w v,
///   the identity of Jacobi, all derivatives of dτ_x and of B against differences of high order,
///   normalised(q) = q, difference(g, g τ(x)) = x, and for a sphere that the further components of a group
///   column are turns: brackets of two of them vanish
///
/// Each should be round-off, below 1e-13.
std::vector<AxiomDefect> space_axiom_defects(const Space& space, int points = 60, unsigned seed = 1);

}  // namespace diracstep
