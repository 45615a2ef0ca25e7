#pragma once

#include <diracstep/core/integrator/integrator.hpp>
#include <diracstep/core/methods/registry.hpp>
#include <diracstep/sensitivities/parametric_scene.hpp>
#include <functional>
#include <memory>

namespace diracstep {

/// Directions z at a point of a motion, one in each column, by z = (q, θ, p): n coordinates, P parameters, n
/// momenta of the class that the integrator carries.  Cotangents have the same shape.
using Directions = Columns;

/// Directions, or cotangents, of what is read at a point (Momentum::projected), n×k each.  `v` has no rows
/// where L is linear in v: its velocity is a function of q that takes third derivatives of L.
struct ReadDirections {
  Columns q, v, p;
};

/// Derivatives of a function of a motion by its start: with v0 held for q0 and θ, or with p0 held.  Where the
/// start depends on θ, `parameters` has that part as well.  A column for each function.
struct StartGradient {
  Columns q0, v0, parameters;
  Columns q0_at_p0, p0, parameters_at_p0;  ///< the latter without the dependence of the start
};

/// The derivatives of a motion by its start and by parameters, exact to the solve of each step: with a step
/// F(x; z0) = 0, z1 = G(x; z0), and F_x factored at its solution,
///
///   forward   F_x dx = −F_z dz0,      dz1 = G_x dx + G_z dz0
///   adjoint   F_xᵀ w = G_xᵀ z̄1,      z̄0 = G_zᵀ z̄1 − F_zᵀ w
///
/// for every step that the library has: GL(s), also of phase-space Lagrangians, Radau IIA, the steps of
/// generating functions, and their compositions, with rows, forces, degenerate Lagrangians and parts between
/// kinks.  They are the derivatives of the discrete motion, of the order of the method to those of the true
/// one.  The adjoint of a symplectic step is that step of the adjoint system (Sanz-Serna, SIAM Review 58,
/// 2016, arXiv 1503.04021).  The motion has the same bits with and without.
///
/// A start moved off the rows is no start of a motion: directions dq0 with A dq0 ≠ 0 mean the formulas of the
/// step there.  Not differentiated: when a kink or an event is met, which changes nothing unless the force
/// jumps there (doubt()), and steps that vary.  Throws Misuse for discrete rows of one's own, which state no
/// derivative by q0.
class Sensitivities {
 public:
  /// Of the motion from the current point of the integrator on, which outlives this and is stepped by it.
  /// `scene.scene` is the scene that the integrator was made from.
  Sensitivities(Integrator& integrator, const Registry& registry, const ParametricScene& scene);
  Sensitivities(Integrator& integrator, const Registry& registry);  ///< without parameters
  ~Sensitivities();
  Sensitivities(Sensitivities&&) noexcept;

  const Scene& scene() const;  ///< as it is stepped
  int coordinates() const;
  int parameters() const;
  /// Empty, or what the derivatives of the steps so far lack: a jump of the force was crossed.
  const std::string& doubt() const;

  /// Directions at the start: dq0, dv0 and dθ, n×k and P×k; dp0 = ∂(∂L/∂v).  Those of θ do not move the
  /// start.
  Directions from_velocities(ConstColumnsRef dq, ConstColumnsRef dv, ConstColumnsRef dtheta) const;
  /// By all of q0, by all of v0, by all of p0, at fixed others; by θ, which moves the start as the scene
  /// says.
  Directions by_position() const;
  Directions by_velocity() const;
  Directions by_momentum() const;
  Directions by_parameters() const;

  /// One step of the integrator, and of the directions with it.  Where it fails they stay.  Throws Error
  /// where F_x is singular.
  StepReport step(Directions& z);
  /// The same for a step that the integrator has taken last, of any size.
  void follow(Directions& z);

  /// What directions at the current point are in the velocity and the projected momentum there.
  ReadDirections read(const Directions& z);

  /// Asked before each step of jvp() and gradient(), there and back: false ends them, with a report that is
  /// not ok.  The integrator then stands where it has come to.
  void ask_before_each_step(std::function<bool()> go_on);

  /// jvp: `steps` steps of directions; the integrator is at the end.  vjp is its transpose.
  StepReport jvp(long steps, Directions& z);

  /// The cotangent of a function at point k of a motion, k = 0 at the start; empty columns are zeros.
  using Cotangent = std::function<ReadDirections(long k, const Sample&)>;
  /// How the way back finds the motion: every `every`-th point is kept by a snapshot and the steps from there
  /// are taken again, with the same bits.  0: chosen so that what is kept stays below 256 MB.
  struct Storage {
    long every = 0;
  };
  struct Gradient {
    StepReport report;  ///< where it is not ok there is no gradient
    StartGradient by_start;
  };
  /// vjp: the derivatives of a function of the end, or of a sum of functions at every `each`-th point and the
  /// end.  The integrator is at the end.  For each step one factorisation, and one more step where the motion
  /// is taken again.
  Gradient gradient(long steps, const Cotangent& cotangent, long each = 0, Storage storage = {0});

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace diracstep
