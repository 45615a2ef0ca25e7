#pragma once

#include <diracstep/core/integrator/integrator.hpp>
#include <memory>
#include <string>
#include <vector>

/// Measurements that hold a method to what is stated of it: orders, reversibility, symplecticity, and
/// membership in the discrete Dirac structures.  They run on the scenes of law_scenes.hpp and need nothing
/// but a registry.
namespace diracstep {

/// A scene of one constraint class on which orders are measured, and the finest solution known on it.
struct OrderScene {
  std::string constraint_class;
  std::shared_ptr<const Scene> scene;
  double t_end = 0.0;
  Sample reference;
};

/// The scene of `validation/laws/law_scenes.hpp` for degenerate circuits, in the same way.
OrderScene degenerate_order_scene();

/// The leading errors of order 10 are below round-off where they begin to dominate.
constexpr int highest_visible_order = 8;

/// One scene of each class: unconstrained, holonomic, nonholonomic, mixed, affine and time-dependent, forced,
/// and a phase-space Lagrangian.
std::vector<OrderScene> order_scenes();

/// An order found by halving the step until the errors are asymptotic.
struct OrderMeasurement {
  double order = 0.0;  ///< NaN where it could not be measured
  double error = 0.0;  ///< at the finer step of the last pair
  double step = 0.0;
  std::string failure;        ///< empty, or why there is no order
  bool in_round_off = false;  ///< no order, since too few steps have errors above round-off
};

/// Whether a method is for a scene: type 4 takes no forces, and phase-space Lagrangians are for the
/// Gauss-Lobatto family.
bool takes(const Method& method, const OrderScene& scene);

/// The order that a method states for a scene: its constrained order where that has rows or a force and one
/// is stated.
int claimed_order(const MethodInfo& method, const Scene& scene);

/// Order of q, of the momentum representative and of the forces Λ of the rows in the maximum norm at the end:
/// the slope of log(error) over log(h) through the four finest of a ladder of steps, four to an octave, that
/// lie above round-off: above 1e-12 and 1e-13 times the square root of the solves (it grows like a random
/// walk), and, where the slope falls below half the claimed order before, above 30 times the error there.
OrderMeasurement measure_order(const Registry& registry, const OrderScene& scene, IntegratorOptions options,
                               Momentum momentum = Momentum::projected);

/// |Φ_{−h}(Φ_h(y)) − y| in q and projected p, with the method's own step both ways: round-off for a
/// self-adjoint method.
double reversal_defect(const Registry& registry, const std::shared_ptr<const Scene>& scene,
                       const IntegratorOptions& options);

/// Largest entry of MᵀΩM − Ω for the Jacobian M of one step on an unconstrained scene, by central differences
/// of sixth order: about 1e-11 for a symplectic step.
double symplecticity_defect(const Registry& registry, const std::shared_ptr<const Scene>& scene,
                            const IntegratorOptions& options);

/// Largest residual of membership in D_{d+} and D_{d−} over `steps` steps, of a method with rows inside the
/// step in the Dirac structure of its stage space (stage_membership.hpp); NaN for a method for which none is
/// stated.
double membership_residual(const Registry& registry, const std::shared_ptr<const Scene>& scene,
                           const IntegratorOptions& options, long steps);

}  // namespace diracstep
