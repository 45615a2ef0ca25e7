#pragma once

#include <diracstep/command/session.hpp>
#include <optional>
#include <string>
#include <vector>

namespace diracstep::command {

struct GradientStudy {
  std::vector<std::string> scenes;  ///< names and files; none: a selection
  std::vector<std::string> set;     ///< NAME=VALUE
  std::optional<double> end;
  std::string out;  ///< directory for gradients_SCENE.csv and pictures; empty: none
  bool json = false;
};

/// The error of gradients over processor time, beside forward sensitivities by SUNDIALS IDAS, by the program
/// diracstep-gradients, which stands beside the command.  Throws Misuse where it does not.
void study_gradients(const GradientStudy& study, Session& session);

}  // namespace diracstep::command
