#include <algorithm>
#include <cmath>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/system/saddle_point.hpp>

namespace diracstep {

SaddlePointProblem::SaddlePointProblem(const Scene& scene, bool dense)
    : scene_(scene),
      n_(scene.dimension()),
      m_(scene.rows()),
      q_(Vector::Zero(scene.storage_size())),
      rows_(scene.constraints, n_),
      lq_(Vector::Zero(n_)),
      lv_(Vector::Zero(n_)),
      layout_(n_ + m_, n_ + m_) {
  const SparsityPattern& mass = scene.lagrangian->pattern();
  for (Vector* values : {&lqq_, &lqv_, &lvv_}) values->setZero(mass.nonzeros());
  layout_.add(mass, 0, 0);
  layout_.add(rows_.pattern(), 0, n_, true);
  layout_.add(rows_.pattern(), n_, 0);
  pattern_ = layout_.assemble(dense);
  blocks_.push_back({"momentum", n_});
  if (m_ > 0) blocks_.push_back({"velocity", m_});
}

void SaddlePointProblem::move_to(double t, ConstVectorRef q) {
  t_ = t;
  q_ = q;
  if (m_ > 0) rows_.evaluate(t, q);
}

void SaddlePointProblem::assemble(VectorRef& values) const {
  values.setZero();
  layout_.add_to(values.data(), 0, 1.0, lvv_.data());
  layout_.add_to(values.data(), 1, -1.0, rows_.coefficients().data());
  layout_.add_to(values.data(), 2, 1.0, rows_.coefficients().data());
}

void SaddlePointProblem::set_scales(double momentum, double velocity) {
  blocks_[0].scale = usable_scale(momentum);
  if (m_ == 0) return;
  blocks_[1].scale = usable_scale(max_norm(rows_.coefficients()) * velocity);
}

void SaddlePointProblem::raise_scales(double momentum, ConstVectorRef x) {
  const double a = m_ > 0 ? rows_.coefficients().lpNorm<Eigen::Infinity>() : 0.0;
  if (m_ > 0) momentum = std::max(momentum, a * x.tail(m_).lpNorm<Eigen::Infinity>());
  if (std::isfinite(momentum)) blocks_[0].scale = std::max(blocks_[0].scale, momentum);
  if (m_ == 0) return;
  const double velocity = a * x.head(n_).lpNorm<Eigen::Infinity>();
  if (std::isfinite(velocity)) blocks_[1].scale = std::max(blocks_[1].scale, velocity);
}

void VelocityProblem::begin(double t, ConstVectorRef q, ConstVectorRef p) {
  move_to(t, q);
  p_ = p;
  set_scales(p.lpNorm<Eigen::Infinity>(), 1.0);
}

void VelocityProblem::residual(ConstVectorRef x, VectorRef f) {
  const auto v = x.head(n_);
  scene_.lagrangian->gradient(t_, q_, v, lq_, lv_);
  f.head(n_) = lv_ - p_;
  raise_scales(lv_.lpNorm<Eigen::Infinity>(), x);
  if (m_ == 0) return;
  rows_.add_annihilator(x.tail(m_), f.head(n_), -1.0);
  rows_.velocity_residual(v, f.tail(m_));
}

void VelocityProblem::jacobian(ConstVectorRef x, VectorRef values) {
  if (!mass_known_) scene_.lagrangian->hessian(t_, q_, x.head(n_), lqq_, lqv_, lvv_);
  mass_known_ = scene_.lagrangian->structure().y_hessian_constant;
  assemble(values);
}

void AccelerationProblem::begin(double t, ConstVectorRef q, ConstVectorRef v) {
  move_to(t, q);
  v_ = v;
  const Lagrangian& lagrangian = *scene_.lagrangian;
  lagrangian.gradient(t, q, v, lq_, lv_);
  if (!hessian_known_) lagrangian.hessian(t, q, v, lqq_, lqv_, lvv_);
  hessian_known_ = lagrangian.structure().quadratic;
  known_force_.resize(n_);
  lagrangian.gradient_rate(t, q, v, known_force_);
  known_force_ = lq_ - known_force_;
  if (scene_.force) {
    scene_.force->value(t, q, v, lv_);
    known_force_ += lv_;
  }
  // d/dt(∂L/∂v) holds (∂²L/∂v∂q) v, and lqv is its transpose.
  lagrangian.pattern().transposed_multiply_add(lqv_.data(), v_.data(), known_force_.data(), -1.0);
  if (m_ > 0) {
    row_derivative_.resize(rows_.pattern().nonzeros());
    known_rate_.resize(m_);
    rows_.distribution().time_derivative(t, q, v, known_rate_);
    rows_.distribution().derivative(t, q, v, 1.0, row_derivative_);
    rows_.pattern().multiply_add(row_derivative_.data(), v_.data(), known_rate_.data());
  }
  set_scales(known_force_.lpNorm<Eigen::Infinity>(), 1.0);
}

void AccelerationProblem::residual(ConstVectorRef x, VectorRef f) {
  f.head(n_).setZero();
  scene_.lagrangian->pattern().multiply_add(lvv_.data(), x.data(), f.data());
  raise_scales(f.head(n_).lpNorm<Eigen::Infinity>(), x);
  f.head(n_) -= known_force_;
  if (m_ == 0) return;
  rows_.add_annihilator(x.tail(m_), f.head(n_), -1.0);
  f.tail(m_) = known_rate_;
  rows_.pattern().multiply_add(rows_.coefficients().data(), x.data(), f.data() + n_);
}

void AccelerationProblem::jacobian(ConstVectorRef, VectorRef values) { assemble(values); }

}  // namespace diracstep
