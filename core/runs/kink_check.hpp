#pragma once

#include <diracstep/core/integrator/integrator.hpp>
#include <diracstep/core/runs/kink_crossings.hpp>
#include <memory>
#include <string>

namespace diracstep {

/// Follows a run over the kinks and pulses that the scene's formulas show (Scene::kinks), to say when forces
/// that change there spoil it.  A step from t0 to t1 that crosses some is cut there, along a cubic between
/// its ends, and
///
///   Σ over its parts of the largest component of  (mean of |F − F between those of t0 and t1| − 2 |ΔF of the
///   step before|) · length, F = ∂L/∂q + f,
///
/// is what a step cannot know of its impulse: h J/4 to h J/2 of a jump by J, all of a pulse between two
/// nodes. A quarter of it, about what a step over a jump ends beside the motion whatever its order, is added
/// up, and doubted above 1/200 of the largest momentum; above 1/2000 where the time alone brings the change,
/// since nodes can be put there.
///
/// Of a pulse between two nodes it is all that is missed: what F leaves the range of F(t0) and F(t1) by, less
/// 4 |F(t1) − F(t0)|, counts whole.  Where a run was repeated with finer steps and ended alike, pulses alone
/// count: both runs may have stepped over them.
///
/// Steps that resolve what changes, and kinks at which forces stay continuous, as of a contact, count for
/// little or nothing.  Where a step could not resolve what lies between two kinks that it crosses, it is
/// doubted for what that leaves.  Not seen is what Kinks do not show.
class KinkCheck {
 public:
  /// For a run to about `end`: the instants of the time are looked up until then.
  /// The integrator's scene must outlive this.
  KinkCheck(const Integrator& integrator, double end);

  /// After each step.
  void after(const Integrator& integrator) {
    if (kinks_) look(integrator);
  }

  /// Empty, or a line that names the first kink that was crossed with a jump.  `confirmed` by a run of finer
  /// steps.
  std::string text(bool confirmed = false) const;

 private:
  void look(const Integrator& integrator);
  void read(const Integrator& integrator, PathPoint& point) const;
  bool may_cross();
  void force_at(double t, const Vector& q, const Vector& v, const Vector& p, Vector& force);
  /// What a step does not know of its impulse, and what of it is a pulse between its ends.
  struct Missed {
    double all = 0.0, pulses = 0.0;
  };
  Missed missed(const std::vector<KinkCrossing>& cuts, const PathCubic& path);

  const Scene& scene_;
  std::shared_ptr<const Kinks> kinks_;
  KinkCrossings crossings_;
  PathPoint from_, to_;
  Vector switches_, switches_before_, changes_;  ///< of each switching function, and in the step before
  Vector force_, force_before_, change_, between_, beside_, beyond_, momentum_, own_, q_, v_, p_;
  Missed sum_, sum_of_instants_;
  double largest_momentum_ = 0.0, first_time_ = 0.0;
  long jumps_ = 0;
  double unresolved_ = 0.0, unresolved_time_ = 0.0;  ///< between kinks, the largest of a step
  int first_ = -1;
};

}  // namespace diracstep
