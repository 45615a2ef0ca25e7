#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/system/constraint_distribution.hpp>
#include <diracstep/core/system/detail/poses.hpp>
#include <utility>

namespace diracstep {

namespace {

/// x, its entries moved by this part of its size.
Vector varied(const Vector& x, double part, double phase) {
  Vector near = x;
  for (Eigen::Index i = 0; i < x.size(); ++i)
    near[i] += part * size_or_one(max_norm(x)) * std::sin(phase + 1.7 * static_cast<double>(i));
  return near;
}

}  // namespace

Vector moved_start(const Space* space, const Start& start, double distance) {
  const double size = std::max(start.q.lpNorm<Eigen::Infinity>(), 1e-2);
  Vector change(space != nullptr ? space->dimension() : start.q.size());
  for (Eigen::Index i = 0; i < change.size(); ++i)
    change[i] = distance * size * std::sin(1.0 + 1.7 * static_cast<double>(i));
  return moved(space, start.q, change);
}

Start near_start(const Start& start, double phase) {
  return {start.time + 0.37 * phase, varied(start.q, 1e-2, phase), varied(start.v, 0.3, 2.0 * phase)};
}

void positions_of(const ConstraintBlocks& holonomic, double t, ConstVectorRef q, VectorRef phi) {
  Eigen::Index row = 0;
  for (const auto& block : holonomic) {
    block->position(t, q, phi.segment(row, block->rows()));
    row += block->rows();
  }
}

std::optional<Vector> pose_near(const Space* space, const ConstraintBlocks& holonomic, double t, Vector q,
                                const std::vector<int>& held) {
  constexpr int most = 50;
  constexpr double small = 1e-10, dependent = 1e-6;
  const double from = q.norm();
  ConstraintsAtPoint rows(holonomic, space != nullptr ? space->dimension() : static_cast<int>(q.size()));
  for (int iteration = 0; rows.rows() > 0 && iteration < most; ++iteration) {
    Vector phi(rows.rows());
    positions_of(holonomic, t, q, phi);
    rows.evaluate(t, q);
    Columns a = rows.pattern().full(rows.coefficients());
    for (const int i : held) a.col(i).setZero();
    if (!phi.allFinite() || !a.allFinite()) return std::nullopt;
    Eigen::CompleteOrthogonalDecomposition<Columns> solver;
    solver.setThreshold(dependent);
    solver.compute(a);
    const Vector change = solver.solve(phi);
    q = moved(space, q, -change);
    if (change.norm() <= small * size_or_one(std::max(from, q.norm()))) return q;
    if (iteration + 1 == most) return std::nullopt;
  }
  return q;
}

}  // namespace diracstep
