#pragma once

#include <diracstep/core/dirac/generating_function.hpp>
#include <diracstep/core/dirac/step_rule.hpp>
#include <diracstep/core/system/force.hpp>
#include <memory>
#include <optional>

namespace diracstep {

/// The two impulses of a force over one step, on straight segments with the nodes of `rule`:
///
///   F⁻ = h Σ w_i (1−c_i) f(t_i, q_i, (q1−q0)/h),   F⁺ = h Σ w_i c_i f(t_i, q_i, (q1−q0)/h)
///
/// F⁻ acts before the graph of S and F⁺ after it, whatever the type of S (discrete Lagrange–d'Alembert
/// principle, Marsden and West, Acta Numerica 2001, 3.2): order 2 with the midpoint and trapezoidal rules, 1
/// with the others.
class DiscreteForce {
 public:
  DiscreteForce(std::shared_ptr<const Force> force, StepRule rule);
  /// Empty without a force; throws Misuse for generating functions of type 4, which take none.
  static std::optional<DiscreteForce> of(const std::shared_ptr<const Force>& force, StepRule rule,
                                         GeneratingType type);

  const SparsityPattern& pattern() const { return force_->pattern(); }

  /// `increment` is q1 − q0, given apart since it is known to more digits than the difference has.
  void evaluate(Interval step, ConstVectorRef q0, ConstVectorRef q1, ConstVectorRef increment);
  const Vector& minus() const { return minus_; }  ///< F⁻ where it was last evaluated
  const Vector& plus() const { return plus_; }    ///< F⁺

  /// d = ∂F⁻/∂q1 on pattern().
  void minus_by_end(Interval step, ConstVectorRef q0, ConstVectorRef q1, ConstVectorRef increment,
                    VectorRef d);

  /// sizes += those of the terms of F⁻: it, and its derivatives times positions and velocities, which may
  /// cancel in it.
  void add_sizes(Interval step, ConstVectorRef q0, ConstVectorRef q1, ConstVectorRef increment,
                 VectorRef sizes);

 private:
  void move_to(const StepNode& node, Interval step, ConstVectorRef q0, ConstVectorRef q1,
               ConstVectorRef increment);

  std::shared_ptr<const Force> force_;
  StepRule rule_;
  double t_ = 0.0;
  Vector q_, v_, f_, minus_, plus_, fq_, fv_;
};

}  // namespace diracstep
