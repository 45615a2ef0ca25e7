#include <Eigen/LU>
#include <cmath>
#include <diracstep/core/numerics/kernel_basis.hpp>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/system/constraint_distribution.hpp>
#include <diracstep/core/system/detail/poses.hpp>
#include <diracstep/core/system/lagrangian_derivatives.hpp>
#include <diracstep/core/system/multiplier_rows.hpp>
#include <diracstep/core/system/rows_along_motions.hpp>

namespace diracstep {

namespace {

std::vector<std::string> names_of_multiplier_rows(const Scene& scene, const Columns& directions) {
  std::vector<std::string> names;
  for (const char* kind : {"hidden_", "kept_"})
    for (Eigen::Index k = 0; k < directions.cols(); ++k)
      names.push_back(kind + motion_along(scene, directions.col(k)));
  return names;
}

Vector position_hessian(const Lagrangian& l, double t, ConstVectorRef q, ConstVectorRef v) {
  Vector qq(l.pattern().nonzeros()), qv = qq, vv = qq;
  l.hessian(t, q, v, qq, qv, vv);
  return qq;
}

}  // namespace

MultiplierRows::MultiplierRows(const Scene& scene, const Columns& directions, const Vector& units)
    : ConstraintRows(true, SparsityPattern::dense(2 * static_cast<int>(directions.cols()), scene.dimension()),
                     scene.lagrangian->pattern(), names_of_multiplier_rows(scene, directions)),
      lagrangian_(scene.lagrangian),
      directions_(directions),
      scaled_(directions * units.cwiseInverse().asDiagonal()),
      units_(units),
      start_(scene.start.q) {
  probe_ = size_or_one(
      max_norm(position_hessian(*lagrangian_, scene.start.time, start_, Vector::Zero(scene.dimension()))));
}

Vector MultiplierRows::shown_beside(ConstVectorRef forces) const {
  return scaled_ * forces.head(directions_.cols());
}

std::string MultiplierRows::origin(int row) const {
  const bool hidden = row < directions_.cols();
  const std::string& name = names()[static_cast<std::size_t>(row)];
  const std::string coordinate = name.substr(name.find('_') + 1);
  return hidden ? "not in the file: what " + coordinate + " is a multiplier of"
                : "not in the file: " + coordinate + " is a multiplier, and stands still in a step";
}

void MultiplierRows::position(double t, ConstVectorRef q, VectorRef phi) const {
  const Eigen::Index k = directions_.cols();
  Vector lq(dimension()), lv(dimension());
  lagrangian_->gradient(t, q, Vector::Zero(dimension()), lq, lv);
  phi.head(k) = scaled_.transpose() * lq;
  phi.tail(k) = directions_.transpose() * (q - start_);
}

void MultiplierRows::coefficients(double t, ConstVectorRef q, VectorRef a, VectorRef b) const {
  const Eigen::Index k = directions_.cols();
  const Vector qq = position_hessian(*lagrangian_, t, q, Vector::Zero(dimension()));
  auto rows = a.reshaped(2 * k, dimension());
  rows.topRows(k) = scaled_.transpose() * lagrangian_->pattern().full(qq);
  rows.bottomRows(k) = directions_.transpose();
  b.setZero();
}

/// ∂²L/∂q² at q + u less that at q, on the pattern of L.
Vector MultiplierRows::second_difference(double t, ConstVectorRef q, ConstVectorRef direction) const {
  const Vector rest = Vector::Zero(dimension());
  return (position_hessian(*lagrangian_, t, q + probe_ * direction, rest) -
          position_hessian(*lagrangian_, t, q, rest)) /
         probe_;
}

void MultiplierRows::derivative(double t, ConstVectorRef q, ConstVectorRef w, double, VectorRef d) const {
  const Eigen::Index k = directions_.cols();
  auto rows = d.reshaped(2 * k, dimension());
  rows.setZero();
  for (Eigen::Index r = 0; r < k; ++r)
    rows.row(r) = (lagrangian_->pattern().full(second_difference(t, q, scaled_.col(r))) * w).transpose();
}

void MultiplierRows::time_derivative(double, ConstVectorRef, ConstVectorRef, VectorRef d) const {
  d.setZero();
}

void MultiplierRows::annihilator_derivative(double t, ConstVectorRef q, ConstVectorRef lambda,
                                            VectorRef d) const {
  const Vector direction = shown_beside(lambda);
  const double size = max_norm(direction);
  if (size == 0.0)
    d.setZero();
  else
    d = second_difference(t, q, direction / size * max_norm(scaled_)) * (size / max_norm(scaled_));
}

namespace {

bool vanishes_beside(const Columns& small, const Columns& whole) {
  return max_norm(small) <= 1e-11 * size_or_one(max_norm(whole));
}

/// How many of the rows ∂g/∂q = Uᵀ ∂²L/∂q² are independent.
Eigen::Index rank_of_factors(const Columns& directions, const Columns& qq) {
  const Columns factors = directions.transpose() * qq;
  if (vanishes_beside(factors, qq)) return 0;
  Eigen::FullPivLU<Columns> lu;
  lu.setThreshold(1e-9);
  return lu.compute(factors).rank();
}

}  // namespace

bool are_multipliers(const Scene& scene, const Columns& directions) {
  const Lagrangian& l = *scene.lagrangian;
  const Eigen::Index n = directions.rows();
  const Start near = near_start(scene.start, 1.0);
  const Vector &q = near.q, &v = near.v;
  for (const double t : {scene.start.time, near.time}) {
    LagrangianDerivatives at(l);
    at.take_second(l, t, q, v);
    const Columns qq = l.pattern().full(at.qq), qv = l.pattern().full(at.qv);
    if (rank_of_factors(directions, qq) < directions.cols()) return false;
    Vector rate(n);
    l.position_gradient_rate(t, q, v, rate);
    if (!vanishes_beside(directions.transpose() * qq * directions, qq) ||
        !vanishes_beside(directions.transpose() * qv, qv) || !vanishes_beside(qv * directions, qv) ||
        !vanishes_beside(directions.transpose() * rate, rate))
      return false;
    for (Eigen::Index k = 0; k < directions.cols(); ++k) {
      const Vector one = position_hessian(l, t, q + directions.col(k), v),
                   two = position_hessian(l, t, q + 2.0 * directions.col(k), v);
      if (!vanishes_beside(two - 2.0 * one + at.qq, two)) return false;
    }
    if (!scene.force) continue;
    const SparsityPattern& of_force = scene.force->pattern();
    Vector f(n), fq(of_force.nonzeros()), fv = fq;
    scene.force->value(t, q, v, f);
    scene.force->derivatives(t, q, v, fq, fv);
    if (!vanishes_beside(directions.transpose() * f, f) ||
        !vanishes_beside(of_force.full(fq) * directions, f) ||
        !vanishes_beside(of_force.full(fv) * directions, f))
      return false;
  }
  return true;
}

std::string fault_of_multipliers(const Scene& scene, const Columns& directions) {
  const Lagrangian& l = *scene.lagrangian;
  const Start near = near_start(scene.start, 1.0);
  const Vector &q = near.q, &v = near.v;
  LagrangianDerivatives at(l);
  at.take_second(l, near.time, q, v);
  const Columns qq = l.pattern().full(at.qq);
  const Eigen::Index rank = rank_of_factors(directions, qq);
  if (rank == 0 || !vanishes_beside(directions.transpose() * qq * directions, qq)) return {};
  Vector rate(q.size());
  l.position_gradient_rate(near.time, q, v, rate);
  if (!vanishes_beside(directions.transpose() * rate, rate))
    return "what it is a multiplier of depends on the time: state that as a row, whose force is the "
           "multiplier, and leave the coordinate out";
  if (rank < directions.cols())
    return "they are multipliers of the same, so that only a sum of them is determined: leave out all but " +
           std::to_string(rank);
  return {};
}

std::string rows_said_twice(const Scene& scene, const MultiplierRows& rows) {
  const Eigen::Index n = scene.dimension(), m = scene.rows(), k = rows_at_shown_points(rows);
  if (m == 0) return {};
  ConstraintsAtPoint own(scene.constraints, scene.dimension());
  Columns dependent;
  for (const double phase : {1.0, 2.0}) {
    const Vector q = near_start(scene.start, phase).q;
    Vector a(2 * k * n), b(2 * k);
    own.evaluate(scene.start.time, q);
    rows.coefficients(scene.start.time, q, a, b);
    Columns all(m + k, n);
    all << own.pattern().full(own.coefficients()), a.reshaped(2 * k, n).topRows(k);
    for (Eigen::Index r = 0; r < m + k; ++r) all.row(r) /= size_or_one(max_norm(all.row(r).transpose()));
    dependent = kernel_basis(all.transpose(), 1e-9);
    if (dependent.cols() == 0) return {};
  }
  std::string names;
  for (int r = 0; r < m; ++r)
    if (max_norm(dependent.row(r).transpose()) > 1e-9 * max_norm(dependent))
      names += (names.empty() ? "" : ", ") + row_label(scene.constraints, r);
  return names;
}

int rows_at_shown_points(const ConstraintRows& rows) {
  return dynamic_cast<const MultiplierRows*>(&rows) != nullptr ? rows.rows() / 2 : rows.rows();
}

void show_multipliers(const Scene& scene, ConstVectorRef lambda, Vector& q) {
  Eigen::Index row = 0;
  for (const auto& block : scene.constraints) {
    if (const auto* const rows = dynamic_cast<const MultiplierRows*>(block.get()))
      q += rows->shown_beside(lambda.segment(row, block->rows()));
    row += block->rows();
  }
}

}  // namespace diracstep
