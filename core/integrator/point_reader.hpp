#pragma once

#include <diracstep/core/integrator/sample.hpp>
#include <diracstep/core/steps/state.hpp>
#include <diracstep/core/system/first_order_motions.hpp>
#include <diracstep/core/system/hamiltonian_point.hpp>
#include <diracstep/core/system/saddle_point.hpp>
#include <diracstep/core/system/scene.hpp>
#include <memory>

namespace diracstep {

/// Velocities, accelerations and forces of the rows at points of a motion.  Owns the two systems that they
/// solve, and their solvers: what is read leaves no trace, neither in the steps nor in later readings.
///
/// A scene given by a Hamiltonian alone is read by it (hamiltonian_point.hpp), motions of first order with
/// rows, with forces or beside others by their own equations (first_order_motions.hpp).
class PointReader {
 public:
  /// Full matrices, or sparse ones.
  PointReader(std::shared_ptr<const Scene> scene, SolverFactory solvers, bool full);
  /// Whether its systems, and those of the steps, are solved by full matrices.
  bool full_matrices() const { return full_; }
  ~PointReader();

  /// v ∈ Δ_Q(q) of the class of p, from a guess in v.  For a phase-space Lagrangian, whose p is a function of
  /// q, the one velocity at q.
  SolveReport velocity(double t, ConstVectorRef q, ConstVectorRef p, Vector& v);
  /// Whether forces determine what momenta leave open of it: FirstOrderMotions::by_force.
  bool velocity_by_forces() const;

  /// a = dv/dt and the forces Λ of the rows at (q, v), by the Lagrangian.  For a phase-space Lagrangian,
  /// which has neither, both are left empty.
  SolveReport acceleration(double t, ConstVectorRef q, ConstVectorRef v, Vector& a, Vector& lambda);
  /// The same at (q, v, p) with p of a projected sample, by the Hamiltonian where the scene is given by it
  /// alone.
  SolveReport acceleration(double t, ConstVectorRef q, ConstVectorRef v, ConstVectorRef p, Vector& a,
                           Vector& lambda);

  /// a alone, by one elimination without the solver: quicker for few unknowns, and with another round-off.
  /// For readers with full matrices only, and not for phase-space Lagrangians.
  SolveReport acceleration_by_elimination(double t, ConstVectorRef q, ConstVectorRef v, VectorRef a);

  /// Sets the velocities of a start that are no data of a motion: those of motions of first order with rows,
  /// with forces or beside others.  Throws Misuse where they are not found.
  void determine(Start& start);

  /// All of a sample but its impulse: p is the one given, or the one projected.
  SolveReport read(double t, const State& at, Momentum momentum, Sample& sample);

 private:
  struct Elimination;
  bool constant_diagonal_mass(double t, ConstVectorRef q);
  bool keep_velocity(double t, const State& at);
  SolveReport velocity_of_first_order(double t, ConstVectorRef q, ConstVectorRef p, Vector& v);
  SolveReport velocity_by_hamiltonian(double t, ConstVectorRef q, ConstVectorRef p, Vector& v);
  SolveReport solve_acceleration(NonlinearProblem& problem, std::unique_ptr<NonlinearSolver>& solver,
                                 Vector& a, Vector& lambda);
  AccelerationProblem& acceleration_problem();

  std::shared_ptr<const Scene> scene_;
  SolverFactory solvers_;
  bool full_;
  std::unique_ptr<VelocityProblem> velocity_;  ///< one of the four
  std::unique_ptr<PhaseSpaceVelocityProblem> phase_space_velocity_;
  std::unique_ptr<MomentumVelocityProblem> first_order_velocity_;
  std::unique_ptr<HamiltonianVelocityProblem> hamiltonian_velocity_;
  std::unique_ptr<HamiltonianAccelerationProblem>
      hamiltonian_acceleration_;                       ///< made when it is needed first
  std::unique_ptr<AccelerationProblem> acceleration_;  ///< made when it is needed first
  std::unique_ptr<NonlinearSolver> velocity_solver_, acceleration_solver_, hamiltonian_acceleration_solver_;
  std::unique_ptr<Elimination> elimination_;
  Vector unknowns_, a_, lq_;
  Vector projected_;  ///< the momentum of the velocity last read by the Hamiltonian
  bool mass_examined_ = false;
  Vector mass_;  ///< ∂²L/∂v² where it is constant, diagonal and regular and there are no rows; else empty
};

}  // namespace diracstep
