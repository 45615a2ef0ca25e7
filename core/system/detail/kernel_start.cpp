#include <Eigen/QR>
#include <algorithm>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/system/detail/constraint_levels.hpp>
#include <diracstep/core/system/detail/kernel_start.hpp>
#include <diracstep/core/system/detail/poses.hpp>
#include <diracstep/core/system/kernel_motions.hpp>
#include <utility>

namespace diracstep {

Start moved_onto_hidden(const Scene& scene, const FirstOrderMotions& motions, Start start,
                        const std::vector<bool>& may_move) {
  if (!motions.levels.empty()) return moved_onto_levels(scene, motions, std::move(start), may_move);
  constexpr int most_iterations = 50;
  const Eigen::Index n = scene.dimension(), m = scene.rows(), k = std::ssize(motions.along);
  const ConstraintBlocks holonomic = only_holonomic(scene.constraints);
  const Eigen::Index mh = row_count(holonomic);
  ConstraintsAtPoint holonomic_rows(holonomic, scene.dimension());
  KernelPoint point(scene, motions);
  for (int iteration = 0; iteration < most_iterations; ++iteration) {
    point.evaluate(start.time, start.q, start.v, Vector::Zero(m));
    point.differentiate();
    Vector off = Vector::Zero(mh + k + m);
    Columns by = Columns::Zero(mh + k + m, 2 * n);
    if (mh > 0) {
      holonomic_rows.evaluate(start.time, start.q);
      by.topLeftCorner(mh, n) = holonomic_rows.pattern().full(holonomic_rows.coefficients());
      positions_of(holonomic, start.time, start.q, off.head(mh));
    }
    for (Eigen::Index i = 0; i < k; ++i)
      if (motions.hidden[static_cast<std::size_t>(i)]) {
        off[mh + i] = point.along()[i];
        by.row(mh + i) << point.along_by_q().row(i), point.along_by_v().row(i);
      }
    off.tail(m) = point.full().row_residual();
    by.bottomRows(m) << point.full().row_by_q(), point.full().rows();
    const double terms = std::max({point.terms(), max_norm(start.q), max_norm(start.v)});
    if (max_norm(off) <= 1e-14 * scale_of(terms)) return start;
    for (Eigen::Index c = 0; c < 2 * n; ++c)
      if (!may_move[static_cast<std::size_t>(c)]) by.col(c).setZero();
    const Vector change = by.completeOrthogonalDecomposition().solve(off);
    start.q -= change.head(n);
    start.v -= change.tail(n);
    if (max_norm(change) <= 1e-15 * std::max(max_norm(start.q), max_norm(start.v))) return start;
  }
  throw Misuse("scene '" + scene.name +
               "': no start near the given one is on the rows and on the equations of motion that hold no "
               "acceleration");
}

}  // namespace diracstep
