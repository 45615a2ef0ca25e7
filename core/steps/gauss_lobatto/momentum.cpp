#include <algorithm>
#include <cmath>
#include <diracstep/core/numerics/combination.hpp>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/steps/gauss_lobatto/momentum.hpp>
#include <utility>

namespace diracstep {

StageMomentum::StageMomentum(std::shared_ptr<const Lagrangian> lagrangian, std::shared_ptr<const Force> force,
                             int stages, bool dense)
    : lagrangian_(std::move(lagrangian)),
      force_(std::move(force)),
      s_(stages),
      n_(lagrangian_->pattern().rows()),
      separable_(lagrangian_->structure().separable),
      same_jacobian_(lagrangian_->structure().quadratic && !force_ && dense) {
  for (Columns* columns : {&lq_, &lv_}) columns->setZero(n_, s_);
  const int nonzeros = lagrangian_->pattern().nonzeros();
  for (Columns* blocks : {&lqq_, &lqv_, &lvv_}) blocks->setZero(nonzeros, s_);
  if (!separable_) mirror_ = lagrangian_->pattern().transposed_positions();
  block_.setZero(nonzeros);
  if (!force_) return;
  f_.setZero(n_);
  fq_.setZero(force_->pattern().nonzeros(), s_);
  fv_ = fq_;
  force_block_.setZero(fq_.rows());
}

void StageMomentum::plan(BlockPattern& layout) const {
  for (int i = 0; i < s_; ++i)
    for (int k = 0; k < s_; ++k) layout.add(lagrangian_->pattern(), n_ * i, n_ * k);
  if (!force_) return;
  for (int i = 0; i < s_; ++i)
    for (int k = 0; k < s_; ++k) layout.add(force_->pattern(), n_ * i, n_ * k);
}

void StageMomentum::evaluate(const NodePoints& at, ConstVectorRef x) {
  lagrangian_->gradients(at.at_gauss(x.data()), lq_.data(), lv_.data());
  for (int i = 0; force_ && i < s_; ++i) {
    force_->value(at.gauss_time(i), at.gauss.col(i), x.segment(n_ * i, n_), f_);
    lq_.col(i) += f_;
  }
}

bool StageMomentum::second_derivatives(const NodePoints& at, ConstVectorRef x) {
  const bool taken = !hessians_known_;
  if (taken) lagrangian_->hessians(at.at_gauss(x.data()), lqq_.data(), lqv_.data(), lvv_.data());
  for (int i = 0; force_ && i < s_; ++i)
    force_->derivatives(at.gauss_time(i), at.gauss.col(i), x.segment(n_ * i, n_), fq_.col(i), fv_.col(i));
  if (taken) hessians_known_ = lagrangian_->structure().quadratic && all_finite();
  return taken || force_;
}

/// Those of a quadratic L are kept for good, where they are numbers.
bool StageMomentum::all_finite() const { return lqq_.allFinite() && lqv_.allFinite() && lvv_.allFinite(); }

void StageMomentum::second_derivatives(const NodePoints& at, ConstVectorRef x, int stage) {
  lagrangian_->hessian(at.gauss_time(stage), at.gauss.col(stage), x.segment(n_ * stage, n_), lqq_.col(stage),
                       lqv_.col(stage), lvv_.col(stage));
}

/// Of a quadratic L the values are those of the last Jacobian with this step size.
void StageMomentum::set_jacobian(const NodePoints& at, const NodeWeights& weights, const BlockPattern& layout,
                                 VectorRef& values) {
  if (same_jacobian_ && jacobian_step_ == at.step.size) {
    values = jacobian_;
    return;
  }
  values.setZero();
  for (int i = 0; i < s_; ++i)
    for (int k = 0; k < s_; ++k) {
      add_block(weights, layout, i, k, values);
      if (force_) add_force_block(weights, layout, i, k, values);
    }
  if (!same_jacobian_ || !hessians_known_) return;
  jacobian_ = values;
  jacobian_step_ = at.step.size;
}

void StageMomentum::place(StageArrays& arrays) {
  arrays.lagrangian = lagrangian_.get();
  arrays.lq = lq_.data();
  arrays.lv = lv_.data();
  arrays.lqq = lqq_.data();
  arrays.lqv = lqv_.data();
  arrays.lvv = lvv_.data();
}

bool StageMomentum::jacobian_known(const NodePoints& at) {
  const bool known = hessians_known_ && jacobian_step_ == at.step.size;
  jacobian_step_ = hessians_known_ ? at.step.size : 0.0;
  return known;
}

void StageMomentum::add_block(const NodeWeights& weights, const BlockPattern& layout, int i, int k,
                              VectorRef& values) {
  const auto size = static_cast<int>(lvv_.rows());
  double* const block = block_.data();
  combine(size, s_, &weights.stiffness(0, i * s_ + k), lqq_.data(), nullptr, block);
  if (!separable_)
    for (int e = 0; e < size; ++e)
      block[e] += weights.force(k, i) * lqv_(e, k) +
                  weights.position(k, i) * lqv_(mirror_[static_cast<std::size_t>(e)], i);
  if (i == k)
    for (int e = 0; e < size; ++e) block[e] += lvv_(e, i);
  layout.add_to(values.data(), i * s_ + k, 1.0, block);
}

void StageMomentum::add_force_block(const NodeWeights& weights, const BlockPattern& layout, int i, int k,
                                    VectorRef& values) {
  combine(static_cast<int>(force_block_.size()), s_, &weights.stiffness(0, i * s_ + k), fq_.data(), nullptr,
          force_block_.data());
  force_block_ += weights.force(k, i) * fv_.col(k);
  layout.add_to(values.data(), s_ * s_ + i * s_ + k, 1.0, force_block_.data());
}

void StageMomentum::evaluate_start(double t, ConstVectorRef q0, ConstVectorRef v0) {
  lagrangian_->gradient(t, q0, v0, lq_.col(0), lv_.col(0));
  lagrangian_->hessian(t, q0, v0, lqq_.col(0), lqv_.col(0), lvv_.col(0));
  if (!force_) return;
  force_->value(t, q0, v0, f_);
  force_->derivatives(t, q0, v0, fq_.col(0), fv_.col(0));
  lq_.col(0) += f_;
}

double StageMomentum::curvature_size(int stages) const {
  return std::max(largest_entry(lqq_.data(), lqq_.rows() * stages),
                  largest_entry(fq_.data(), fq_.rows() * stages));
}

void StageMomentum::prepare_sizes(const NodePoints& at, ConstVectorRef x) {
  if (!hessians_known_) second_derivatives(at, x, 0);
  if (force_) force_->derivatives(at.gauss_time(0), at.gauss.col(0), x.head(n_), fq_.col(0), fv_.col(0));
}

void StageMomentum::add_sizes(double h, const Vector& q, const Vector& v, Vector& sizes) const {
  pattern().for_each([&](Eigen::Index e, int r, int c) {
    const double by_velocity = std::abs(lvv_(e, 0)) + h * std::abs(lqv_(e, 0)) + h * h * std::abs(lqq_(e, 0));
    sizes[r] += by_velocity * std::abs(v[c]) + h * std::abs(lqq_(e, 0) * q[c]);
    sizes[c] += std::abs(lqv_(e, 0)) * (std::abs(q[r]) + h * std::abs(v[r]));
  });
  if (!force_) return;
  force_->pattern().for_each([&](Eigen::Index e, int r, int c) {
    const double by_velocity = h * std::abs(fv_(e, 0)) + h * h * std::abs(fq_(e, 0));
    sizes[r] += by_velocity * std::abs(v[c]) + h * std::abs(fq_(e, 0) * q[c]);
  });
}

}  // namespace diracstep
