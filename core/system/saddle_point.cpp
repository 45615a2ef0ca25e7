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
      layout_(n_ + m_, n_ + m_),
      momentum_scales_(n_),
      velocity_scales_(m_) {
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

void SaddlePointProblem::set_scales(ConstVectorRef momentum, ConstVectorRef velocity) {
  momentum_scales_.terms = momentum.cwiseAbs();
  velocity_scales_.terms = velocity.cwiseAbs();
  blocks_[0].scale = scale_of(max_norm(momentum_scales_.terms));
  momentum_scales_.give_to(blocks_[0]);
  if (m_ == 0) return;
  blocks_[1].scale = scale_of(max_norm(velocity_scales_.terms));
  velocity_scales_.give_to(blocks_[1]);
}

void SaddlePointProblem::raise_scales(ConstVectorRef momentum, ConstVectorRef x, bool mass) {
  Vector& of_momentum = momentum_scales_.terms;
  of_momentum = of_momentum.cwiseMax(momentum.cwiseAbs());
  if (mass)
    scene_.lagrangian->pattern().for_each([&](Eigen::Index e, int r, int c) {
      of_momentum[r] = std::max(of_momentum[r], std::abs(lvv_[e] * x[c]));
    });
  Vector& of_velocity = velocity_scales_.terms;
  if (m_ > 0)
    rows_.pattern().for_each([&](Eigen::Index e, int r, int c) {
      const double a = std::abs(rows_.coefficients()[e]);
      of_momentum[c] = std::max(of_momentum[c], a * std::abs(x[n_ + r]));
      of_velocity[r] = std::max(of_velocity[r], a * std::abs(x[c]));
    });
  const auto raise = [](ResidualBlock& block, RowScales& scales) {
    const double largest = max_norm(scales.terms);
    if (std::isfinite(largest)) block.scale = std::max(block.scale, scale_of(largest));
    scales.give_to(block);
  };
  raise(blocks_[0], momentum_scales_);
  if (m_ > 0) raise(blocks_[1], velocity_scales_);
}

void VelocityProblem::begin(double t, ConstVectorRef q, ConstVectorRef p) {
  move_to(t, q);
  p_ = p;
  mass_taken_ = false;
  set_scales(p, rows_.offsets());
}

void VelocityProblem::residual(ConstVectorRef x, VectorRef f) {
  const auto v = x.head(n_);
  scene_.lagrangian->gradient(t_, q_, v, lq_, lv_);
  f.head(n_) = lv_ - p_;
  raise_scales(lv_, x, mass_taken_);
  if (m_ == 0) return;
  rows_.add_annihilator(x.tail(m_), f.head(n_), -1.0);
  rows_.velocity_residual(v, f.tail(m_));
}

void VelocityProblem::jacobian(ConstVectorRef x, VectorRef values) {
  if (!mass_known_) scene_.lagrangian->hessian(t_, q_, x.head(n_), lqq_, lqv_, lvv_);
  mass_known_ = scene_.lagrangian->structure().y_hessian_constant;
  mass_taken_ = true;
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
  set_scales(known_force_, known_rate_);
}

void AccelerationProblem::residual(ConstVectorRef x, VectorRef f) {
  f.head(n_).setZero();
  scene_.lagrangian->pattern().multiply_add(lvv_.data(), x.data(), f.data());
  raise_scales(f.head(n_), x, true);
  f.head(n_) -= known_force_;
  if (m_ == 0) return;
  rows_.add_annihilator(x.tail(m_), f.head(n_), -1.0);
  f.tail(m_) = known_rate_;
  rows_.pattern().multiply_add(rows_.coefficients().data(), x.data(), f.data() + n_);
}

void AccelerationProblem::jacobian(ConstVectorRef, VectorRef values) { assemble(values); }

}  // namespace diracstep
