#pragma once

#include <diracstep/reports/motion.hpp>
#include <diracstep/validation/studies/convergence_study.hpp>
#include <string>
#include <vector>

namespace diracstep {

/// The error of one run, and what should stay constant, over time.
struct History {
  std::string method;  ///< empty where there is no run to look at
  int order = 0;
  double step = 0.0;
  std::vector<double> time;
  std::vector<double> error;  ///< maximum norm of the error of q over that of the largest q, or the same of p
  std::string error_against;  ///< the closed form, or "the same run with half the step"
  std::vector<double> energy;      ///< |E(t) − E(0)| / max(|E(0)|, 1)
  std::vector<double> constraint;  ///< largest |φ(q)| and |A(q)v + b|; empty for a scene without rows
  struct Change {
    std::string name;
    std::vector<double> values;  ///< |I(t) − I(0)| / max(|I(0)|, 1)
  };
  std::vector<Change> invariants;  ///< of the scene
  DrawnMotion motion;              ///< what is drawn …
  std::vector<double> track_time;  ///< … and when …
  std::vector<Vector> positions;   ///< … its coordinates are where
  std::vector<PlanLine> plan;      ///< what the integrator does and leaves out
  std::string failure;             ///< empty, or why the run stopped
};

/// The run of a study with steps of one size that comes nearest to the error 1e-6 from below, repeated with
/// about `points` points kept; where none is that exact, the most exact one.  Where it takes too few steps
/// for a smooth picture, the motion is that of a second run with shorter ones.
History record_history(const CatalogueScene& scene, const Registry& registry, const SolverFactory& solvers,
                       const Study& study, long points = 400);

/// A line for each time: t, error, energy, rows, the invariants.
std::string history_csv(const History& history);

/// A line for each time of the motion: t, then the drawn coordinates by name.
std::string motion_csv(const History& history);

}  // namespace diracstep
