#include <algorithm>
#include <cmath>
#include <diracstep/core/saddle_point.hpp>

namespace diracstep {

SaddlePointProblem::SaddlePointProblem(const Scene& scene, bool dense)
    : scene_(scene),
      n_(scene.dimension()),
      m_(scene.rows()),
      q_(Vector::Zero(n_)),
      rows_(scene.constraints),
      lq_(Vector::Zero(n_)),
      lv_(Vector::Zero(n_)),
      layout_(n_ + m_, n_ + m_) {
  const SparsityPattern& mass = scene.lagrangian->pattern();
  for (Vector* values : {&lqq_, &lqv_, &lvv_}) values->setZero(mass.nonzeros());
  layout_.add(mass, 0, 0);
  int row = n_;
  for (const auto& block : scene.constraints) {
    layout_.add(block->pattern(), 0, row, true);
    layout_.add(block->pattern(), row, 0);
    row += block->rows();
  }
  pattern_ = layout_.assemble(dense);
  blocks_.push_back({"momentum", n_});
  if (m_ > 0) blocks_.push_back({"velocity", m_});
}

void SaddlePointProblem::move_to(double t, ConstVectorRef q) {
  t_ = t;
  q_ = q;
  if (m_ > 0) rows_.evaluate(t, q);
}

void SaddlePointProblem::assemble(ConstVectorRef v, VectorRef values) {
  scene_.lagrangian->hessian(t_, q_, v, lqq_, lqv_, lvv_);
  values.setZero();
  const auto& mass_places = layout_.positions(0);
  for (std::size_t k = 0; k < mass_places.size(); ++k)
    values[mass_places[k]] = lvv_[static_cast<Eigen::Index>(k)];
  for (std::size_t b = 0; b < scene_.constraints.size(); ++b) {
    const Vector& a = rows_.coefficients(b);
    const auto& force_places = layout_.positions(1 + 2 * static_cast<int>(b));
    const auto& row_places = layout_.positions(2 + 2 * static_cast<int>(b));
    for (std::size_t k = 0; k < row_places.size(); ++k) {
      values[force_places[k]] = -a[static_cast<Eigen::Index>(k)];
      values[row_places[k]] = a[static_cast<Eigen::Index>(k)];
    }
  }
}

void SaddlePointProblem::set_scales(double momentum, double velocity) {
  blocks_[0].scale = momentum > 0.0 && std::isfinite(momentum) ? momentum : 1.0;
  if (m_ == 0) return;
  double one_forms = 0.0;
  for (std::size_t b = 0; b < scene_.constraints.size(); ++b)
    one_forms = std::max(one_forms, rows_.coefficients(b).lpNorm<Eigen::Infinity>());
  const double scale = one_forms * velocity;
  blocks_[1].scale = scale > 0.0 && std::isfinite(scale) ? scale : 1.0;
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
  if (m_ == 0) return;
  rows_.add_annihilator(x.tail(m_), f.head(n_), -1.0);
  rows_.velocity_residual(v, f.tail(m_));
}

void VelocityProblem::jacobian(ConstVectorRef x, VectorRef values) { assemble(x.head(n_), values); }

void AccelerationProblem::begin(double t, ConstVectorRef q, ConstVectorRef v) {
  move_to(t, q);
  v_ = v;
  const Lagrangian& lagrangian = *scene_.lagrangian;
  lagrangian.gradient(t, q, v, lq_, lv_);
  lagrangian.hessian(t, q, v, lqq_, lqv_, lvv_);
  known_force_.resize(n_);
  lagrangian.gradient_rate(t, q, v, known_force_);
  known_force_ = lq_ - known_force_;
  // d/dt(∂L/∂v) holds (∂²L/∂v∂q) v, and lqv is its transpose.
  lagrangian.pattern().transposed_multiply_add(lqv_.data(), v_.data(), known_force_.data(), -1.0);
  known_rate_.setZero(m_);
  int row = 0;
  for (const auto& block : scene_.constraints) {
    Vector derivative(block->pattern().nonzeros()), rate(block->rows());
    block->time_derivative(t, q, v, rate);
    block->derivative(t, q, v, 1.0, derivative);
    block->pattern().multiply_add(derivative.data(), v_.data(), rate.data());
    known_rate_.segment(row, block->rows()) = rate;
    row += block->rows();
  }
  set_scales(known_force_.lpNorm<Eigen::Infinity>(), 1.0);
}

void AccelerationProblem::residual(ConstVectorRef x, VectorRef f) {
  f.head(n_) = -known_force_;
  scene_.lagrangian->pattern().multiply_add(lvv_.data(), x.data(), f.data());
  if (m_ == 0) return;
  rows_.add_annihilator(x.tail(m_), f.head(n_), -1.0);
  f.tail(m_) = known_rate_;
  int row = n_;
  for (std::size_t b = 0; b < scene_.constraints.size(); ++b) {
    scene_.constraints[b]->pattern().multiply_add(rows_.coefficients(b).data(), x.data(), f.data() + row);
    row += scene_.constraints[b]->rows();
  }
}

void AccelerationProblem::jacobian(ConstVectorRef, VectorRef values) { assemble(v_, values); }

}  // namespace diracstep
