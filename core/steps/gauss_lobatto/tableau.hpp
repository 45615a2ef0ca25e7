#pragma once

#include <diracstep/core/numerics/types.hpp>

namespace diracstep {

/// Coefficients of the step GL(s): s Gauss nodes c_i with weights b_i, s+1 Lobatto nodes c~_j with weights
/// b~_j, all on [0,1], and with l_i the Lagrange basis on the Gauss nodes
///
///   a_ij = ∫_0^{c_i} l_j,            a~_ji = ∫_0^{c~_j} l_i,
///   â_ij = b_j (1 − a_ji / b_i),     e_ij = b~_j (1 − a~_ji / b_i)
///
/// Rows and columns count from 0; a~ is (s+1)×s, e is s×(s+1) with a last column of zeros.  Computed in
/// extended precision and, for double, rounded once.
template <class Real>
struct GaussLobattoTableauOf {
  Eigen::Matrix<Real, Eigen::Dynamic, 1> c, b;
  Eigen::Matrix<Real, Eigen::Dynamic, 1> lobatto_c, lobatto_b;
  Eigen::Matrix<Real, Eigen::Dynamic, Eigen::Dynamic> a, a_hat, lobatto_a, e;
};
using GaussLobattoTableau = GaussLobattoTableauOf<double>;
using ExtendedGaussLobattoTableau = GaussLobattoTableauOf<long double>;

/// Throws Misuse unless 1 ≤ s ≤ 20.
GaussLobattoTableau gauss_lobatto_tableau(int s);
/// The same, not rounded.
const ExtendedGaussLobattoTableau& extended_gauss_lobatto_tableau(int s);

/// Values at `points` of the polynomials that are 1 at one of `nodes` and 0 at the others: one row a point,
/// one column a node.
Columns lagrange_basis(const Vector& nodes, const Vector& points);

}  // namespace diracstep
