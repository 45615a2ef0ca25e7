#pragma once

#include <Eigen/LU>
#include <diracstep/core/nonlinear_solver.hpp>
#include <diracstep/core/saddle_point.hpp>
#include <diracstep/core/scene.hpp>
#include <functional>
#include <memory>
#include <string>

namespace diracstep {

/// How fast a motion changes at (t, q, v): ω > 0, in radians over the unit of time.  Steps are about eps/ω.
/// It must be even in v, ω(t,q,−v) = ω(t,q,v): else variable steps are not reversible.
struct Monitor {
  std::function<double(double t, ConstVectorRef q, ConstVectorRef v)> rate;  ///< empty: the generic monitor
  bool depends_on_velocity = true;  ///< false saves finding accelerations
};

/// Throws Misuse where the monitor is not positive and finite at the start, or not even in v there and at
/// another velocity: names both values.
void require_even(const Monitor& monitor, const Start& start);

/// Velocities and accelerations of a scene at given points.  Owns what it needs; allocates nothing once made.
class PointwiseMotion {
 public:
  /// Throws Misuse for a Lagrangian that is linear in v, which has no accelerations.
  PointwiseMotion(const Scene& scene, const SolverFactory& solvers, int dense_limit = 40);

  /// v ∈ Δ_Q(q) of the class of p, from a guess in v.
  SolveReport velocity(double t, ConstVectorRef q, ConstVectorRef p, Vector& v);

  /// The acceleration a of the continuous system at (q, v).  Linear; dense systems are solved directly.
  SolveReport acceleration(double t, ConstVectorRef q, ConstVectorRef v, VectorRef a);

  long accelerations() const { return accelerations_; }

 private:
  bool dense_;
  Eigen::Index n_;
  VelocityProblem velocity_problem_;
  AccelerationProblem acceleration_problem_;
  std::unique_ptr<NonlinearSolver> velocity_solver_, acceleration_solver_;
  Eigen::PartialPivLU<Eigen::MatrixXd> factors_;
  Columns matrix_;
  Vector velocity_unknowns_, unknowns_, right_hand_side_;
  long accelerations_ = 0;
};

/// ω and its change along the motion.
struct Pace {
  double rate = 0.0;         ///< ω
  double growth = 0.0;       ///< d(ln ω)/dt
  std::string failure = {};  ///< empty, or why there is none

  bool ok() const { return failure.empty(); }
};

/// Scales of the generic monitor.
struct MonitorScales {
  double typical = 0.0;  ///< ω0, about |a|/|v|
  double lowest = 0.0;   ///< ω_min, which bounds the steps where nothing changes
};

/// ω at points of a motion: a user's monitor, or the generic one
///
///   ω² = (ω0² |a|² + |ȧ|²) / (ω0² |v|² + |a|²) + ω_min²,
///
/// the relative rate of change of the field (v, a).  ȧ and d(ln ω)/dt are central differences over points of
/// the parabola q + τv + τ²a/2, v + τa; an odd function of τ stays odd under v → −v whatever its truncation
/// error, and that is all that reversibility needs.
class PaceMeter {
 public:
  PaceMeter(const Scene& scene, const SolverFactory& solvers, Monitor monitor, MonitorScales scales);

  /// ω alone; `step` sets the width of the differences.
  Pace rate(double t, ConstVectorRef q, ConstVectorRef v, double step);
  /// ω and d(ln ω)/dt.
  Pace rate_and_growth(double t, ConstVectorRef q, ConstVectorRef v, double step);

  PointwiseMotion& motion() { return *motion_; }
  bool generic() const { return !monitor_.rate; }
  const MonitorScales& scales() const { return scales_; }

 private:
  /// Accelerations at τ = −2δ … 2δ, all or the inner three.
  bool accelerations(double t, ConstVectorRef q, ConstVectorRef v, double delta, int reach);
  double generic_rate(int place, ConstVectorRef v, double delta) const;
  double own_rate(double t, ConstVectorRef q, ConstVectorRef v, double delta, int place);
  Pace failed() const;

  Monitor monitor_;
  MonitorScales scales_;
  std::unique_ptr<PointwiseMotion> motion_;
  SolveReport last_;
  Columns a_;  ///< accelerations, one column a place
  Vector q_, v_;
};

/// What a coarse run over the first part of a motion finds: Runge and Kutta's classical method on the
/// underlying ordinary differential equation, 0.3 radians a step, constraints left to drift.
struct PaceSurvey {
  MonitorScales scales;  ///< ω0: median over time of |a|/|v|; ω_min: 0.3 of the median of ω, 0.3 radians over
                         ///< the span where nothing changes at all
  double slowest = 0.0;  ///< smallest and largest ω met, ω_min left out
  double fastest = 0.0;
  double covered = 0.0;  ///< time surveyed
  long accelerations = 0;
  std::string failure = {};  ///< empty, or why the survey ended early

  /// max ω / min ω: above 5 variable steps pay.
  double ratio() const { return fastest / std::max(slowest, scales.lowest); }
};

/// Surveys from the start towards `end`, at most `most_steps` steps.
PaceSurvey survey_pace(const Scene& scene, const SolverFactory& solvers, double end, long most_steps);

}  // namespace diracstep
