#pragma once

#include <diracstep/core/adaptive/adaptive_integrator.hpp>
#include <diracstep/core/adaptive/error_control.hpp>
#include <optional>
#include <string>

namespace diracstep::command {

/// How a run of variable steps went, for its report.
struct VariableSteps {
  double eps = 0.0;
  StepControl control = StepControl::integrating;
  ControlReport report;
};

/// "integrating", "in-step" or "irreversible".
StepControl step_control(const std::string& text);
const char* name(StepControl control);

/// A line on the control for the user, and one that warns where the guard acted too often (else empty).
std::string summary(const VariableSteps& steps);
std::string warning(const VariableSteps& steps, long taken);

/// The search for a step and its outcome, for the user.
std::string search_table(const ErrorControlReport& search);

/// "max ω / min ω = 88 over 20 of 20 units of time": whether variable steps pay on a scene whose own fixed
/// step is `step`, or why that is not known.
PlanLine rate_line(const Scene& scene, const SolverFactory& solvers, double end, double step);

}  // namespace diracstep::command
