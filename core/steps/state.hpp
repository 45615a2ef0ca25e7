#pragma once

#include <diracstep/core/numerics/types.hpp>
#include <utility>

namespace diracstep {

/// What rounding has dropped from q and p at a point; empty where sums are not compensated.
struct Remainder {
  ExtendedVector q, p;

  void swap(Remainder& other) noexcept {
    q.swap(other.q);
    p.swap(other.p);
  }
};

/// A point of a motion, all that the step which starts there depends on but its interval and StepMemory.
///
/// q is stored in Scene::storage_size() numbers; p, v and all else of a step have as many as the tangent
/// space has dimensions, Scene::dimension().  In R^n both are n.
struct State {
  Vector q;  ///< configuration
  Vector p;  ///< a momentum of the class [p] ∈ T*Q/Δ°_Q
  Vector v;  ///< an estimate of the velocity; a guess only
  Remainder rest = {};

  /// By pointers; what std::swap does takes three times as long, which shows in a step of few unknowns.
  void swap(State& other) noexcept {
    q.swap(other.q);
    p.swap(other.p);
    v.swap(other.v);
    rest.swap(other.rest);
  }
};

/// What a step leaves to the next one beside the point: the sizes that round-off in its equations is judged
/// by.  Unknown before the first step.
struct StepMemory {
  bool known = false;
  Vector scales;       ///< sizes of terms, which ones is for the step to say
  Vector multipliers;  ///< the unknown multipliers of the step

  void swap(StepMemory& other) noexcept {
    std::swap(known, other.known);
    scales.swap(other.scales);
    multipliers.swap(other.multipliers);
  }
};

/// Where a step ends.  A value: nothing of it counts before it is accepted.
struct StepEnd {
  /// (q1, p1), and as v the mean velocity of the step, (q1 − q0)/h in R^n; where the last stage is the end
  /// and forces determine velocities, that of the stage.
  State at;
  Vector impulse;  ///< λ (momentum over the unit of a row) that entered at q0 as A(q0)ᵀλ
  StepMemory memory;
};

}  // namespace diracstep
