#include <Eigen/LU>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/steps/gauss_lobatto/regular_two_form.hpp>
#include <diracstep/core/system/detail/constraint_levels.hpp>
#include <diracstep/core/system/lagrangian_derivatives.hpp>

namespace diracstep {

namespace {

constexpr int max_coordinates_to_test = 1000;

}  // namespace

void require_regular_two_form(const Scene& scene) {
  const Lagrangian& l = *scene.lagrangian;
  const int n = scene.dimension();
  if (n > max_coordinates_to_test || scene.start.q.size() != n) return;
  LagrangianDerivatives at_start(l);
  at_start.take_second(l, scene.start.time, scene.start.q, Vector::Zero(n));
  const Columns transposed = l.pattern().full(at_start.qv);  // Dθᵀ
  if (!transposed.allFinite()) return;                       // the step says so itself
  const Eigen::FullPivLU<Columns> two_form(transposed - transposed.transpose());
  if (two_form.isInvertible()) return;
  const Columns kernel = two_form.kernel();
  std::string open;
  for (int i = 0; i < n; ++i)
    if (kernel.row(i).lpNorm<Eigen::Infinity>() > 1e-8)
      open += " '" + scene.coordinates[static_cast<std::size_t>(i)] + "'";
  throw Misuse(
      "scene '" + scene.name +
      "': its Lagrangian θ(q)·v − H(q) is linear in v, and the two-form dθ has rank " +
      std::to_string(two_form.rank()) + " of " + std::to_string(n) +
      " at the start, so nothing determines the velocities of" + open +
      "; a phase-space Lagrangian pairs coordinates, and others must follow from constraints of at most " +
      std::to_string(most_levels) + " levels" + (n % 2 == 1 ? ", as one of an odd number must" : ""));
}

}  // namespace diracstep
