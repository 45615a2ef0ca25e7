#include <fmt/format.h>

#include <CLI/App.hpp>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <diracstep/validation/command/session.hpp>
#include <stdexcept>

namespace diracstep::command {

namespace {

[[noreturn]] void refuse_output() {
  throw std::runtime_error(
      fmt::format("standard output could not be written in full: {}", std::strerror(errno)));
}

}  // namespace

void add_solver_options(CLI::App& verb, Session& session) {
  verb.add_option_function<std::string>(
      "--solver",
      [&session](const std::string& name) {
        session.solver_options.iteration = iteration(name);
        session.solvers = kinsol(session.solver_options);
      },
      "How a step is solved: newton; fixed-point where the step has a splitting; automatic");
  verb.add_option_function<std::string>(
      "--jacobian",
      [&session](const std::string& name) {
        session.solver_options.jacobian = jacobian_policy(name);
        session.solvers = kinsol(session.solver_options);
      },
      "When Newton's method takes a new Jacobian: automatic, fresh, per-step, kept");
}

void say(std::string_view message) { fmt::print(stderr, "diracstep: {}\n", message); }

void print(std::string_view text) {
  if (std::fwrite(text.data(), 1, text.size(), stdout) != text.size()) refuse_output();
}

void finish_output() {
  if (std::fflush(stdout) != 0 || std::ferror(stdout) != 0) refuse_output();
}

}  // namespace diracstep::command
