#include <diracstep/boundary_values/detail/independent_conditions.hpp>
#include <diracstep/sensitivities/detail/extended_scene.hpp>
#include <vector>

namespace diracstep::boundary {

namespace {

constexpr double parallel = 1e-7;  // of a row of length 1, what is left of one that follows from others

/// Adds what of the row the basis lacks; false where that is nothing.
bool extend(std::vector<Vector>& basis, Vector row) {
  const double length = row.norm();
  if (!(length > 0.0)) return false;
  row /= length;
  for (int twice = 0; twice < 2; ++twice)
    for (const Vector& b : basis) row -= b.dot(row) * b;
  if (row.norm() <= parallel) return false;
  basis.push_back(row.normalized());
  return true;
}

/// Where conditions name one q or v of one end alone, that.
void take_named(const BoundaryConditions& conditions, GuessedPoint& start, GuessedPoint& end) {
  const Eigen::Index n = start.q.size();
  for (Eigen::Index row = 0; row < conditions.value.size(); ++row)
    for (const bool at_start : {true, false}) {
      const auto own = (at_start ? conditions.at_start : conditions.at_end).row(row);
      const auto other = (at_start ? conditions.at_end : conditions.at_start).row(row);
      Eigen::Index place = 0;
      if (!(own.cwiseAbs().maxCoeff(&place) > 0.0) || (own.array() != 0.0).count() > 1 ||
          !other.isZero(0.0) || place >= 2 * n)
        continue;
      GuessedPoint& point = at_start ? start : end;
      (place < n ? point.q[place] : point.v[place - n]) = conditions.value[row] / own[place];
    }
}

/// The derivatives by (q, v) of φ and of A v + b.
Columns rows_at(sensitivity::ExtendedScene& scene, double t, const GuessedPoint& at) {
  const int n = scene.n(), m = scene.rows();
  const ConstraintBlocks holonomic = only_holonomic(scene.scene().constraints);
  Columns rows = Columns::Zero(m + row_count(holonomic), 2 * n);
  rows.topLeftCorner(m, n) = scene.all_derivatives<Columns>(t, at.q, at.v, 1.0);
  rows.topRightCorner(m, n) = scene.all_coefficients<Columns>(t, at.q);
  int row = m;
  for (const auto& block : holonomic) {
    rows.block(row, 0, block->rows(), n) = scene.coefficients<Columns>(*block, t, at.q);
    row += block->rows();
  }
  return rows;
}

/// Conditions on (q, v, p) as such on (q, v), by p = ∂L/∂v.
Columns by_q_and_v(sensitivity::ExtendedScene& scene, double t, const GuessedPoint& at,
                   const Columns& conditions) {
  const int n = scene.n();
  sensitivity::ExtendedScene::LagrangianAt<Columns> l;
  scene.take(t, at.q, at.v, false, l);
  Columns result = conditions.leftCols(2 * n);
  result.leftCols(n) += conditions.rightCols(n) * l.v_by_point;
  result.rightCols(n) += conditions.rightCols(n) * l.v_by_velocity;
  return result;
}

}  // namespace

BoundaryConditions independent_conditions(const std::shared_ptr<const Scene>& scene,
                                          const BoundaryConditions& conditions, double start_time,
                                          double end_time, const GuessedPoint& start,
                                          const GuessedPoint& end) {
  GuessedPoint from = start, to = end;
  take_named(conditions, from, to);
  const int n = scene->dimension();
  sensitivity::ExtendedScene own(scene, n, Vector());
  std::vector<Vector> basis;
  for (const bool at_start : {true, false}) {
    const Columns rows = rows_at(own, at_start ? start_time : end_time, at_start ? from : to);
    for (Eigen::Index k = 0; k < rows.rows(); ++k) {
      Vector row = Vector::Zero(4 * n);
      row.segment(at_start ? 0 : 2 * n, 2 * n) = rows.row(k).transpose();
      extend(basis, row);
    }
  }
  Columns all(conditions.value.size(), 4 * n);
  all << by_q_and_v(own, start_time, from, conditions.at_start),
      by_q_and_v(own, end_time, to, conditions.at_end);
  std::vector<Eigen::Index> kept;
  for (Eigen::Index k = 0; k < all.rows(); ++k)
    if (extend(basis, all.row(k).transpose())) kept.push_back(k);
  return {conditions.at_start(kept, Eigen::all), conditions.at_end(kept, Eigen::all), conditions.value(kept)};
}

}  // namespace diracstep::boundary
