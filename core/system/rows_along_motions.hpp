#pragma once

#include <diracstep/core/system/scene.hpp>
#include <memory>
#include <string>

namespace diracstep {

/// The rows Wᵀ(∂L/∂q + f) = 0 for the columns of W in `directions`, each divided by the size of its
/// coefficients at the start, which is in `units`: rows on positions where `holonomic`, else on velocities,
/// in which f is affine (hidden_rows.hpp).
std::shared_ptr<const ConstraintRows> rows_along_motions(const Scene& scene, bool holonomic,
                                                         const Columns& directions, const Vector& units);

/// The same rows in a scene that has further coordinates after those of this one, its parameters; null where
/// `rows` are no such rows.  Throws Misuse for those of multipliers (multiplier_rows.hpp).
std::shared_ptr<const ConstraintRows> rows_along_motions_in(const ConstraintRows& rows,
                                                            const Scene& extended);

/// The size of the largest entry of each row, 1 for one of zeros.
Vector largest_of_rows(const Columns& matrix);

/// The same space of directions W where their rows Wᵀ∂f/∂v, on the columns of `motions`, all but depend on
/// each other, as those of two loops through the same 1 MΩ, one of them with 10 mΩ more: by elimination, the
/// largest entry first, which leaves the other loop its 10 mΩ alone.  `fv` is ∂f/∂v.
Columns with_rows_apart(Columns w, const Columns& fv, const Columns& motions);

/// "qC1-qC3": a motion in words.
std::string motion_along(const Scene& scene, const Vector& w);

}  // namespace diracstep
