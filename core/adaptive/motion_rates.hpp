#pragma once

#include <diracstep/core/integrator/sample.hpp>
#include <diracstep/core/numerics/nonlinear_solver.hpp>
#include <diracstep/core/system/scene.hpp>
#include <memory>

namespace diracstep {

class PointwiseLinearisation;
class MasslessMotion;

/// Whether rows that are no positions, and not constant, are on coordinates that L does not hold: the states
/// of a controller or a filter, whose rates may damp without any force.
bool has_states(const Scene& scene);

/// How fast a motion linearised about its points decays and oscillates, as survey_damping() says.
class MotionRates {
 public:
  /// All eigenvalues up to there, beyond it the largest of a motion without mass.
  static constexpr int most_coordinates = 60;

  struct Rates {
    double decay = 0.0;     ///< the largest −Re λ
    double undamped = 0.0;  ///< the largest |Im λ| with |Re λ| below a hundredth of it
  };

  /// The scene, completed and with its hidden rows, outlives this.
  MotionRates(const Scene& scene, const SolverFactory& solvers);
  ~MotionRates();

  /// NaN where there is no acceleration or velocity, 0 before anything has moved.
  Rates at(const Sample& point);

 private:
  std::unique_ptr<PointwiseLinearisation> with_mass_;
  std::unique_ptr<MasslessMotion> massless_;
};

}  // namespace diracstep
