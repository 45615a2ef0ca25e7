#include <Eigen/QR>
#include <diracstep/sensitivities/detail/extended_scene.hpp>
#include <diracstep/sensitivities/moved_start.hpp>

namespace diracstep {

namespace {

using Indices = std::vector<int>;

/// The guessed components, or the others.
Indices components(const std::vector<bool>& guessed, int n, bool which) {
  Indices numbers;
  for (int i = 0; i < n; ++i)
    if ((guessed.empty() || guessed[static_cast<std::size_t>(i)]) == which) numbers.push_back(i);
  return numbers;
}

/// The change y of guessed components with K y − Aᵀμ = right, A y = −rate there, and the others as given.
void follow_rows(const Columns& k, const Columns& a, const Columns& right, const Columns& rate,
                 const std::vector<bool>& guessed, Columns& y) {
  const auto n = static_cast<int>(k.rows());
  const Eigen::Index m = a.rows();
  const Indices moved = components(guessed, n, true), held = components(guessed, n, false);
  const auto f = static_cast<Eigen::Index>(moved.size());
  if (f == 0) return;
  Columns matrix = Columns::Zero(f + m, f + m), side(f + m, y.cols());
  matrix.topLeftCorner(f, f) = k(moved, moved);
  matrix.topRightCorner(f, m) = -a(Eigen::all, moved).transpose();
  matrix.bottomLeftCorner(m, f) = a(Eigen::all, moved);
  side.topRows(f) = right(moved, Eigen::all) - k(moved, held) * y(held, Eigen::all);
  side.bottomRows(m) = -rate - a(Eigen::all, held) * y(held, Eigen::all);
  // Redundant rows leave μ open, not y.
  const Columns solution = matrix.completeOrthogonalDecomposition().solve(side);
  y(moved, Eigen::all) = solution.topRows(f);
}

/// Multipliers with Aᵀμ = force along the guessed components.
Vector multipliers(const Columns& a, const Vector& force, const std::vector<bool>& guessed) {
  const Indices moved = components(guessed, static_cast<int>(a.cols()), true);
  if (moved.empty() || a.rows() == 0) return Vector::Zero(a.rows());
  const Columns along = a(Eigen::all, moved).transpose();
  return along.completeOrthogonalDecomposition().solve(force(moved));
}

void move_position(sensitivity::ExtendedScene& scene, const Start& stated, const Start& moved,
                   const std::vector<bool>& guessed, Columns& dq) {
  const int n = scene.n();
  const ConstraintBlocks rows = only_holonomic(scene.scene().constraints);
  Columns a(row_count(rows), scene.size());
  int row = 0;
  for (const auto& block : rows) {
    a.middleRows(row, block->rows()) = scene.coefficients<Columns>(*block, moved.time, moved.q);
    row += block->rows();
  }
  const Vector nu = multipliers(a.leftCols(n), stated.q - moved.q, guessed);
  Columns curvature = Columns::Zero(n, scene.size());
  row = 0;
  for (const auto& block : rows) {
    curvature +=
        scene.annihilator_derivative<Columns>(*block, moved.time, moved.q, nu.segment(row, block->rows()));
    row += block->rows();
  }
  const Eigen::Index count = dq.cols();
  follow_rows(Columns::Identity(n, n) + curvature.leftCols(n), a.leftCols(n), dq - curvature.rightCols(count),
              a.rightCols(count), guessed, dq);
}

void move_velocity(sensitivity::ExtendedScene& scene, const Start& stated, const Start& moved,
                   const std::vector<bool>& guessed, const Columns& dq, Columns& dv) {
  const int n = scene.n();
  Columns dx(scene.size(), dv.cols());
  dx << dq, Columns::Identity(dv.cols(), dv.cols());
  sensitivity::ExtendedScene::LagrangianAt<Columns> at_moved, at_stated;
  scene.take(moved.time, moved.q, moved.v, false, at_moved);
  scene.take(moved.time, moved.q, stated.v, false, at_stated);
  Vector lq(scene.size()), p = lq, stated_p = lq;
  scene.scene().lagrangian->gradient(moved.time, scene.point(moved.q), scene.velocity(moved.v), lq, p);
  scene.scene().lagrangian->gradient(moved.time, scene.point(moved.q), scene.velocity(stated.v), lq,
                                     stated_p);
  const auto a = scene.all_coefficients<Columns>(moved.time, moved.q);
  const Vector mu = multipliers(a, (p - stated_p).head(n), guessed);
  const Columns right =
      at_stated.v_by_velocity * dv + (at_stated.v_by_point - at_moved.v_by_point +
                                      scene.all_annihilator_derivatives<Columns>(moved.time, moved.q, mu)) *
                                         dx;
  follow_rows(at_moved.v_by_velocity, a, right,
              scene.all_derivatives<Columns>(moved.time, moved.q, moved.v, 1.0) * dx, guessed, dv);
}

}  // namespace

void move_start_derivatives(const std::shared_ptr<const Scene>& extended, const Vector& parameters,
                            const Start& stated, const Start& moved, const Guesses& guesses, Columns& dq,
                            Columns& dv) {
  if (extended->rows() == 0) return;
  sensitivity::ExtendedScene scene(extended, static_cast<int>(dq.rows()), parameters);
  move_position(scene, stated, moved, guesses.q, dq);
  move_velocity(scene, stated, moved, guesses.v, dq, dv);
}

}  // namespace diracstep
