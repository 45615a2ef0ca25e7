#include <cmath>
#include <diracstep/core/numerics/combination.hpp>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/steps/gauss_lobatto/hamiltonian_stages.hpp>
#include <utility>

namespace diracstep {

HamiltonianStages::HamiltonianStages(std::shared_ptr<const Hamiltonian> hamiltonian,
                                     std::shared_ptr<const Force> force, int stages)
    : hamiltonian_(std::move(hamiltonian)),
      force_(std::move(force)),
      s_(stages),
      n_(hamiltonian_->dimension()),
      separable_(hamiltonian_->structure().separable),
      mirror_(hamiltonian_->pattern().transposed_positions()) {
  for (Columns* columns : {&p_, &forces_, &hp_}) columns->setZero(n_, s_);
  for (Columns* blocks : {&hqq_, &hqp_, &hpp_}) blocks->setZero(hamiltonian_->pattern().nonzeros(), s_);
  block_.setZero(hqq_.rows());
  if (!force_) return;
  f_.setZero(n_);
  fq_.setZero(force_->pattern().nonzeros(), s_);
  fv_ = fq_;
  force_block_.setZero(fq_.rows());
}

void HamiltonianStages::plan(BlockPattern& layout) {
  const SparsityPattern& h = hamiltonian_->pattern();
  const int ns = n_ * s_;
  for (int i = 0; i < s_; ++i)
    for (int k = 0; k < s_; ++k) layout.add(h, n_ * i, n_ * k);
  for (int i = 0; i < s_; ++i) {
    const int number = layout.add(h, ns + n_ * i, ns + n_ * i);
    if (i == 0) diagonal_layout_ = number;
    layout.add(SparsityPattern::diagonal(n_), n_ * i, ns + n_ * i);
    layout.add(SparsityPattern::diagonal(n_), ns + n_ * i, n_ * i);
  }
  for (int i = 0; !separable_ && i < s_; ++i)
    for (int k = 0; k < s_; ++k) {
      const int number = layout.add(h, n_ * i, ns + n_ * k);
      if (mixed_layout_ < 0) mixed_layout_ = number;
      layout.add(h, ns + n_ * i, n_ * k);
    }
  for (int i = 0; force_ && i < s_; ++i)
    for (int k = 0; k < s_; ++k) {
      const int number = layout.add(force_->pattern(), n_ * i, n_ * k);
      if (force_layout_ < 0) force_layout_ = number;
    }
}

void HamiltonianStages::evaluate(const NodePoints& at, ConstVectorRef x) {
  p_ = x.segment(n_ * s_, n_ * s_).reshaped(n_, s_);
  hamiltonian_->gradients(at.at_gauss(p_.data()), forces_.data(), hp_.data());
  forces_ = -forces_;
  for (int i = 0; force_ && i < s_; ++i) {
    force_->value(at.gauss_time(i), at.gauss.col(i), x.segment(n_ * i, n_), f_);
    forces_.col(i) += f_;
  }
}

void HamiltonianStages::set_jacobian(const NodePoints& at, const NodeWeights& weights,
                                     const BlockPattern& layout, ConstVectorRef x, VectorRef& values) {
  hamiltonian_->hessians(at.at_gauss(p_.data()), hqq_.data(), hqp_.data(), hpp_.data());
  for (int i = 0; force_ && i < s_; ++i)
    force_->derivatives(at.gauss_time(i), at.gauss.col(i), x.segment(n_ * i, n_), fq_.col(i), fv_.col(i));
  values.setZero();
  for (int i = 0; i < s_; ++i) {
    layout.add_to(values.data(), diagonal_layout_ + 3 * i, -1.0, hpp_.col(i).data());
    for (const int identity : {1, 2})
      for (const int place : layout.positions(diagonal_layout_ + 3 * i + identity)) values[place] += 1.0;
    for (int k = 0; k < s_; ++k) {
      add_blocks(weights, layout, i, k, values);
      if (force_) add_force(weights, layout, i, k, values);
    }
  }
}

void HamiltonianStages::add_blocks(const NodeWeights& weights, const BlockPattern& layout, int i, int k,
                                   VectorRef& values) {
  const int pair = i * s_ + k;
  combine(static_cast<int>(block_.size()), s_, &weights.stiffness(0, pair), hqq_.data(), nullptr,
          block_.data());
  layout.add_to(values.data(), pair, -1.0, block_.data());
  if (separable_) return;
  layout.add_to(values.data(), mixed_layout_ + 2 * pair, -weights.force(k, i), hqp_.col(k).data());
  for (Eigen::Index e = 0; e < block_.size(); ++e) block_[e] = hqp_(mirror_[static_cast<std::size_t>(e)], i);
  layout.add_to(values.data(), mixed_layout_ + 2 * pair + 1, -weights.position(k, i), block_.data());
}

void HamiltonianStages::add_force(const NodeWeights& weights, const BlockPattern& layout, int i, int k,
                                  VectorRef& values) {
  const int pair = i * s_ + k;
  combine(static_cast<int>(force_block_.size()), s_, &weights.stiffness(0, pair), fq_.data(), nullptr,
          force_block_.data());
  force_block_ += weights.force(k, i) * fv_.col(k);
  layout.add_to(values.data(), force_layout_ + pair, 1.0, force_block_.data());
}

void HamiltonianStages::evaluate_start(double t, ConstVectorRef q0, ConstVectorRef p0, ConstVectorRef v0) {
  hamiltonian_->gradient(t, q0, p0, forces_.col(0), hp_.col(0));
  hamiltonian_->hessian(t, q0, p0, hqq_.col(0), hqp_.col(0), hpp_.col(0));
  if (!force_) return;
  force_->value(t, q0, v0, f_);
  forces_.col(0) = f_ - forces_.col(0);
}

void HamiltonianStages::prepare_sizes(const NodePoints& at) {
  hamiltonian_->hessian(at.gauss_time(0), at.gauss.col(0), p_.col(0), hqq_.col(0), hqp_.col(0), hpp_.col(0));
}

HamiltonianStages::Largest HamiltonianStages::largest() const {
  const Eigen::Index size = hqq_.rows();
  return {largest_entry(hqq_.data(), size), largest_entry(hqp_.data(), size),
          largest_entry(hpp_.data(), size)};
}

void HamiltonianStages::add_sizes(double h, const Vector& q, const Vector& p, Vector& momenta,
                                  Vector& velocities) const {
  hamiltonian_->pattern().for_each([&](Eigen::Index e, int r, int c) {
    const double mixed = std::abs(hqp_(e, 0));
    momenta[r] += h * (std::abs(hqq_(e, 0) * q[c]) + mixed * std::abs(p[c]));
    velocities[r] += std::abs(hpp_(e, 0) * p[c]);
    velocities[c] += mixed * std::abs(q[r]);
  });
}

}  // namespace diracstep
