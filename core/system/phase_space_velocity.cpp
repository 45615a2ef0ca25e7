#include <algorithm>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/system/phase_space_velocity.hpp>

namespace diracstep {

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
