#include <diracstep/validation/references/implicit_lagrangian_dae.hpp>

namespace diracstep {

bool stabilised(const ConstraintRows& rows, DaeFormulation formulation) {
  return rows.holonomic() && formulation != DaeFormulation::velocity;
}

int dae_unknowns(const Scene& scene, DaeFormulation formulation) {
  int count = scene.storage_size() + 2 * scene.dimension() + scene.rows();
  for (const auto& block : scene.constraints)
    if (stabilised(*block, formulation)) count += block->rows();
  return count;
}

ImplicitLagrangianDae::ImplicitLagrangianDae(const Scene& scene, bool dense, DaeFormulation formulation)
    : lagrangian_(scene.lagrangian),
      force_(scene.force),
      formulation_(formulation),
      n_(scene.dimension()),
      size_(dae_unknowns(scene, formulation)),
      layout_(size_, size_),
      diagonal_(SparsityPattern::diagonal(n_)),
      ones_(Vector::Ones(n_)),
      lq_(Vector::Zero(n_)),
      lv_(Vector::Zero(n_)),
      f_(Vector::Zero(n_)) {
  for (Vector* values : {&lqq_, &lqv_, &lvv_}) values->setZero(lagrangian_->pattern().nonzeros());
  if (force_) fq_ = fv_ = Vector::Zero(force_->pattern().nonzeros());
  int force = 3 * n_, drift = force + scene.rows();
  for (const auto& rows : scene.constraints) {
    const Vector a = Vector::Zero(rows->pattern().nonzeros()), b = Vector::Zero(rows->rows());
    const Vector curvature = Vector::Zero(rows->curvature_pattern().nonzeros());
    rows_.push_back({rows, stabilised(*rows, formulation), force, drift, a, b, a, curvature, curvature});
    force += rows->rows();
    if (rows_.back().stabilised) drift += rows->rows();
  }
  for_each_block(1.0, [this](const SparsityPattern& block, int row, int column, bool transposed, auto&&...) {
    layout_.add(block, row, column, transposed);
  });
  pattern_ = layout_.assemble(dense);
}

/// The blocks of the Jacobian: visit(pattern, first row, first column, transposed, values, factor).
template <class Visit>
void ImplicitLagrangianDae::for_each_block(double cj, Visit visit) {
  const SparsityPattern& hessian = lagrangian_->pattern();
  const int q = 0, v = n_, p = 2 * n_;  // columns; the rows of q̇, ṗ and p begin at the same places
  const double of_multiplier = formulation_ == DaeFormulation::index_2 ? 1.0 : cj;
  visit(diagonal_, q, q, false, ones_, cj);
  visit(diagonal_, q, v, false, ones_, -1.0);
  visit(hessian, v, q, false, lqq_, -1.0);
  visit(hessian, v, v, false, lqv_, -1.0);
  visit(diagonal_, v, p, false, ones_, cj);
  visit(hessian, p, q, true, lqv_, -1.0);
  visit(hessian, p, v, false, lvv_, -1.0);
  visit(diagonal_, p, p, false, ones_, 1.0);
  if (force_) {
    visit(force_->pattern(), v, q, false, fq_, -1.0);
    visit(force_->pattern(), v, v, false, fv_, -1.0);
  }
  for (const Rows& r : rows_) {
    const SparsityPattern &rows = r.rows->pattern(), &curvature = r.rows->curvature_pattern();
    visit(rows, v, r.force, true, r.a, -of_multiplier);
    visit(curvature, v, q, false, r.force_derivative, -1.0);
    visit(rows, r.force, q, false, r.derivative, 1.0);
    visit(rows, r.force, v, false, r.a, 1.0);
    if (!r.stabilised) continue;
    visit(rows, q, r.drift, true, r.a, -of_multiplier);
    visit(curvature, q, q, false, r.drift_derivative, -1.0);
    visit(rows, r.drift, q, false, r.a, 1.0);
  }
}

void ImplicitLagrangianDae::residual(double t, ConstVectorRef y, ConstVectorRef rate, VectorRef f) {
  const Eigen::Index n = n_;
  const auto q = y.head(n), v = y.segment(n, n), p = y.segment(2 * n, n);
  ConstVectorRef multipliers = formulation_ == DaeFormulation::index_2 ? y : rate;
  lagrangian_->gradient(t, q, v, lq_, lv_);
  if (force_) force_->value(t, q, v, f_);
  f.head(n) = rate.head(n) - v;
  f.segment(n, n) = rate.segment(2 * n, n) - lq_ - f_;
  f.segment(2 * n, n) = p - lv_;
  for (Rows& r : rows_) {
    const SparsityPattern& pattern = r.rows->pattern();
    r.rows->coefficients(t, q, r.a, r.b);
    pattern.transposed_multiply_add(r.a.data(), multipliers.data() + r.force, f.data() + n_, -1.0);
    f.segment(r.force, r.rows->rows()) = r.b;
    pattern.multiply_add(r.a.data(), v.data(), f.data() + r.force);
    if (!r.stabilised) continue;
    pattern.transposed_multiply_add(r.a.data(), multipliers.data() + r.drift, f.data(), -1.0);
    r.rows->position(t, q, f.segment(r.drift, r.rows->rows()));
  }
}

void ImplicitLagrangianDae::jacobian(double t, double cj, ConstVectorRef y, ConstVectorRef rate,
                                     VectorRef values) {
  const auto q = y.head(n_), v = y.segment(n_, n_);
  ConstVectorRef multipliers = formulation_ == DaeFormulation::index_2 ? y : rate;
  lagrangian_->hessian(t, q, v, lqq_, lqv_, lvv_);
  if (force_) force_->derivatives(t, q, v, fq_, fv_);
  for (Rows& r : rows_) {
    const int rows = r.rows->rows();
    r.rows->coefficients(t, q, r.a, r.b);
    r.rows->derivative(t, q, v, 1.0, r.derivative);
    r.rows->annihilator_derivative(t, q, multipliers.segment(r.force, rows), r.force_derivative);
    if (r.stabilised)
      r.rows->annihilator_derivative(t, q, multipliers.segment(r.drift, rows), r.drift_derivative);
  }
  values.setZero();
  int number = 0;
  for_each_block(cj, [&](const SparsityPattern&, int, int, bool, const Vector& block, double factor) {
    Eigen::Index k = 0;
    for (const int place : layout_.positions(number++)) values[place] += factor * block[k++];
  });
}

}  // namespace diracstep
