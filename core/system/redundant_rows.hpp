#pragma once

#include <diracstep/core/system/constraint_distribution.hpp>
#include <diracstep/core/system/row_subset.hpp>
#include <diracstep/core/system/scene.hpp>
#include <string>
#include <vector>

namespace diracstep {

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
/// harm while the rank stays the same.  A holonomic row is named only where holonomic ones alone make it
/// redundant: a nonholonomic one leaves the place free.
std::vector<std::string> redundant_rows(const Scene& scene, const Start& start, double tolerance = 1e-10);

/// How rows depend on others at the start.
enum class RowDependence {
  lasting,        ///< at poses around it as well: they say nothing new, and can be left out
  at_start_only,  ///< at poses around it the rank is higher: the start is singular
  touching,  ///< their one-forms do at every pose that all rows allow, but poses that the others allow break
             ///< them, as the third of three bars on a line: they cannot be left out
};
RowDependence row_dependence(const Scene& scene, const Start& start,
                             const std::vector<std::string>& dependent, double tolerance = 1e-10);
/// Why rows that depend so cannot be left out, and what to do; empty where they can.
const char* why_not_left_out(RowDependence dependence);

}  // namespace diracstep
