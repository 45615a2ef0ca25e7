#pragma once

#include <diracstep/command/processes.hpp>
#include <diracstep/core/integrator/integrator.hpp>
#include <diracstep/core/methods/registry.hpp>
#include <diracstep/files/paths.hpp>
#include <diracstep/plugins/loaded_plugin.hpp>
#include <diracstep/scene_format/scene_catalogue.hpp>
#include <diracstep/solvers/direct_solver.hpp>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace CLI {
class App;
}

namespace diracstep::command {

/// Exit statuses of the command.
inline constexpr int done = 0;
inline constexpr int failed = 1;  ///< a numerical failure, an interrupt, or output that could not be written
inline constexpr int misused = 2;
inline constexpr int doubted = 3;  ///< a run that came to its end, with a doubt about its result

/// What the verbs share.
struct Session {
  Registry registry = Registry::with_built_ins();
  std::string solver = "newton";  ///< see named_solver()
  KinsolOptions solver_options = {};
  SolverFactory solvers = kinsol();
  std::vector<std::string> plugin_files;  ///< as given by --plugin
  std::vector<Plugin> plugins;            ///< those and the ones on DIRACSTEP_PLUGIN_PATH
  bool drop_redundant_rows = false;       ///< of every scene that is made
  std::vector<std::string> tolerances;    ///< of its coordinates, as given by --tolerance
  Processes processes = {};               ///< that mpirun started
  int exit_status = done;
};

/// Loads the plugins on DIRACSTEP_PLUGIN_PATH, telling of those that cannot be loaded and going on, and then
/// the files of the session; throws Misuse where one of these cannot be loaded.
void load_plugins(Session& session);

/// A scene of a plugin or of the catalogue, or a file, with what was changed in it told to the person; throws
/// Misuse as diracstep::make_scene does.
CatalogueScene make_scene(const Session& session, const std::string& name, const Parameters& changes = {});

/// What a verb reads: those of the scenes that are files, and the plugins.
std::vector<NamedPath> inputs_of(const std::vector<std::string>& scenes, const Session& session);

/// "bounce, lands": the events of a scene that change its motion or end it; empty where there are none.
std::string acting_events(const CatalogueScene& entry);
/// Says on standard error that these are not looked for, where there are some.
void tell_events_left_out(const CatalogueScene& entry);

/// Makes such scenes with many values of the parameters, and tells nothing.  The session must outlive it.
std::function<CatalogueScene(const Parameters&)> scene_maker(const Session& session, const std::string& name);

/// Names of the catalogue's scenes and of those of plugins.
std::vector<std::string> scene_names(const Session& session);

/// What --method, --order and --rule say.
struct MethodChoice {
  std::string name = automatic_method;
  int order = 0;
  std::optional<std::string> rule = {};  ///< for nonholonomic rows
  bool given = false;                    ///< a method was named, be it "auto"
};
void add_method_options(CLI::App& verb, MethodChoice& choice);

/// Where neither a method nor an order was asked for, those that the scene's file recommends, and where no
/// step was asked for either, its step.
void take_recommendation(const CatalogueScene& entry, MethodChoice& choice, std::optional<double>& step);

/// The options of an integrator with this choice; the rule is looked up by name.
IntegratorOptions integrator_options(const Session& session, const MethodChoice& choice);

/// Adds --set NAME=VALUE, which may be repeated.
void add_set_option(CLI::App& verb, std::vector<std::string>& assignments);

/// Adds --drop-redundant, which is kept in the session.
void add_redundancy_option(CLI::App& verb, Session& session);
void add_tolerance_option(CLI::App& verb, Session& session);

/// Adds --solver and --jacobian, which change the session's solvers when the command line is read.
void add_solver_options(CLI::App& verb, Session& session);

/// A message for the user, on standard error; lost where that is closed or full.
void say(std::string_view message);

/// Text for standard output, and the end of it.  Both throw Error where it cannot be written.
/// Here and in messages control characters are shown escaped: see shown_lines.
void print(std::string_view text);
bool output_is_open();  ///< false where standard output was closed when the command began
void finish_output();

}  // namespace diracstep::command
