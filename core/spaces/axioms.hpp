#pragma once

#include <diracstep/core/spaces/space.hpp>
#include <string>
#include <vector>

namespace diracstep {

/// By how much a configuration space fails one of its axioms, at worst.
struct AxiomDefect {
  std::string axiom;  ///< "tau(x) tau(-x) = e"
  double defect;      ///< in parts of the numbers that are compared
  double allowed;     ///< 1e-13, round-off; 1e-7 where differences take the place of derivatives
};

/// For tests of a factor of one's own (factor.hpp): its axioms at `points` random x, some near zero, some
/// where coefficients change from a series to functions, some over nearly all that τ is injective on.
///
///   τ(0) = e,  τ(−x) τ(x) = e,  (g h) k = g (h k),  dτ_0 = 1,  B(g τ(x)) dτ_x v = ∂(g τ(x))/∂x v by jets,
///   dτ_{−x} = Ad_{τ(x)} dτ_x,  Ad_{gh} = Ad_g Ad_h,  d/dε Ad_{τ(εv)} w = ad_v w,  ad_v w = −ad_w v,
///   the identity of Jacobi, all derivatives of dτ_x and of B against differences of high order,
///   normalised(q) = q, difference(g, g τ(x)) = x, and for a sphere that the further components of a group
///   column are turns: brackets of two of them vanish
///
/// The chart of a retraction with a pole ends well before it, else differences there tell nothing.
std::vector<AxiomDefect> space_axiom_defects(const Space& space, int points = 60, unsigned seed = 1);

/// Throws Misuse that names the axioms which fail, each by how much and of what is allowed.
void require_space_axioms(const Space& space);

}  // namespace diracstep
