#pragma once

#include <diracstep/core/integrator/integrator.hpp>
#include <diracstep/core/numerics/path_cubic.hpp>
#include <memory>
#include <string>
#include <vector>

namespace diracstep {

/// Looks at the steps in which forces switch or pulse in time, as the formulas of the scene show (Kinks):
/// compares the impulse  ∫ (∂L/∂q + f) dt  of each part between two switches, with q and v of the step's end,
/// by the Gauss rule of the method's order, which is what a step takes of it, with that by panels which
/// halve towards both ends of the part and the middle of each pulse; and the steps that follow, as long as
/// they miss more than 1e-4 of the largest momentum.  Doubted where the sum of what is missed
/// comes to the part of the largest momentum that StepComparison::largest_error() allows a run.
///
/// Coordinates whose momentum stays zero are left out: a force without inertia has no impulse.  Of very many
/// such parts, the first 1000 are looked at.
class ImpulseCheck {
 public:
  /// The scene of the integrator must outlive this.
  explicit ImpulseCheck(const Integrator& integrator);

  /// After each step.
  void after(const Integrator& integrator) {
    if (watched_)
      look(integrator.time(), integrator.position(), integrator.velocity_estimate(), integrator.momentum());
  }
  /// A point of the run behind the last step, which a step beside it led to.
  void see(const Sample& point) {
    if (watched_ && point.time != time_) look_beside(point);
  }

  /// Empty, or a line that names the time near which most is missed.
  std::string text() const;

 private:
  struct Instants;  ///< of a step
  void look(double time, ConstVectorRef q, ConstVectorRef v, ConstVectorRef p);
  void look_beside(const Sample& point);
  void look_at_part(double a, double b, const std::vector<double>& pulses);
  void add(double weight, double t, Vector& sum);

  const Scene& scene_;
  int order_;
  bool watched_;
  std::shared_ptr<Instants> instants_;
  std::vector<GaussPoint> rule_;
  double time_;
  Vector q_, v_, p_;
  Vector largest_;                        ///< momenta
  Vector missed_, most_missed_;           ///< impulses, and the largest sizes of their sums
  double largest_part_ = 0.0, at_ = 0.0;  ///< of one part, and where
  long looked_at_ = 0;
  bool follows_ = false;  ///< the next step
  Vector force_, other_, fine_, coarse_;
};

}  // namespace diracstep
