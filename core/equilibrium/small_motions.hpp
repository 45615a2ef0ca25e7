#pragma once

#include <diracstep/core/equilibrium/sparse_modes.hpp>
#include <optional>
#include <string>

namespace diracstep {

/// Which modes are looked for.
struct SmallMotionOptions {
  std::optional<int> modes;  ///< how many, by sparse matrices; without, all by full ones where these suffice
  std::optional<double> near;  ///< the number that those are nearest to, as in nearest_modes()
};

/// Small motions about an equilibrium or a steady motion, and whether they are to be believed.
struct SmallMotions {
  std::optional<Linearisation> linear;  ///< by full matrices
  std::optional<NearestModes> nearest;  ///< by sparse ones
  Eigenmodes modes;
  double variation = 0.0;  ///< as Linearisation::variation
  /// Empty, or that the linear equations change by more than 1e-7 of their size until `later`, that the
  /// formulas have a kink at the point, or why the search for modes has failed.
  std::string doubt = {};
};

/// Of an equilibrium that was found (Equilibrium::ok()): by full matrices, or by sparse ones where the
/// options name modes or a number, and in a scene that needs them (needs_sparse_matrices()), ten then. Throws
/// Misuse as linearise() and nearest_modes() do.
SmallMotions small_motions(const Scene& scene, const Equilibrium& at, double later,
                           const SmallMotionOptions& options, const LargestEigenpairs& eigenpairs);

}  // namespace diracstep
