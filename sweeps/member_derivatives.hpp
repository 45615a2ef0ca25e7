#pragma once

#include <diracstep/core/integrator/integrator.hpp>
#include <diracstep/sensitivities/sensitivities.hpp>
#include <diracstep/sweeps/sweep.hpp>
#include <string>
#include <vector>

namespace diracstep {

/// Sweep::derivatives for one scene: what is differentiated, and by which parameter.
class DerivativeNames {
 public:
  /// Throws Misuse for a text that is not "d(x)/d(m)" or "d(v_x)/d(m)" of a coordinate x and a parameter m of
  /// the scene, and for a sweep whose members have no derivatives: with 'error', 'project', starts that the
  /// sweep gives, events.
  DerivativeNames(const Sweep& sweep, const CatalogueScene& entry);

  struct Of {
    bool velocity;
    Eigen::Index coordinate, parameter;
  };
  const std::vector<Of>& all() const { return all_; }
  /// Each once, in the order of their first place.
  const std::vector<std::string>& parameters() const { return parameters_; }

 private:
  std::vector<Of> all_;
  std::vector<std::string> parameters_;
};

/// The derivatives of one member along its steps, exact for the discrete motion (sensitivities.hpp).
class MemberDerivatives {
 public:
  /// `changes` are the parameters that the member's scene was made with.  The integrator stands at its start.
  MemberDerivatives(const Sweep& sweep, const CatalogueScene& entry, const Parameters& changes,
                    const Registry& registry, Integrator& integrator);

  void follow_step() { sensitivities_.follow(directions_); }
  /// At the current point, in the order of Sweep::derivatives; NaN for velocities where L is linear in v.
  std::vector<double> numbers();
  const std::string& doubt() const { return scene_.doubt; }

 private:
  DerivativeNames names_;
  ParametricScene scene_;
  Sensitivities sensitivities_;
  Directions directions_;
};

}  // namespace diracstep
