#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <CLI/App.hpp>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <diracstep/command/session.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/files/shown_text.hpp>
#include <diracstep/scene_format/scene_file.hpp>

namespace diracstep::command {

namespace {

[[noreturn]] void refuse_output() {
  throw Error(fmt::format("standard output could not be written in full: {}", std::strerror(errno)));
}

}  // namespace

void add_solver_options(CLI::App& verb, Session& session) {
  verb.add_option_function<std::string>(
      "--solver",
      [&session](const std::string& name) {
        session.solver = name;
        session.solvers = named_solver(name, session.solver_options);
      },
      "How a step is solved: newton; fixed-point where the step has a splitting; automatic;\n"
      "direct, a plain loop in place of KINSOL, for small scenes");
  verb.add_option_function<std::string>(
      "--jacobian",
      [&session](const std::string& name) {
        session.solver_options.jacobian = jacobian_policy(name);
        session.solvers = named_solver(session.solver, session.solver_options);
      },
      "When Newton's method takes a new Jacobian: automatic, fresh, per-step, kept");
}

void add_method_options(CLI::App& verb, MethodChoice& choice) {
  verb.add_option(
          "--method", choice.name,
          "A method; see diracstep list methods.  auto: GL(S) of the order asked for, or as plan says")
      ->capture_default_str()
      ->each([&choice](const std::string&) { choice.given = true; });
  verb.add_option("--order", choice.order,
                  "Order; methods of another one are composed to it.  0 keeps the method's own")
      ->capture_default_str();
  verb.add_option("--rule", choice.rule,
                  "Rule for nonholonomic rows: left, right, midpoint, trapezoidal or one of a plugin;\n"
                  "the method's own without it");
}

void take_recommendation(const CatalogueScene& entry, MethodChoice& choice, std::optional<double>& step) {
  const Recommendation& advice = entry.recommended;
  if (!advice.stated || choice.given || choice.order != 0) return;
  choice.name = advice.method;
  choice.order = advice.order;
  if (!step) step = std::copysign(advice.step, entry.t_end - entry.scene->start.time);
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

void add_redundancy_option(CLI::App& verb, Session& session) {
  verb.add_flag("--drop-redundant", session.drop_redundant_rows,
                "Leave out redundant constraints also where a scene refuses them, and say which");
}

void add_tolerance_option(CLI::App& verb, Session& session) {
  verb.add_option(
          "--tolerance", session.tolerances,
          "A coordinate that is far smaller than others is solved to this in each step, not to 1e-15\n"
          "of the largest; may be repeated")
      ->type_name("COORDINATE=VALUE")
      ->allow_extra_args(false);
}

void say(std::string_view message) {
  const std::string line = "diracstep: " + shown_lines(message) + '\n';
  std::fwrite(line.data(), 1, line.size(), stderr);  // where nobody can be told, the work goes on
}

std::vector<NamedPath> inputs_of(const std::vector<std::string>& scenes, const Session& session) {
  std::vector<NamedPath> inputs;
  for (const std::string& scene : scenes)
    if (is_scene_file(scene)) inputs.push_back({"the scene", scene});
  for (const Plugin& plugin : session.plugins) inputs.push_back({"the plugin", plugin.path()});
  return inputs;
}

void print(std::string_view given) {
  const std::string text = shown_lines(given);
  if (std::fwrite(text.data(), 1, text.size(), stdout) != text.size()) refuse_output();
}

bool output_is_open() {  // prepare_standard_streams() opens a closed one for reading
  const int flags = ::fcntl(STDOUT_FILENO, F_GETFL);  // NOLINT
  return flags >= 0 && (flags & O_ACCMODE) != O_RDONLY;
}

void finish_output() {
  if (std::fflush(stdout) != 0 || std::ferror(stdout) != 0) refuse_output();
}

}  // namespace diracstep::command
