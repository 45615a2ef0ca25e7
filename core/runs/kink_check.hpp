#pragma once

#include <diracstep/core/integrator/integrator.hpp>
#include <diracstep/core/system/kinks.hpp>
#include <memory>
#include <string>

namespace diracstep {

/// Follows a run of fixed steps over the kinks that the scene's formulas show (Scene::kinks), to say when
/// forces that jump there spoil it: a step over a jump of size J in ∂L/∂q + f ends about h J/10 beside the
/// momentum of the motion, whatever its order.  Doubted where these add up to more than a hundredth of the
/// largest momentum.
///
/// J is how much more the force changes in such a step than twice what it did in the one before.  Kinks at
/// which forces stay continuous, as of a contact, count for nothing.
class KinkCheck {
 public:
  /// The integrator's scene must outlive this.
  explicit KinkCheck(const Integrator& integrator);

  /// After each step.
  void after(const Integrator& integrator) {
    if (kinks_) look(integrator);
  }

  /// Empty, or a line that names the first kink that was crossed with a jump.
  std::string text() const;

 private:
  void look(const Integrator& integrator);
  void read(const Integrator& integrator);
  /// The number of a kink that changes its sign, or -1.
  int crossed() const;

  const Scene& scene_;
  std::shared_ptr<const Kinks> kinks_;
  Vector switches_, switches_before_, force_, force_before_, momentum_, own_;
  double change_ = 0.0, sum_ = 0.0, largest_momentum_ = 0.0, first_time_ = 0.0;
  long jumps_ = 0;
  int first_ = -1;
};

}  // namespace diracstep
