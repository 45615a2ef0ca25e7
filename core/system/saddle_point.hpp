#pragma once

#include <diracstep/core/numerics/nonlinear_solver.hpp>
#include <diracstep/core/numerics/row_scales.hpp>
#include <diracstep/core/system/constraint_distribution.hpp>
#include <diracstep/core/system/scene.hpp>
#include <memory>
#include <vector>

namespace diracstep {

/// The two systems at one configuration whose Jacobian is the saddle-point matrix
///
///     [ ∂²L/∂v²  −Aᵀ ]
///     [    A       0  ]
///
/// They turn a momentum into a velocity of the distribution, and a velocity into an acceleration and the
/// forces of the constraint.  Both are regular where ∂²L/∂v² is so on Δ_Q and the rows are independent.
class SaddlePointProblem : public NonlinearProblem {
 public:
  SaddlePointProblem(const Scene& scene, bool dense);

  int size() const final { return n_ + m_; }
  const SparsityPattern& pattern() const final { return pattern_; }
  std::span<const ResidualBlock> blocks() const final { return blocks_; }
  const double* scales_of_unsolved_rows(ConstVectorRef f, double level) final;

 protected:
  void move_to(double t, ConstVectorRef q);
  /// The saddle-point matrix with ∂²L/∂v² as it stands in lvv_.
  void assemble(VectorRef& values) const;
  /// The right-hand sides, that of the rows beside A times unknowns of such a size.
  void set_scales(ConstVectorRef momentum, ConstVectorRef velocity, double unknowns);
  /// The scales cover the terms at x as well: momenta of such a size, ∂²L/∂v² times x where `mass_taken` says
  /// that it was taken since move_to(), and A times both parts of x.
  void raise_scales(double momentum, ConstVectorRef x, bool mass_taken);

  const Scene& scene_;
  int n_;
  int m_;
  double t_ = 0.0;
  Vector q_;
  ConstraintsAtPoint rows_;
  Vector lq_, lv_, lqq_, lqv_, lvv_;

 private:
  SparsityPattern pattern_;
  BlockPattern layout_;
  std::vector<ResidualBlock> blocks_;
  /// sizes += those of the terms of ∂²L/∂v² times v.
  void add_mass_sizes(ConstVectorRef v, Vector& sizes) const;

  Vector known_, last_x_;         ///< sizes of the right-hand sides; where the residual was last taken
  Vector sizes_, largest_, all_;  ///< workspaces
  RowScales row_scales_;
};

/// Unknowns (v, μ):   ∂L/∂v(q,v) − A(q)ᵀμ = p,   A(q) v + b(q) = 0.
/// Its solution projects the momentum class [p] to the representative ∂L/∂v(q,v) with v ∈ Δ_Q(q).
class VelocityProblem final : public SaddlePointProblem {
 public:
  using SaddlePointProblem::SaddlePointProblem;
  /// `v` is a guess.
  void begin(double t, ConstVectorRef q, ConstVectorRef p, ConstVectorRef v);
  void residual(ConstVectorRef x, VectorRef f) override;
  void jacobian(ConstVectorRef x, VectorRef values) override;

 private:
  Vector p_;
  bool mass_known_ = false;  ///< ∂²L/∂v² is constant and was taken
  bool mass_taken_ = false;  ///< in this solve or known
};

/// Unknowns (a, Λ), linear:   d/dt(∂L/∂v) − ad*_v ∂L/∂v − ∂L/∂q − f = A(q)ᵀΛ,   d/dt(A(q) v + b(q)) = 0,   a
/// = dv/dt. Λ are the forces of the constraint rows: Aᵀ Λ is a generalised force.
class AccelerationProblem final : public SaddlePointProblem {
 public:
  using SaddlePointProblem::SaddlePointProblem;
  void begin(double t, ConstVectorRef q, ConstVectorRef v);
  void residual(ConstVectorRef x, VectorRef f) override;
  void jacobian(ConstVectorRef x, VectorRef values) override;

 private:
  Vector v_, known_force_, known_rate_, row_derivative_;
  bool hessian_known_ = false;  ///< that of a quadratic L, taken once
};

/// Unknown v, linear:   ∂L/∂q(t,q,v) = Dθ(t,q) v + ∂θ/∂t,  that is (Dθᵀ − Dθ) v = ∂H/∂q + ∂θ/∂t: the velocity
/// of a phase-space Lagrangian θ(t,q)·v − H(t,q). Regular where the two-form dθ is.
class PhaseSpaceVelocityProblem final : public NonlinearProblem {
 public:
  PhaseSpaceVelocityProblem(const Scene& scene, bool dense);

  int size() const override { return lagrangian_->dimension(); }
  const SparsityPattern& pattern() const override { return pattern_; }
  std::span<const ResidualBlock> blocks() const override { return blocks_; }

  void begin(double t, ConstVectorRef q);
  void residual(ConstVectorRef v, VectorRef f) override;
  void jacobian(ConstVectorRef v, VectorRef values) override;
  const double* scales_of_unsolved_rows(ConstVectorRef f, double level) override;

 private:
  std::shared_ptr<const Lagrangian> lagrangian_;
  std::vector<int> mirror_;
  SparsityPattern pattern_;
  BlockPattern layout_;
  std::vector<ResidualBlock> blocks_;
  RowScales row_scales_{lagrangian_->dimension()};
  double t_ = 0.0;
  Vector q_, lq_, lv_, lvt_, lqq_, lqv_, lvv_, sizes_, largest_;
};

}  // namespace diracstep
