#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <diracstep/command/run_identity.hpp>
#include <diracstep/files/input_file.hpp>
#include <diracstep/files/sha256.hpp>
#include <diracstep/reports/build_facts.hpp>
#include <diracstep/validation/studies/convergence_study.hpp>
#if defined(__GLIBC__)
#include <gnu/libc-version.h>
#endif

namespace diracstep::command {

namespace {

using Function = double (*)(double);

constexpr std::size_t largest_plugin = 1'000'000'000;  // bytes

std::string bits(const Vector& values) {
  return {reinterpret_cast<const char*>(values.data()),
          static_cast<std::size_t>(values.size()) * sizeof(double)};
}

/// Of what the mathematical functions give at points over their range: another library, or the same one on
/// another processor, may give other last bits.
std::string mathematics() {
  constexpr std::array<Function, 16> functions{
      [](double x) { return std::sin(x); },         [](double x) { return std::cos(x); },
      [](double x) { return std::tan(x); },         [](double x) { return std::exp(x / 4.0); },
      [](double x) { return std::log(x); },         [](double x) { return std::pow(x, 1.7); },
      [](double x) { return std::sqrt(x); },        [](double x) { return std::asin(x / 64.0); },
      [](double x) { return std::acos(x / 64.0); }, [](double x) { return std::atan(x); },
      [](double x) { return std::atan2(x, 3.0); },  [](double x) { return std::sinh(x / 4.0); },
      [](double x) { return std::tanh(x / 16.0); }, [](double x) { return std::asinh(x); },
      [](double x) { return std::acosh(1.0 + x); }, [](double x) { return std::atanh(x / 64.0); }};
  constexpr int points = 512;
  Sha256 sum;
  for (const Function function : functions)
    for (int i = 1; i < points; ++i) {
      const volatile double x = 0.1249 * i;  // computed here and now, not by the compiler
      const double y = function(x);
      sum.add({reinterpret_cast<const char*>(&y), sizeof y});
    }
  return sum.hex().substr(0, 16);
}

std::string c_library() {
#if defined(__GLIBC__)
  return std::string("glibc ") + gnu_get_libc_version();
#else
  return unknown_fact;
#endif
}

bool contains(const std::vector<std::string>& names, const std::string& name) {
  return std::ranges::find(names, name) != names.end();
}

/// Whether the scene, the method or the rule of the run is of this plugin.
bool serves(const Plugin& plugin, const CatalogueScene& entry, const MethodChoice& choice,
            const std::string& method) {
  return contains(plugin.scenes(), entry.scene->name) || contains(plugin.methods(), method) ||
         (choice.rule && contains(plugin.rules(), *choice.rule));
}

}  // namespace

std::vector<std::pair<std::string, std::string>> run_identity(const CatalogueScene& entry,
                                                              const Session& session,
                                                              const MethodChoice& choice,
                                                              const Integrator& integrator,
                                                              const Keeping& keeping, bool to_file) {
  const IntegratorOptions& options = integrator.options();
  const Start& start = integrator.scene().start;
  std::vector<std::pair<std::string, std::string>> run;
  for (const auto& [what, fact] : build_facts())
    if (what != "system") run.emplace_back(what, fact);  // another kernel gives the same bits
  run.emplace_back("C library", c_library());
  run.emplace_back("mathematical functions", mathematics());
  run.emplace_back("scene", entry.scene->name);
  for (const auto& [name, value] : entry.parameters)
    run.emplace_back("parameter " + name, fmt::format("{:.17g}", value));
  for (const auto& [what, text] : entry.definition) run.emplace_back(what, text);
  run.emplace_back("start, as bits", sha256(bits(Vector::Constant(1, start.time)) + bits(start.q) +
                                            bits(start.v) + bits(start.p))
                                         .substr(0, 16));
  for (Eigen::Index i = 0; i < entry.scene->tolerances.size(); ++i)
    run.emplace_back("tolerance of " + entry.scene->coordinates[static_cast<std::size_t>(i)],
                     fmt::format("{:.17g}", entry.scene->tolerances[i]));
  run.emplace_back("redundant rows", session.drop_redundant_rows ? "dropped" : "as the scene says");
  run.emplace_back("method", options.method);
  run.emplace_back("order", std::to_string(options.order));
  run.emplace_back("step", fmt::format("{:.17g}", options.step));
  run.emplace_back("substeps", std::to_string(options.substeps));
  run.emplace_back("compensated sums", options.compensated_sums ? "yes" : "no");
  run.emplace_back("trajectory", to_file ? fmt::format("every {}", keeping.every) : "none");
  if (!keeping.times.empty()) {
    const Vector times =
        Eigen::Map<const Vector>(keeping.times.data(), static_cast<Eigen::Index>(keeping.times.size()));
    run.emplace_back("times of the trajectory, as bits", sha256(bits(times)).substr(0, 16));
  }
  run.emplace_back("momentum", diracstep::name(keeping.momentum));
  run.emplace_back("rule", choice.rule.value_or("the method's own"));
  run.emplace_back("solver", session.solver);
  run.emplace_back("Jacobian", name(session.solver_options.jacobian));
  for (const Plugin& plugin : session.plugins)
    if (serves(plugin, entry, choice, options.method))
      run.emplace_back("plugin " + plugin.name(),
                       sha256(read_file(plugin.path(), "the plugin", largest_plugin)));
  return run;
}

}  // namespace diracstep::command
