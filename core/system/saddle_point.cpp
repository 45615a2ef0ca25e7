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
      known_(Vector::Zero(n_ + m_)),
      last_x_(known_),
      sizes_(known_),
      largest_(known_),
      all_(Vector::Zero(n_)),
      row_scales_(n_ + m_) {
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

void SaddlePointProblem::set_scales(ConstVectorRef momentum, ConstVectorRef velocity, double unknowns) {
  known_.head(n_) = momentum.cwiseAbs();
  blocks_[0].scale = scale_of(max_norm(momentum));
  if (m_ == 0) return;
  known_.tail(m_) = velocity.cwiseAbs();
  blocks_[1].scale = scale_of(max_norm(rows_.coefficients()) * unknowns + max_norm(velocity));
}

/// Beside the right-hand sides ∂²L/∂v², as it was last taken, and A times both parts of x.
const double* SaddlePointProblem::scales_of_unsolved_rows(ConstVectorRef f, double level) {
  if (RowScales::solved(f.data(), known_.data(), n_ + m_, level)) return nullptr;
  sizes_ = known_;
  largest_.setZero();
  all_.setConstant(scene_.lagrangian->structure().quadratic ? 0.0 : max_norm(last_x_.head(n_)));
  add_mass_sizes(last_x_, sizes_);
  add_mass_sizes(all_, largest_);
  if (m_ > 0)
    rows_.pattern().for_each([&](Eigen::Index e, int r, int c) {
      const double a = std::abs(rows_.coefficients()[e]);
      sizes_[c] += a * std::abs(last_x_[n_ + r]);
      sizes_[n_ + r] += a * std::abs(last_x_[c]);
      largest_[n_ + r] += a * all_[c];
    });
  row_scales_.set(0, sizes_.head(n_), largest_.head(n_), blocks_[0].scale);
  if (m_ > 0) row_scales_.set(n_, sizes_.tail(m_), largest_.tail(m_), blocks_[1].scale);
  return row_scales_.unsolved(f, level);
}

void SaddlePointProblem::raise_scales(double momentum, ConstVectorRef x, bool mass_taken) {
  last_x_ = x;
  if (mass_taken && !scene_.lagrangian->structure().y_hessian_diagonal) {  // else these are momenta
    sizes_.setZero();
    add_mass_sizes(x, sizes_);
    momentum = std::max(momentum, max_norm(sizes_));
  }
  const double a = m_ > 0 ? rows_.coefficients().lpNorm<Eigen::Infinity>() : 0.0;
  if (m_ > 0) momentum = std::max(momentum, a * x.tail(m_).lpNorm<Eigen::Infinity>());
  if (std::isfinite(momentum)) blocks_[0].scale = std::max(blocks_[0].scale, momentum);
  if (m_ == 0) return;
  const double velocity = a * x.head(n_).lpNorm<Eigen::Infinity>();
  if (std::isfinite(velocity)) blocks_[1].scale = std::max(blocks_[1].scale, velocity);
}

void SaddlePointProblem::add_mass_sizes(ConstVectorRef v, Vector& sizes) const {
  scene_.lagrangian->pattern().for_each(
      [&](Eigen::Index e, int r, int c) { sizes[r] += std::abs(lvv_[e] * v[c]); });
}

void VelocityProblem::begin(double t, ConstVectorRef q, ConstVectorRef p, ConstVectorRef v) {
  move_to(t, q);
  p_ = p;
  mass_taken_ = mass_known_;
  set_scales(p, rows_.offsets(), max_norm(v));
}

void VelocityProblem::residual(ConstVectorRef x, VectorRef f) {
  const auto v = x.head(n_);
  scene_.lagrangian->gradient(t_, q_, v, lq_, lv_);
  f.head(n_) = lv_ - p_;
  raise_scales(lv_.lpNorm<Eigen::Infinity>(), x, mass_taken_);
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
  scene_.add_turning(v, lv_, known_force_);
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
  set_scales(known_force_, known_rate_, max_norm(known_force_) / size_or_one(max_norm(lvv_)));
}

void AccelerationProblem::residual(ConstVectorRef x, VectorRef f) {
  f.head(n_).setZero();
  scene_.lagrangian->pattern().multiply_add(lvv_.data(), x.data(), f.data());
  raise_scales(f.head(n_).lpNorm<Eigen::Infinity>(), x, true);
  f.head(n_) -= known_force_;
  if (m_ == 0) return;
  rows_.add_annihilator(x.tail(m_), f.head(n_), -1.0);
  f.tail(m_) = known_rate_;
  rows_.pattern().multiply_add(rows_.coefficients().data(), x.data(), f.data() + n_);
}

void AccelerationProblem::jacobian(ConstVectorRef, VectorRef values) { assemble(values); }

PhaseSpaceVelocityProblem::PhaseSpaceVelocityProblem(const Scene& scene, bool dense)
    : lagrangian_(scene.lagrangian),
      mirror_(lagrangian_->pattern().transposed_positions()),
      layout_(lagrangian_->dimension(), lagrangian_->dimension()),
      blocks_{{"two-form", lagrangian_->dimension()}} {
  layout_.add(lagrangian_->pattern(), 0, 0);
  pattern_ = layout_.assemble(dense);
  for (Vector* column : {&q_, &lq_, &lv_, &lvt_, &sizes_, &largest_})
    column->setZero(lagrangian_->dimension());
  for (Vector* values : {&lqq_, &lqv_, &lvv_}) values->setZero(lagrangian_->pattern().nonzeros());
}

void PhaseSpaceVelocityProblem::begin(double t, ConstVectorRef q) {
  t_ = t;
  q_ = q;
  const Vector zero = Vector::Zero(q.size());
  lagrangian_->hessian(t, q, zero, lqq_, lqv_, lvv_);
  lagrangian_->gradient(t, q, zero, lq_, lv_);
  lagrangian_->gradient_rate(t, q, zero, lvt_);
  blocks_[0].scale = scale_of(std::max(max_norm(lq_), max_norm(lvt_)));
}

void PhaseSpaceVelocityProblem::residual(ConstVectorRef v, VectorRef f) {
  lagrangian_->gradient(t_, q_, v, lq_, lv_);
  f = lq_ - lvt_;
  lagrangian_->pattern().transposed_multiply_add(lqv_.data(), v.data(), f.data(), -1.0);
}

void PhaseSpaceVelocityProblem::jacobian(ConstVectorRef, VectorRef values) {
  values.setZero();
  const auto& places = layout_.positions(0);
  for (std::size_t e = 0; e < places.size(); ++e)
    values[places[e]] = lqv_[static_cast<Eigen::Index>(e)] - lqv_[mirror_[e]];
}

const double* PhaseSpaceVelocityProblem::scales_of_unsolved_rows(ConstVectorRef f, double level) {
  sizes_ = lq_.cwiseAbs().cwiseMax(lvt_.cwiseAbs());
  if (RowScales::solved(f.data(), sizes_.data(), size(), level)) return nullptr;
  largest_.setZero();
  const double largest_q = lagrangian_->structure().quadratic ? 0.0 : max_norm(q_);
  lagrangian_->pattern().for_each([&](Eigen::Index e, int r, int c) {
    sizes_[r] += std::abs(lqq_[e] * q_[c]);
    largest_[r] += std::abs(lqq_[e]) * largest_q;
  });
  row_scales_.set(0, sizes_, largest_, blocks_[0].scale);
  return row_scales_.unsolved(f, level);
}

}  // namespace diracstep
