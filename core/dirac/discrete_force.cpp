#include <cmath>
#include <diracstep/core/dirac/discrete_force.hpp>
#include <diracstep/core/numerics/errors.hpp>

namespace diracstep {

DiscreteForce::DiscreteForce(std::shared_ptr<const Force> force, StepRule rule)
    : force_(std::move(force)), rule_(rule) {
  for (Vector* column : {&q_, &v_, &f_, &minus_, &plus_}) column->setZero(force_->dimension());
  for (Vector* values : {&fq_, &fv_}) values->setZero(force_->pattern().nonzeros());
}

std::optional<DiscreteForce> DiscreteForce::of(const std::shared_ptr<const Force>& force, StepRule rule,
                                               GeneratingType type) {
  if (!force) return std::nullopt;
  if (type == GeneratingType::four) throw Misuse("generating functions of type 4 take no forces");
  return DiscreteForce(force, rule);
}

void DiscreteForce::move_to(const StepNode& node, Interval step, ConstVectorRef q0, ConstVectorRef q1,
                            ConstVectorRef increment) {
  t_ = step.start + node.c * step.size;
  q_ = (1.0 - node.c) * q0 + node.c * q1;
  v_ = increment / step.size;
}

void DiscreteForce::evaluate(Interval step, ConstVectorRef q0, ConstVectorRef q1, ConstVectorRef increment) {
  minus_.setZero();
  plus_.setZero();
  for (const StepNode& node : step_nodes(rule_)) {
    move_to(node, step, q0, q1, increment);
    force_->value(t_, q_, v_, f_);
    minus_ += step.size * node.weight * (1.0 - node.c) * f_;
    plus_ += step.size * node.weight * node.c * f_;
  }
}

void DiscreteForce::minus_by_end(Interval step, ConstVectorRef q0, ConstVectorRef q1,
                                 ConstVectorRef increment, VectorRef d) {
  d.setZero();
  for (const StepNode& node : step_nodes(rule_)) {
    if (node.c == 1.0) continue;
    move_to(node, step, q0, q1, increment);
    force_->derivatives(t_, q_, v_, fq_, fv_);
    d += node.weight * (1.0 - node.c) * (step.size * node.c * fq_ + fv_);
  }
}

void DiscreteForce::add_sizes(Interval step, ConstVectorRef q0, ConstVectorRef q1, ConstVectorRef increment,
                              VectorRef sizes) {
  for (const StepNode& node : step_nodes(rule_)) {
    const double factor = std::abs(step.size * node.weight * (1.0 - node.c));
    if (factor == 0.0) continue;
    move_to(node, step, q0, q1, increment);
    force_->value(t_, q_, v_, f_);
    force_->derivatives(t_, q_, v_, fq_, fv_);
    sizes += factor * f_.cwiseAbs();
    force_->pattern().for_each([&](Eigen::Index e, int r, int c) {
      sizes[r] += factor * (std::abs(fq_[e] * q_[c]) + std::abs(fv_[e] * v_[c]));
    });
  }
}

}  // namespace diracstep
