#pragma once

#include <diracstep/core/steps/groups/sizes.hpp>
#include <diracstep/core/system/scene.hpp>
#include <vector>

namespace diracstep {

/// L, force and rows of a scene at one configuration of its space, as columns of the Lie algebra ("group
/// columns" of space.hpp; d = Space::group_dimension(), which is D where that is known).
///
/// Where a factor is a sphere, the functions are those of its two velocities, and what they are along the
/// turn e_a that nothing sees follows from ℓ(g r, Ad_r⁻¹ ξ) = ℓ(g, ξ): with L alone ⟨∂L/∂g, e_a⟩ =
/// ⟨∂L/∂ξ, [e_a, ξ]⟩, and any covector c of the scene has e_a c = ad*_{e_a} c + ∂c/∂ξ [e_a, ξ].
template <int D>
class GroupPoint {
 public:
  using Column = typename GroupSizes<D>::Column;
  using Square = typename GroupSizes<D>::Square;

  explicit GroupPoint(const Scene& scene);

  /// π = ∂L/∂ξ and F = ∂L/∂g + f.
  void evaluate(double t, ConstVectorRef q, const Column& xi);
  const Column& momentum() const { return momentum_; }
  const Column& force() const { return force_; }

  /// Their derivatives there, d×d: along the group, and by ξ.
  struct Derivatives {
    Square momentum_g, momentum_xi, force_g, force_xi;
    double curvature;  ///< largest entry of ∂²L/∂g² and ∂f/∂g
  };
  void derivatives(Derivatives& out) const;

 private:
  void add_turns(Derivatives& out) const;

  const Scene& scene_;
  const Space& space_;
  double t_ = 0.0;
  Vector q_, v_;
  Column xi_;
  Vector own_force_, lq_, lv_;  ///< components of a velocity
  mutable Vector qq_, qv_, vv_;
  Column momentum_, force_;
};

/// The rows of a scene at one configuration of its space; row r of all blocks is row r here.
template <int D>
class GroupRows {
 public:
  using Column = typename GroupSizes<D>::Column;
  using Square = typename GroupSizes<D>::Square;
  using Rows = typename GroupSizes<D>::Rows;

  explicit GroupRows(const Scene& scene);

  /// A, and b.
  void evaluate(double t, ConstVectorRef q);
  const Rows& forms() const { return a_; }  ///< m×d
  const Vector& offsets() const { return b_; }
  /// Aᵀ λ
  Column impulse(ConstVectorRef lambda) const { return a_.transpose() * lambda; }

  /// φ of holonomic rows, zero for others.
  void positions(double t, ConstVectorRef q, VectorRef phi) const;
  /// Derivative of A ξ + b along the group, ξ held fixed, m×d.
  void derivative(double t, ConstVectorRef q, const Column& xi, Rows& out) const;
  /// Derivative of Aᵀ λ along the group, d×d, after evaluate() there.
  void impulse_derivative(double t, ConstVectorRef q, ConstVectorRef lambda, Square& out) const;

  const std::vector<bool>& holonomic() const { return holonomic_; }

 private:
  const Scene& scene_;
  const Space& space_;
  std::vector<bool> holonomic_;  ///< by row
  Rows a_;
  Vector b_;
};

}  // namespace diracstep
