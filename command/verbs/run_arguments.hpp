#pragma once

#include <CLI/App.hpp>
#include <diracstep/command/session.hpp>
#include <optional>
#include <string>
#include <vector>

namespace diracstep::command {

/// What `diracstep run` is asked for.
struct RunArguments {
  std::string scene;
  MethodChoice method;
  std::optional<double> step;
  std::optional<double> end;
  std::string momentum = "projected";
  std::string out;
  long every = 1;
  int substeps = 1;
  std::string checkpoint;
  long checkpoint_every = 0;
  std::string resume;
  bool adaptive = false;
  std::optional<double> eps;
  std::optional<std::string> control;
  std::string at;
  std::string sensitivities;
  std::optional<double> every_time;
  std::optional<double> error;
  bool fixed = false;
  std::optional<long> max_solves;
  std::optional<double> max_time;
  std::optional<long> max_steps;
  double smallest_step = 0.0;
  std::string doubt = "report";
  std::vector<std::string> set;
  bool json = false;
};

constexpr const char* usual_control = "integrating";

/// Declares the options, which are read into `options`.
void add_run_arguments(CLI::App& verb, Session& session, RunArguments& options);

/// The file that checkpoints go to, or empty.
std::string checkpoint_path(const RunArguments& options);

/// Throws Misuse for values that are not allowed, for options that exclude each other and for those that
/// nothing would read.
void require_sense(const RunArguments& options);

/// Throws Misuse, before anything is computed, for what could not be written in the end, or would be written
/// over something read.
void require_files(const RunArguments& options, const Session& session);

}  // namespace diracstep::command
