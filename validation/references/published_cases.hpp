#pragma once

#include <diracstep/core/integrator/integrator.hpp>
#include <diracstep/scene_format/scene_catalogue.hpp>
#include <string>
#include <vector>

namespace diracstep {

/// A scene run as its file recommends, against one of the references that the file states for that time.
struct PublishedCase {
  std::string scene;
  Recommendation run;        ///< method, order, step as fitted to the interval, end
  std::string kind, source;  ///< of the reference
  std::string component;     ///< the component named below, the first of the reference
  double published = 0.0;    ///< its value in the reference
  double computed = 0.0;     ///< and at the end of the run
  double error = 0.0;        ///< largest over all components, see relative_error
  double allowed = 0.0;      ///< the stated tolerance, or three units of the last digit of the reference
  std::string failure;       ///< empty, or why there is no result

  bool passed() const { return failure.empty() && error <= allowed; }
};

/// The largest difference in positions, and in velocities, each relative to the largest of them in the
/// reference.
double relative_error(const KnownState& known, const Sample& end);

/// The case of every reference at the recommended end; at least one, which failed, where there is none.
std::vector<PublishedCase> run_published_cases(const CatalogueScene& entry, const Registry& registry,
                                               const SolverFactory& solvers);

}  // namespace diracstep
