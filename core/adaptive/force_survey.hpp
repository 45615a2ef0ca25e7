#pragma once

#include <diracstep/core/adaptive/force_polynomial.hpp>
#include <diracstep/core/adaptive/step_plan.hpp>
#include <diracstep/core/runs/kink_crossings.hpp>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

namespace diracstep {

/// What a survey of the forces along a run found.
struct ForceSurveyReport {
  /// What a run with even steps over these parts of the motion would miss: the largest component of
  /// ∫|F − its polynomial| dt over all steps, in parts of the largest momentum.
  double missed = 0.0;
  double time = 0.0;  ///< where most of it is missed
  double rounding =
      0.0;               ///< standard deviation of what the rounding of times leaves of it, in the same parts
  bool followed = true;  ///< false where F changes so fast on so much of the motion that the survey gave up
  std::vector<Stretch> stretches;  ///< that resolve what was found
};

/// Looks for forces that switch, jump or pulse between the points that a run read them at.
///
/// Along the run, a cubic between each two points, the survey reads F = (∂L/∂q + f, ∂L/∂v, A v + b) at 12
/// Chebyshev points of each step and compares the polynomial through them with F at further points: in all
/// some 20000 on a small scene where a force acts or the time enters, else 2000, spread evenly with
/// irrational distances, and others that approach both ends of the step geometrically.  A step whose
/// polynomial misses F is divided: at the kinks and instants that the scene knows (Scene::kinks), at a jump
/// found by bisection, else in the middle, until each part has a polynomial.  A gap of a few units of
/// round-off is left at a jump.
///
/// What lies between the points and is not known to the scene is not seen: a pulse much narrower than 1/20000
/// of the motion.
class ForceSurvey {
 public:
  /// For forces whose impulse counts from `error` times the largest momentum on.  The scene, one with a
  /// Lagrangian, must outlive this.
  ForceSurvey(const Scene& scene, double error);

  /// Surveys a run given by its points, at least two; a gap lies between two that are a few units of
  /// round-off apart.  Each step is looked at in so many parts: the run in question may have had finer ones.
  ForceSurveyReport along(const std::vector<PathPoint>& path, long parts = 1);

 private:
  std::vector<KinkCrossing> known_in(const PathCubic& path, double a, double b);
  void add(const Stretch& stretch, const PathCubic& path, ForceSurveyReport& report);
  void examine(const PathCubic& path, double a, double b, ForceSurveyReport& report);
  void divide(const PathCubic& path, double a, double b, const std::vector<KinkCrossing>& known,
              ForceSurveyReport& report);
  void count_missed(const PathCubic& path, double a, double b, std::size_t first, ForceSurveyReport& report);
  bool switches_at(const PathCubic& before, const PathCubic& after);
  std::pair<double, double> narrow(const PathCubic& path, double a, double b);

  std::shared_ptr<const Kinks> kinks_;
  long size_;
  ForcePolynomial force_;
  std::optional<KinkCrossings> crossings_;  ///< of the run at hand
  double most_missed_ = 0.0;
  long points_ = 0, parts_ = 0;
  bool whole_ = false;  ///< the last stretch consists of undivided steps
};

}  // namespace diracstep
