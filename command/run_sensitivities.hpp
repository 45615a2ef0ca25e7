#pragma once

#include <diracstep/command/session.hpp>
#include <diracstep/sensitivities/sensitivities.hpp>
#include <memory>
#include <string>
#include <vector>

namespace diracstep::command {

/// Derivatives of a point of a motion by one number: a parameter "m", or one of the start, "x(0)", "v_x(0)"
/// or "p_x(0)".
struct SensitivityColumn {
  std::string by;
  Vector q, v, p;  ///< v is empty where L is linear in v
};

/// The derivatives that `run --sensitivities` asks for, along the motion of an integrator.
class RunSensitivities {
 public:
  /// `wanted` names parameters of the scene, and q0, v0 or p0 for the start; `name` and `changes` are what
  /// the scene was made from.  Throws Misuse for another word.  The integrator stands at its start.
  RunSensitivities(const std::vector<std::string>& wanted, const std::string& name, const Parameters& changes,
                   const CatalogueScene& entry, const Registry& registry, Integrator& integrator);
  RunSensitivities(const std::vector<std::string>& wanted, const ParametricScene& scene,
                   const Registry& registry, Integrator& integrator);

  /// Of the scene or of the steps: see ParametricScene::doubt, Sensitivities::doubt.
  const std::string& doubt() const { return doubt_.empty() ? sensitivities_.doubt() : doubt_; }

  /// After each step of the integrator.
  void follow_step();
  /// At the current point.
  const std::vector<SensitivityColumn>& read();
  /// "d(x)/d(m)" for each coordinate, and each velocity where it is differentiated: columns of a trajectory,
  /// of the current point whatever they are asked for.
  std::vector<Output> columns();

 private:
  std::string doubt_;
  Sensitivities sensitivities_;
  Directions directions_;
  std::vector<SensitivityColumn> columns_;
  bool known_ = false;  ///< columns_ are those of the current point
};

}  // namespace diracstep::command
