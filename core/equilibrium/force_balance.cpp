#include <Eigen/QR>
#include <algorithm>
#include <diracstep/core/equilibrium/force_balance.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/system/hidden_rows.hpp>
#include <diracstep/core/system/lagrangian_derivatives.hpp>

namespace diracstep {

namespace {

constexpr int most_full = 2000;  // coordinates, and rows
constexpr double dependent_row = 1e-10;

void require_full_size(const Scene& scene) {
  if (scene.dimension() <= most_full && scene.rows() <= most_full) return;
  throw Misuse("scene '" + scene.name + "' has " + std::to_string(scene.dimension()) + " coordinates and " +
               std::to_string(scene.rows()) + " rows; equilibria are looked for with full matrices, of " +
               std::to_string(most_full) + " at most");
}

ConstraintBlocks positions_first(const ConstraintBlocks& blocks) {
  ConstraintBlocks sorted = blocks;
  std::stable_partition(sorted.begin(), sorted.end(),
                        [](const auto& block) { return is_on_positions(*block); });
  return sorted;
}

int rows_on_positions(const ConstraintBlocks& blocks) {
  int count = 0;
  for (const auto& block : blocks) count += is_on_positions(*block) ? block->rows() : 0;
  return count;
}

Columns with_unit_rows(const Columns& matrix) {
  Columns scaled = matrix;
  for (Eigen::Index r = 0; r < scaled.rows(); ++r)
    if (const double size = scaled.row(r).norm(); size > 0.0) scaled.row(r) /= size;
  return scaled;
}

}  // namespace

ForceBalance::ForceBalance(const Scene& scene)
    : on_positions(rows_on_positions(scene.constraints)),
      scene_(scene),
      blocks_(positions_first(scene.constraints)),
      rows_(blocks_, scene.dimension()) {}

void ForceBalance::evaluate(double t, const Vector& q, const Vector& v) {
  t_ = t;
  q_ = q;
  v_ = v;
  const Lagrangian& lagrangian = *scene_.lagrangian;
  const SparsityPattern& pattern = lagrangian.pattern();
  const Eigen::Index n = v.size();
  LagrangianDerivatives l(lagrangian);
  l.take_second(lagrangian, t, q, v);
  const Columns lqv = pattern.full(l.qv);
  Vector lq(n), lv(n), rate(n), f = Vector::Zero(n);
  lagrangian.gradient(t, q, v, lq, lv);
  lagrangian.gradient_rate(t, q, v, rate);
  const Vector convective = lqv.transpose() * v;
  mass = pattern.full(l.vv);
  damping = lqv.transpose() - lqv;
  free_stiffness_ = -pattern.full(l.qq);
  if (scene_.force) {
    const SparsityPattern& of_force = scene_.force->pattern();
    Vector by_q(of_force.nonzeros()), by_v = by_q;
    scene_.force->value(t, q, v, f);
    scene_.force->derivatives(t, q, v, by_q, by_v);
    damping -= of_force.full(by_v);
    free_stiffness_ -= of_force.full(by_q);
  }
  forces = convective + rate - lq - f;
  free_sizes_ = convective.cwiseAbs() + rate.cwiseAbs() + lq.cwiseAbs() + f.cwiseAbs();
  evaluate_rows();
}

void ForceBalance::evaluate_rows() {
  const int m = rows_.rows();
  position.resize(on_positions);
  velocity.setZero(m);
  one_forms = row_derivative = Columns::Zero(m, v_.size());
  if (m == 0) return;
  rows_.evaluate(t_, q_);
  one_forms = rows_.pattern().full(rows_.coefficients());
  velocity = rows_.offsets();
  // At rest the time stands still, and rows on positions that it moves ask for no velocity.
  const double passing = v_.lpNorm<Eigen::Infinity>() > 0.0 ? 1.0 : 0.0;
  velocity.head(on_positions) *= passing;
  velocity += one_forms * v_;
  Vector derivative(rows_.pattern().nonzeros());
  rows_.distribution().derivative(t_, q_, v_, 1.0, derivative);
  row_derivative = rows_.pattern().full(derivative);
  rows_.distribution().derivative(t_, q_, v_, passing, derivative);
  row_derivative.topRows(on_positions) = rows_.pattern().full(derivative).topRows(on_positions);
  const Vector kept = one_forms * (q_ - scene_.start.q) + (t_ - scene_.start.time) * rows_.offsets();
  int row = 0;
  for (const auto& block : blocks_) {
    if (!is_on_positions(*block)) break;
    if (block->holonomic())
      block->position(t_, q_, position.segment(row, block->rows()));
    else
      position.segment(row, block->rows()) = kept.segment(row, block->rows());
    row += block->rows();
  }
}

void ForceBalance::set_multipliers(const Vector& lambda) {
  stiffness = free_stiffness_;
  int row = 0;
  for (const auto& block : blocks_) {
    Vector curvature(block->curvature_pattern().nonzeros());
    block->annihilator_derivative(t_, q_, lambda.segment(row, block->rows()), curvature);
    stiffness -= block->curvature_pattern().full(curvature);
    row += block->rows();
  }
  sizes = free_sizes_ + stiffness.cwiseAbs() * q_.cwiseAbs();
  if (row > 0) sizes += one_forms.cwiseAbs().transpose() * lambda.cwiseAbs();
}

std::shared_ptr<const Scene> with_start_and_hidden_rows(const Scene& scene, const Start& start) {
  require_full_size(scene);
  if (scene.space)
    throw Misuse("scene '" + scene.name + "': equilibria and linear equations are known in R^n only");
  auto copy = std::make_shared<Scene>(scene);
  copy->start = start;
  return with_hidden_rows(with_lagrangian(*copy));
}

Vector least_multipliers(const Columns& one_forms, const Vector& forces) {
  if (one_forms.rows() == 0) return {};
  Eigen::CompleteOrthogonalDecomposition<Columns> decomposition;
  decomposition.setThreshold(dependent_row);
  decomposition.compute(one_forms.transpose());
  return decomposition.solve(forces);
}

Columns null_space(const Columns& matrix) {
  const Eigen::Index n = matrix.cols();
  if (matrix.rows() == 0 || n == 0) return Columns::Identity(n, n);
  Eigen::ColPivHouseholderQR<Columns> qr;
  qr.setThreshold(dependent_row);
  qr.compute(with_unit_rows(matrix).transpose());
  const Columns all = qr.householderQ() * Columns::Identity(n, n);
  return all.rightCols(n - qr.rank());
}

}  // namespace diracstep
