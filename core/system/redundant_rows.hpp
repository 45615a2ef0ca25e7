#pragma once

#include <diracstep/core/system/constraint_distribution.hpp>
#include <diracstep/core/system/scene.hpp>
#include <optional>
#include <string>
#include <vector>

namespace diracstep {

/// A point of the holonomic rows near q that differs from it in what is not `held`, by Gauss and Newton's
/// method in least squares, so that the rows may depend on each other; nothing where it does not converge.
std::optional<Vector> pose_near(const ConstraintBlocks& holonomic, double t, Vector q,
                                const std::vector<int>& held);

/// The one-forms of the rows at a point, Aᵀ, with columns of size 1, since rows may come in any units; the
/// coordinates `held` do not count.
Columns full_one_forms(const ConstraintsAtPoint& rows, const std::vector<int>& held = {});

/// Numbers of the redundant columns, combinations of the others to within `tolerance`, found with column
/// pivoting.
std::vector<int> dependent_columns(const Columns& one_forms, double tolerance);

/// Names of the rows of A(t,q) that depend on the others at the start to within `tolerance` of their size; of
/// more than 100 rows, where sparse products are factored, to within 1e-6 at best.  Empty where all rows are
/// independent.  Of the rows that could be named it takes those without which the others are farthest from
/// being dependent at the start and at poses around it that the rows allow, so that leaving them out does no
/// harm while the rank stays the same.
std::vector<std::string> redundant_rows(const Scene& scene, const Start& start, double tolerance = 1e-10);

/// Whether the rows have a higher rank at poses around the start: then it is the start that is singular, and
/// no row can be left out.
bool singular_at_start_only(const Scene& scene, const Start& start, double tolerance = 1e-10);

/// The same scene without the rows of these names.
std::shared_ptr<const Scene> without_rows(const Scene& scene, const std::vector<std::string>& names);

}  // namespace diracstep
