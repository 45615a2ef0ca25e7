#pragma once

#include <diracstep/core/equilibrium/eigenmodes.hpp>
#include <diracstep/core/numerics/eigenpairs.hpp>
#include <optional>
#include <string>

namespace diracstep {

/// Eigenvalues near a number, of a scene of any size.
struct NearestModes {
  Eigenmodes found;        ///< its stability is that of these modes alone
  double near = 0.0;       ///< the shift σ that they are nearest to
  double variation = 0.0;  ///< as Linearisation::variation
  std::string failure = {};
};

/// The eigenvalues s nearest to a real shift σ of the linear equations of Linearisation, unreduced: of
///
///   s δq = δv,   s M δv = −K δq − C δv + Aᵀδμ,   A_h δq = 0,   A_n δv + D δq = 0
///
/// as σ + 1/θ for the largest eigenvalues θ of (F − σE)⁻¹E, which is one sparse solve with n + m unknowns.
/// Eigenvalues that are infinite, of multipliers and of coordinates without mass, become θ = 0 and stay away.
/// Eigenvalues below 1e-6 σ are counted as zeros.  Without `near`, σ is 1e-3 of the fastest rate that the
/// sizes of K, C and M allow, so that the slowest motions are found.
///
/// About twice `count` eigenvalues are looked for, since one of a pair is shown.  Errors are about 1e-13 |s −
/// σ|² over the least |s − σ|.  Redundant rows are left out.  Throws Misuse for more than the scene has, and
/// where the matrix is singular: σ is an eigenvalue.
NearestModes nearest_modes(const Scene& scene, const Equilibrium& at, int count, std::optional<double> near,
                           double later, const LargestEigenpairs& eigenpairs);

}  // namespace diracstep
