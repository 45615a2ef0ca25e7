#pragma once

#include <diracstep/core/numerics/types.hpp>
#include <diracstep/core/system/motion_point.hpp>

namespace diracstep {

/// Which representative of the momentum class [p] ∈ T*Q/Δ°_Q is reported.
enum class Momentum {
  plus,      ///< before the impulse of the next step, p⁺_k: the (+) systems
  minus,     ///< after it, p⁻_k = p⁺_k + A(q_k)ᵀλ_k: the (−) systems
  projected  ///< ∂L/∂v(q_k, v_k) with v_k ∈ Δ_Q(q_k)
};

/// Everything that can be read at one point of a trajectory.
struct Sample {
  double time = 0.0;
  Vector q;       ///< configuration, Scene::storage_size() numbers
  Vector v;       ///< velocity in Δ_Q(q), Scene::dimension() numbers, like p
  Vector p;       ///< momentum, in the representative asked for
  Vector lambda;  ///< forces Λ of the rows at (q, v): Aᵀ Λ is a generalised force, so Λ is power over the
                  ///< unit of a row A v: a force for a row in m/s, a voltage for one in A
  Vector impulse;  ///< with Momentum::minus the impulses λ that the next step lets in at q, units of Λ times
                   ///< time; empty with the others
  double energy = 0.0;

  /// What functions of the user's own read; the sample outlives it.
  MotionPoint point() const { return {time, q, v, p, lambda}; }
};

}  // namespace diracstep
