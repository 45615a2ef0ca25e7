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
/// halve towards both ends of the part and the middle of each pulse.  Doubted where the sum of what is missed
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
    if (watched_) look(integrator);
  }

  /// Empty, or a line that names the time near which most is missed.
  std::string text() const;

 private:
  struct Instants;  ///< of a step
  void look(const Integrator& integrator);
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
  Vector force_, other_, fine_, coarse_;
};

}  // namespace diracstep
