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

/// A line on the control for the user, and one that warns where the guard acted too often (else empty).
std::string summary(const VariableSteps& steps);
std::string warning(const VariableSteps& steps, long taken);

/// The search for a step and its outcome, for the user.
std::string search_table(const ErrorControlReport& search);

}  // namespace diracstep::command
