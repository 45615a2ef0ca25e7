#pragma once

#include <diracstep/reports/study_page.hpp>
#include <diracstep/validation/studies/convergence_study.hpp>
#include <optional>
#include <string>
#include <vector>

namespace diracstep::command {

constexpr const char* best_formulation = "best";  // of IDA on a scene

/// What `diracstep study` is asked for.
struct StudyArguments {
  std::vector<std::string> scenes;
  std::optional<std::string> methods;
  std::optional<std::string> orders, steps, rtols;
  std::string ida_formulation = best_formulation;
  bool without_ida = false, without_erk = false;
  bool adaptive = false, full = false;
  std::optional<int> repeat;
  int parallel = 1;
  std::optional<double> budget;
  std::optional<double> end;
  std::string momentum = "projected";
  std::string out, compare, more_scenes, table;
  std::vector<std::string> set;
  bool json = false, sensitivities = false;
};

/// Where the person said how far the ladders go, they go so far.
bool limited(const StudyArguments& options);

bool nothing_named(const StudyArguments& options);

/// Throws Misuse for what is not known or not allowed.
StudyOptions study_options(const StudyArguments& options);

/// What was asked for, as the report tells it.
PageFacts facts_of(const StudyOptions& study);

}  // namespace diracstep::command
