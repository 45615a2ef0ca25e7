#pragma once

#include <diracstep/files/csv_table.hpp>
#include <diracstep/scene_format/scene_catalogue.hpp>
#include <diracstep/sensitivities/fit.hpp>
#include <optional>
#include <string>
#include <vector>

namespace diracstep {

/// A scene whose parameters are fitted.
struct FittedScene {
  std::string name;                 ///< as make_scene() takes it; of a text what names it in messages
  std::optional<std::string> text;  ///< of a scene file, in place of the name
  Parameters changes;               ///< parameters and sizes that are changed
  std::vector<std::string> parameters;
};

/// The values that the search begins with: those of the scene, made of `of`.  Throws Misuse for a name that
/// is no parameter, and where the scene is on groups or spheres or has events.
Vector fit_start(const FittedScene& of, const CatalogueScene& entry);

/// What is fitted.  Throws Misuse as parametric_scene() does when it is used.
FitProblem fit_problem(const FittedScene& of, const Registry& registry, SolverFactory solvers,
                       IntegratorOptions steps);

/// The columns that are coordinates, velocities v_NAME or outputs, behind one of the times "t"; others of a
/// trajectory (p_NAME, lambda_NAME, invariant_NAME, energy, derivatives) are left alone.  `sigma`: standard
/// deviations by column, 1 without.  Throws Misuse for any other name, and for none; `from` names the table
/// in messages.
FitData fit_data(const CsvTable& table, const std::string& from, const CatalogueScene& entry,
                 const Parameters& sigma);

/// "x", "v_x", or the name of an output.
std::string column_name(const FitData::Column& column, const CatalogueScene& entry);

/// Empty, or why the parameters that were found are not to be believed: what is left is far larger than the
/// standard deviations, where `sigma` states those of all columns.
std::string doubt_of_fit(const FitReport& report, const FitData& data, const Parameters& sigma);

}  // namespace diracstep
