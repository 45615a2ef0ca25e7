#pragma once

#include <diracstep/core/numerics/nonlinear_solver.hpp>
#include <diracstep/core/system/scene.hpp>
#include <functional>
#include <limits>
#include <memory>
#include <string>

namespace diracstep {

/// How fast a motion changes at (t, q, v): ω > 0, in radians over the unit of time.  Steps are about eps/ω.
/// It must be even in v, ω(t,q,−v) = ω(t,q,v): else variable steps are not reversible.
struct Monitor {
  std::function<double(double t, ConstVectorRef q, ConstVectorRef v)> rate;  ///< empty: the generic monitor
  bool depends_on_velocity = true;  ///< false saves finding accelerations
};

/// Whether a completed scene has accelerations to choose variable steps by: not where its Lagrangian is
/// linear in v or has motions of first order, nor where its Hamiltonian is degenerate.
bool has_accelerations(const Scene& scene);
/// Of a scene that has none, what it is that has none: "its Lagrangian is linear in v".
std::string why_no_accelerations(const Scene& scene);

/// Throws Misuse where the monitor is not positive and finite at the start, or not even in v there and at
/// another velocity: names both values.
void require_even(const Monitor& monitor, const Start& start);

class PointwiseMotion;
class RampRates;

/// ω and its change along the motion.
struct Rate {
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
///   ω² = (ω0² |a|² + |ȧ|²) / (ω0² |v|² + |a|²) + ω_min² + Ω²,
///
/// the relative rate of change of the field (v, a), and Ω that at which the motion comes to ramps and pulses
/// of the formulas (RampRates): from before one nothing else tells of it.  On groups and spheres Ω² holds
/// (0.4 times the rate at which v turns, in parts of what the retraction is injective on)² as well.  ȧ and
/// d(ln ω)/dt are central differences over points of the Taylor polynomial q + τv + τ²a/2 + τ³ȧ/6, v + τa +
/// τ²ȧ/2; an odd function of τ stays odd under v → −v whatever its truncation error, and that is all that
/// reversibility needs.
class RateMeter {
 public:
  /// Of a step: so far ahead of a kink that was just crossed no difference reaches back across it.
  static constexpr double beside_kink = 4e-3;

  /// Pulses of the time are those between the start and `end`; without, there are none.
  RateMeter(const Scene& scene, const SolverFactory& solvers, Monitor monitor, MonitorScales scales,
            double end = std::numeric_limits<double>::quiet_NaN());
  RateMeter(RateMeter&&) noexcept;
  ~RateMeter();

  /// ω alone; `step` sets the width of the differences.
  Rate rate(double t, ConstVectorRef q, ConstVectorRef v, double step);
  /// Of the generic monitor: raises ω0 for a part of a motion, from the point where ω was taken last on.
  void fit_typical(ConstVectorRef v, double step);
  void set_typical(double typical) { typical_ = typical; }
  double typical() const { return typical_; }
  /// ω and d(ln ω)/dt.
  Rate rate_and_growth(double t, ConstVectorRef q, ConstVectorRef v, double step);

  PointwiseMotion& motion() { return *motion_; }
  bool generic() const { return !monitor_.rate; }
  const MonitorScales& scales() const { return scales_; }

 private:
  /// Accelerations at τ = −2δ … 2δ, all or the inner three.
  bool accelerations(double t, ConstVectorRef q, ConstVectorRef v, double delta, int reach);
  double generic_rate(int place, double t, ConstVectorRef v, double delta);
  void read_ramps(int place, double t, ConstVectorRef q, ConstVectorRef v);
  double own_rate(double t, ConstVectorRef q, ConstVectorRef v, double delta, int place);
  Rate failed() const;
  const double* base(ConstVectorRef q) const;
  void place_on_space(ConstVectorRef q);

  Monitor monitor_;
  MonitorScales scales_;
  double typical_;  ///< ω0 of this part of the motion
  std::unique_ptr<PointwiseMotion> motion_;
  SolveReport last_;
  Columns a_;  ///< accelerations, one column a place
  std::unique_ptr<RampRates> ramps_;
  Columns g_;  ///< their switching functions, likewise
  Vector q_, v_;
  Vector origin_;  ///< zero
  Vector turn_;    ///< a velocity as a group column
};

}  // namespace diracstep
