#pragma once

#include <diracstep/core/integrator/integrator.hpp>
#include <functional>
#include <memory>
#include <vector>

namespace diracstep {

/// Steps that end where the motion crosses a kink of the scene's formulas (Scene::kinks), so that a method
/// keeps its order over them: contacts, clipped forces, dry friction on the way.
///
/// A step at whose end a switching function has another sign than at its start is taken again, shorter, until
/// it ends a round-off of the time behind the zero, by a bracketed secant method on its size; then the rest
/// is taken.  Pairs of zeros within a step show in no sign at its end and are not seen.
class KinkSteps {
 public:
  /// The integrator must outlive this.
  explicit KinkSteps(Integrator& integrator);

  /// A step of size h in as many parts as it needs; `at_part` is called after each but the last, and ends the
  /// step with false.  Fails where a part does, and where the motion crosses one kink again and again, as at
  /// a force that jumps and points back from both sides.
  StepReport step(double h, const std::function<bool()>& at_part);

 private:
  void read(Vector& switches);
  int first_change() const;
  int ahead() const;
  StepReport shorten(int number, double& size);
  StepReport stuck(int number) const;

  Integrator& integrator_;
  std::shared_ptr<const Kinks> kinks_;  ///< null where no motion crosses any
  Sample here_;
  Vector before_, after_;
  Vector changes_;  ///< in the last part
};

}  // namespace diracstep
