#include <fmt/format.h>

#include <CLI/App.hpp>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <diracstep/command/session.hpp>
#include <diracstep/files/shown_text.hpp>
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

void add_method_options(CLI::App& verb, MethodChoice& choice) {
  verb.add_option_function<std::string>(
          "--method",
          [&choice](const std::string& name) {
            choice.name = name;
            choice.given = true;
          },
          "A method; see diracstep list methods.  auto: GL(S) of the order asked for, or as plan says")
      ->default_str(choice.name);
  verb.add_option("--order", choice.order,
                  "Order; methods of another one are composed to it.  0 keeps the method's own")
      ->capture_default_str();
  verb.add_option("--rule", choice.rule,
                  "Rule for nonholonomic rows: left, right, midpoint, trapezoidal or one of a plugin;\n"
                  "the method's own without it");
}

IntegratorOptions integrator_options(const Session& session, const MethodChoice& choice) {
  IntegratorOptions options{.method = choice.name, .order = choice.order};
  if (choice.rule) options.constraint_rule = session.registry.rule(*choice.rule);
  return options;
}

void add_set_option(CLI::App& verb, std::vector<std::string>& assignments) {
  verb.add_option("--set", assignments, "Set a parameter of the scene; may be repeated")
      ->type_name("NAME=VALUE")
      ->allow_extra_args(false);
}

void say(std::string_view message) {
  const std::string line = "diracstep: " + shown_lines(message) + '\n';
  std::fwrite(line.data(), 1, line.size(), stderr);  // where nobody can be told, the work goes on
}

void print(std::string_view given) {
  const std::string text = shown_lines(given);
  if (std::fwrite(text.data(), 1, text.size(), stdout) != text.size()) refuse_output();
}

void finish_output() {
  if (std::fflush(stdout) != 0 || std::ferror(stdout) != 0) refuse_output();
}

}  // namespace diracstep::command
