#include <diracstep/sensitivities/detail/extended_scene.hpp>
#include <utility>

namespace diracstep::sensitivity {

ExtendedScene::ExtendedScene(std::shared_ptr<const Scene> scene, int n, Vector parameters)
    : scene_(std::move(scene)), n_(n), parameters_(std::move(parameters)) {
  point_.setZero(size());
  point_.tail(parameters_.size()) = parameters_;
  velocity_.setZero(size());
}

void ExtendedScene::set_parameters(ConstVectorRef values) {
  parameters_ = values;
  point_.tail(parameters_.size()) = parameters_;
}

const Vector& ExtendedScene::point(ConstVectorRef q) {
  point_.head(n_) = q;
  return point_;
}

const Vector& ExtendedScene::velocity(ConstVectorRef v) {
  velocity_.head(n_) = v;
  return velocity_;
}

template <class Matrix>
void ExtendedScene::take(double t, ConstVectorRef q, ConstVectorRef v, bool with_force,
                         LagrangianAt<Matrix>& at) {
  const Lagrangian& l = *scene_->lagrangian;
  const SparsityPattern& pattern = l.pattern();
  for (Vector* values : {&qq_, &qv_, &vv_}) values->resize(pattern.nonzeros());
  l.hessian(t, point(q), velocity(v), qq_, qv_, vv_);
  at.q_by_point = part_of<Matrix>(pattern, qq_.data(), 0, n_, 0, size());
  at.v_by_point = part_of<Matrix>(pattern, qv_.data(), 0, size(), 0, n_).transpose();
  at.q_by_velocity = part_of<Matrix>(pattern, qv_.data(), 0, n_, 0, n_);
  at.v_by_velocity = part_of<Matrix>(pattern, vv_.data(), 0, n_, 0, n_);
  if (!with_force || !scene_->force) return;
  const ForceAt<Matrix> f = force<Matrix>(t, q, v);
  at.q_by_point += f.by_point;
  at.q_by_velocity += f.by_velocity;
}

template <class Matrix>
ExtendedScene::ForceAt<Matrix> ExtendedScene::force(double t, ConstVectorRef q, ConstVectorRef v) {
  const SparsityPattern& pattern = scene_->force->pattern();
  qq_.resize(pattern.nonzeros());
  qv_.resize(pattern.nonzeros());
  scene_->force->derivatives(t, point(q), velocity(v), qq_, qv_);
  return {part_of<Matrix>(pattern, qq_.data(), 0, n_, 0, size()),
          part_of<Matrix>(pattern, qv_.data(), 0, n_, 0, n_)};
}

template <class Matrix>
Matrix ExtendedScene::coefficients(const ConstraintRows& rows, double t, ConstVectorRef q) {
  values_.resize(rows.pattern().nonzeros());
  offsets_.resize(rows.rows());
  rows.coefficients(t, point(q), values_, offsets_);
  return matrix_of<Matrix>(rows.pattern(), values_);
}

template <class Matrix>
Matrix ExtendedScene::derivative(const ConstraintRows& rows, double t, ConstVectorRef q, ConstVectorRef w,
                                 double s) {
  values_.resize(rows.pattern().nonzeros());
  rows.derivative(t, point(q), velocity(w), s, values_);
  return matrix_of<Matrix>(rows.pattern(), values_);
}

template <class Matrix>
Matrix ExtendedScene::annihilator_derivative(const ConstraintRows& rows, double t, ConstVectorRef q,
                                             ConstVectorRef lambda) {
  const SparsityPattern& pattern = rows.curvature_pattern();
  values_.resize(pattern.nonzeros());
  rows.annihilator_derivative(t, point(q), lambda, values_);
  return part_of<Matrix>(pattern, values_.data(), 0, n_, 0, size());
}

template <class Matrix>
Matrix ExtendedScene::all_coefficients(double t, ConstVectorRef q) {
  BlockSum<Matrix> all(rows(), n_);
  int row = 0;
  for (const auto& block : scene_->constraints) {
    all.add(row, 0, left_columns(coefficients<Matrix>(*block, t, q), n_));
    row += block->rows();
  }
  return all.result();
}

template <class Matrix>
Matrix ExtendedScene::all_derivatives(double t, ConstVectorRef q, ConstVectorRef w, double s) {
  BlockSum<Matrix> all(rows(), size());
  int row = 0;
  for (const auto& block : scene_->constraints) {
    all.add(row, 0, derivative<Matrix>(*block, t, q, w, s));
    row += block->rows();
  }
  return all.result();
}

template <class Matrix>
Matrix ExtendedScene::all_annihilator_derivatives(double t, ConstVectorRef q, ConstVectorRef lambda) {
  Matrix all = zero<Matrix>(n_, size());
  Eigen::Index row = 0;
  for (const auto& block : scene_->constraints) {
    all += annihilator_derivative<Matrix>(*block, t, q, lambda.segment(row, block->rows()));
    row += block->rows();
  }
  return all;
}

template void ExtendedScene::take(double, ConstVectorRef, ConstVectorRef, bool, LagrangianAt<Columns>&);
template void ExtendedScene::take(double, ConstVectorRef, ConstVectorRef, bool, LagrangianAt<Sparse>&);
#define DIRACSTEP_FOR_BOTH(Matrix)                                                                         \
  template ExtendedScene::ForceAt<Matrix> ExtendedScene::force(double, ConstVectorRef, ConstVectorRef);    \
  template Matrix ExtendedScene::coefficients(const ConstraintRows&, double, ConstVectorRef);              \
  template Matrix ExtendedScene::derivative(const ConstraintRows&, double, ConstVectorRef, ConstVectorRef, \
                                            double);                                                       \
  template Matrix ExtendedScene::annihilator_derivative(const ConstraintRows&, double, ConstVectorRef,     \
                                                        ConstVectorRef);                                   \
  template Matrix ExtendedScene::all_coefficients(double, ConstVectorRef);                                 \
  template Matrix ExtendedScene::all_derivatives(double, ConstVectorRef, ConstVectorRef, double);          \
  template Matrix ExtendedScene::all_annihilator_derivatives(double, ConstVectorRef, ConstVectorRef);
DIRACSTEP_FOR_BOTH(Columns)
DIRACSTEP_FOR_BOTH(Sparse)
#undef DIRACSTEP_FOR_BOTH

}  // namespace diracstep::sensitivity
