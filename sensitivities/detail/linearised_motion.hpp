#pragma once

#include <diracstep/core/integrator/integrator.hpp>
#include <diracstep/core/methods/registry.hpp>
#include <diracstep/sensitivities/detail/stage_equations.hpp>
#include <diracstep/sensitivities/parametric_scene.hpp>
#include <diracstep/sensitivities/sensitivities.hpp>
#include <memory>
#include <span>
#include <vector>

namespace diracstep::sensitivity {

/// The derivatives of the solved stages and of the points of one integrator, in full or sparse matrices.
class LinearisedMotion {
 public:
  LinearisedMotion() = default;
  LinearisedMotion(const LinearisedMotion&) = delete;
  LinearisedMotion& operator=(const LinearisedMotion&) = delete;
  virtual ~LinearisedMotion() = default;

  virtual void push(std::span<const SolvedStage> step, Directions& z) = 0;
  virtual void pull(std::span<const SolvedStage> step, Directions& z) = 0;

  /// A point as it is read: the momentum is that of the class.
  struct Point {
    double t;
    const Vector &q, &p, &v;
  };
  virtual ReadDirections push_reading(const Point& at, const Directions& z) = 0;
  virtual Directions pull_reading(const Point& at, const ReadDirections& read) = 0;

  /// (q0, v0, θ) to (q0, θ, p0) by p0 = ∂L/∂v, and back; no columns of dv count as zeros.
  virtual Directions push_start(const Point& at, ConstColumnsRef dq, ConstColumnsRef dv,
                                ConstColumnsRef dtheta) = 0;
  struct StartCotangents {
    Columns q, v, parameters;
  };
  virtual StartCotangents pull_start(const Point& at, const Directions& z) = 0;
};

/// The equations of each part of a step, in the order of StepDesign::parts; `extended` is the scene as the
/// integrator has prepared it, with parameters or without.
template <class Matrix>
std::vector<std::unique_ptr<StageEquations<Matrix>>> stage_equations(
    const Integrator& integrator, const Registry& registry, const std::shared_ptr<ExtendedScene>& extended,
    bool full);

/// Throws Misuse where the scene of the integrator has no Lagrangian to differentiate.
void require_lagrangian(const Integrator& integrator);

/// Of the scene as the integrator has prepared it.
std::unique_ptr<LinearisedMotion> linearised_motion(const Integrator& integrator, const Registry& registry,
                                                    const ParametricScene& scene);

}  // namespace diracstep::sensitivity
