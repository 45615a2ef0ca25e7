#pragma once

#include <diracstep/core/numerics/types.hpp>
#include <string>

namespace diracstep::scene_compiler {

/// A cell of a field's grid, with its length 1: a polynomial of degree S through its values at the S + 1
/// Lobatto points, the first and the last of which are shared with its neighbours, and a quadrature.
///
///   ∫ ℒ dx ≈ Σ_k weights_k ℒ(Σ_r values_kr u_r, Σ_r slopes_kr u_r)
///
/// "gauss:S" has S Gauss points and is the Gauss method of S stages in space (S = 1: the midpoint rule, with
/// the midpoint in time the box scheme); "lobatto:S" has its S + 1 Lobatto points, where the masses are
/// lumped (S = 1: the trapezoidal rule).  Both are of order 2 for S = 1; measured at the ends of cells of a
/// moving kink: 3.4 and 3.8 for S = 2, 4.5 and 5.4 for S = 3.  Multisymplectic by the product with a
/// symplectic step in time: S. Reich, J. Comput. Phys. 157 (2000); Tran, Leok, arXiv 2101.07536.
struct FieldElement {
  bool gauss = true;
  int degree = 1;
  Vector nodes;            ///< S + 1 of them on [0, 1]
  Vector points, weights;  ///< of the quadrature
  Columns values, slopes;  ///< one row a point, one column a node
};

/// Throws Misuse for another name than "gauss:S" and "lobatto:S", 1 ≤ S ≤ 8.
FieldElement field_element(const std::string& name);

}  // namespace diracstep::scene_compiler
