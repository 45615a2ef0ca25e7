#pragma once

#include <diracstep/core/numerics/nonlinear_solver.hpp>
#include <diracstep/core/numerics/row_scales.hpp>
#include <diracstep/core/system/constraint_distribution.hpp>
#include <diracstep/core/system/scene.hpp>
#include <vector>

namespace diracstep {

/// The two systems at one point (q,p) of a scene with a Hamiltonian and rows whose Jacobian is
///
///     [ 1  −∂²H/∂p² Aᵀ ]
///     [ A       0      ]
///
/// They are to H what those of saddle_point.hpp are to L, and invert nothing: both are regular where
/// A ∂²H/∂p² Aᵀ is, whether ∂²H/∂p² is or not.
class HamiltonianPointProblem : public NonlinearProblem {
 public:
  HamiltonianPointProblem(const Scene& scene, bool dense);

  int size() const final { return n_ + m_; }
  const SparsityPattern& pattern() const final { return pattern_; }
  std::span<const ResidualBlock> blocks() const final { return blocks_; }
  const double* scales_of_unsolved_rows(ConstVectorRef f, double level) final;

 protected:
  void move_to(double t, ConstVectorRef q);
  /// ∂H/∂q, ∂H/∂p and second derivatives at this momentum.
  void take_first(ConstVectorRef p) { hamiltonian().gradient(t_, q_, p, hq_, hp_); }
  void take_second(ConstVectorRef p) { hamiltonian().hessian(t_, q_, p, hqq_, hqp_, hpp_); }
  void assemble(VectorRef& values);
  /// The scales cover terms of such a size in the first rows, and A times x in the others.
  void raise_scales(double terms, ConstVectorRef x);
  void set_scale(std::size_t block, double scale) { blocks_[block].scale = scale; }
  const Hamiltonian& hamiltonian() const { return *scene_.hamiltonian; }

  const Scene& scene_;
  int n_, m_;
  double t_ = 0.0;
  Vector q_;
  ConstraintsAtPoint rows_;
  Vector hq_, hp_, hqq_, hqp_, hpp_;
  PatternProduct response_;  ///< ∂²H/∂p² Aᵀ
  Vector response_values_;
  Vector own_;  ///< sizes of the terms of the rows beside those of x

 private:
  SparsityPattern pattern_;
  BlockPattern layout_;
  std::vector<ResidualBlock> blocks_;
  Vector last_x_, sizes_, largest_;
  RowScales row_scales_;
};

/// Unknowns (v, μ):   v = ∂H/∂p(q, p + A(q)ᵀμ),   A(q) v + b(q) = 0.
/// p + Aᵀμ is the projected representative of the momentum class [p].
class HamiltonianVelocityProblem final : public HamiltonianPointProblem {
 public:
  using HamiltonianPointProblem::HamiltonianPointProblem;
  void begin(double t, ConstVectorRef q, ConstVectorRef p, ConstVectorRef v);
  void residual(ConstVectorRef x, VectorRef f) override;
  void jacobian(ConstVectorRef x, VectorRef values) override;
  /// p + A(q)ᵀμ with μ in x.
  void project(ConstVectorRef x, Vector& p) const;

 private:
  Vector p_, projected_;
};

/// Unknowns (a, Λ), linear:   a = d/dt ∂H/∂p,   ṗ = −∂H/∂q + f + A(q)ᵀΛ,   d/dt(A(q) v + b(q)) = 0.
class HamiltonianAccelerationProblem final : public HamiltonianPointProblem {
 public:
  using HamiltonianPointProblem::HamiltonianPointProblem;
  /// At a projected momentum p and its velocity v.
  void begin(double t, ConstVectorRef q, ConstVectorRef p, ConstVectorRef v);
  void residual(ConstVectorRef x, VectorRef f) override;
  void jacobian(ConstVectorRef x, VectorRef values) override;

 private:
  Vector known_acceleration_, known_rate_, row_derivative_;
};

/// Throws Misuse where A ∂²H/∂p² Aᵀ is singular at the start of a scene given by a Hamiltonian and near it as
/// well: then forces of some rows move nothing that the rows see, and the row along which they do is named.
void require_regular_rows(const Scene& scene);

}  // namespace diracstep
