#pragma once

#include <diracstep/core/numerics/nonlinear_solver.hpp>
#include <diracstep/core/system/scene.hpp>
#include <string>
#include <vector>

namespace diracstep {

/// A start moved onto the constraints, and how far it had to move (Euclidean norms).
struct ConsistentStart {
  Start start;
  double position_moved = 0.0;
  double velocity_moved = 0.0;
};

/// The nearest start on the constraints: q is the point of φ(t,q) = 0 nearest to the given one in the
/// Euclidean norm, then v the velocity of the affine distribution nearest to the given one in the norm of
/// ∂²L/∂v² (for a degenerate Lagrangian: of any solution of  ∂L/∂v(q,v) − Aᵀμ = ∂L/∂v(q,v̂),  A v + b = 0).
/// The rows that a degenerate Lagrangian hides count as rows (hidden_rows.hpp).  A start with a momentum in
/// place of v is given its velocity first.  Throws Misuse where no such point is found, saying why.
ConsistentStart project_start(const Scene& scene, const Start& start, const SolverFactory& solvers);

/// Names of the rows of A(t,q) that depend on the others to within `tolerance` of their size, found with
/// column pivoting; of more than 100 rows, where sparse products are factored, to within 1e-6 at best.  Empty
/// where all rows are independent.
std::vector<std::string> redundant_rows(const Scene& scene, const Start& start, double tolerance = 1e-10);

/// The same scene without the rows of these names.
std::shared_ptr<const Scene> without_rows(const Scene& scene, const std::vector<std::string>& names);

}  // namespace diracstep
