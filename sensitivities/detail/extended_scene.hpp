#pragma once

#include <diracstep/core/system/scene.hpp>
#include <diracstep/sensitivities/detail/matrices.hpp>

namespace diracstep::sensitivity {

/// The derivatives of the functions of a scene at points X = (q, θ), v_θ = 0: by all N = n + P numbers of X,
/// of the first n components.
class ExtendedScene {
 public:
  /// `scene` has `n` coordinates of its own, the others are parameters.
  ExtendedScene(std::shared_ptr<const Scene> scene, int n, Vector parameters);

  int n() const { return n_; }
  int size() const { return n_ + static_cast<int>(parameters_.size()); }
  const Scene& scene() const { return *scene_; }
  int rows() const { return scene_->rows(); }
  void set_parameters(ConstVectorRef values);

  /// (q, θ), and (v, 0).
  const Vector& point(ConstVectorRef q);
  const Vector& velocity(ConstVectorRef v);

  /// Of L, and of the force with ∂L/∂q where asked for: ∂(L_q + f)/∂X and ∂L_v/∂X (n×N), ∂(L_q + f)/∂v and
  /// L_vv (n×n).
  template <class Matrix>
  struct LagrangianAt {
    Matrix q_by_point, v_by_point, q_by_velocity, v_by_velocity;
  };
  template <class Matrix>
  void take(double t, ConstVectorRef q, ConstVectorRef v, bool with_force, LagrangianAt<Matrix>& at);

  /// ∂f/∂X (n×N) and ∂f/∂v (n×n); there is a force.
  template <class Matrix>
  struct ForceAt {
    Matrix by_point, by_velocity;
  };
  template <class Matrix>
  ForceAt<Matrix> force(double t, ConstVectorRef q, ConstVectorRef v);

  /// Of a block of rows: A, by X where they are holonomic (m×N), else with columns of zeros for θ;
  /// ∂(A w + s b)/∂X (m×N); ∂(Aᵀλ)/∂X (n×N).
  template <class Matrix>
  Matrix coefficients(const ConstraintRows& rows, double t, ConstVectorRef q);
  template <class Matrix>
  Matrix derivative(const ConstraintRows& rows, double t, ConstVectorRef q, ConstVectorRef w, double s);
  template <class Matrix>
  Matrix annihilator_derivative(const ConstraintRows& rows, double t, ConstVectorRef q,
                                ConstVectorRef lambda);

  /// The same of all rows, one block below the other; A by the scene's own coordinates (m×n).
  template <class Matrix>
  Matrix all_coefficients(double t, ConstVectorRef q);
  template <class Matrix>
  Matrix all_derivatives(double t, ConstVectorRef q, ConstVectorRef w, double s);
  template <class Matrix>
  Matrix all_annihilator_derivatives(double t, ConstVectorRef q, ConstVectorRef lambda);

 private:
  std::shared_ptr<const Scene> scene_;
  int n_;
  Vector parameters_, point_, velocity_, values_, offsets_, qq_, qv_, vv_;
};

}  // namespace diracstep::sensitivity
