#pragma once

#include <diracstep/core/spaces/space.hpp>
#include <diracstep/core/system/scene.hpp>

namespace diracstep {

/// L, force and rows of a scene at one configuration of its space, as columns of the Lie algebra ("group
/// columns" of space.hpp; d = Space::group_dimension()).
///
/// Where a factor is a sphere, the functions are those of its two velocities, and what they are along the
/// turn e_a that nothing sees follows from ℓ(g r, Ad_r⁻¹ ξ) = ℓ(g, ξ): with L alone ⟨∂L/∂g, e_a⟩ =
/// ⟨∂L/∂ξ, [e_a, ξ]⟩, and any covector c of the scene has e_a c = ad*_{e_a} c + ∂c/∂ξ [e_a, ξ].
class GroupPoint {
 public:
  explicit GroupPoint(const Scene& scene);

  /// π = ∂L/∂ξ and F = ∂L/∂g + f.
  void evaluate(double t, ConstVectorRef q, ConstVectorRef xi);
  const Vector& momentum() const { return momentum_; }
  const Vector& force() const { return force_; }

  /// Their derivatives there, d×d: along the group, and by ξ.
  struct Derivatives {
    Columns momentum_g, momentum_xi, force_g, force_xi;
    double curvature;  ///< largest entry of ∂²L/∂g²
  };
  void derivatives(Derivatives& out) const;

 private:
  const Scene& scene_;
  const Space& space_;
  double t_ = 0.0;
  Vector q_, xi_, v_;
  Vector own_force_, lq_, lv_;  ///< components of a velocity
  Vector momentum_, force_;
};

/// The rows of a scene at one configuration of its space; row r of all blocks is row r here.
class GroupRows {
 public:
  explicit GroupRows(const Scene& scene);

  /// A, and b.
  void evaluate(double t, ConstVectorRef q);
  const Columns& forms() const { return a_; }  ///< m×d
  const Vector& offsets() const { return b_; }
  /// Aᵀ λ
  Vector impulse(ConstVectorRef lambda) const { return a_.transpose() * lambda; }

  /// φ of holonomic rows, zero for others.
  void positions(double t, ConstVectorRef q, VectorRef phi) const;
  /// Derivative of A ξ + b along the group, ξ held fixed, m×d.
  void derivative(double t, ConstVectorRef q, ConstVectorRef xi, ColumnsRef out) const;
  /// Derivative of Aᵀ λ along the group, d×d, after evaluate() there.
  void impulse_derivative(double t, ConstVectorRef q, ConstVectorRef lambda, ColumnsRef out) const;

  const std::vector<bool>& holonomic() const { return holonomic_; }

 private:
  const Scene& scene_;
  const Space& space_;
  std::vector<bool> holonomic_;  ///< by row
  Columns a_;
  Vector b_;
};

}  // namespace diracstep
