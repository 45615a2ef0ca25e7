#include <diracstep/version.h>
#include <fmt/format.h>
#include <unistd.h>

#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <diracstep/command/command_line.hpp>
#include <diracstep/command/verbs.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/numerics/names.hpp>
#include <memory>
#include <new>
#include <string_view>

namespace diracstep::command {

namespace {

/// "the options of run are --method …", or the verbs where none was given.
std::string allowed(const CLI::App& app) {
  const auto verbs = app.get_subcommands();
  std::string list;
  if (verbs.empty()) {
    for (const auto* verb : app.get_subcommands({})) list += ' ' + verb->get_name();
    return "the verbs are" + list + "; diracstep --help tells more";
  }
  const std::string& verb = verbs.front()->get_name();
  for (const auto* option : verbs.front()->get_options()) list += ' ' + option->get_name();
  return fmt::format("the arguments of {0} are{1}; diracstep {0} --help tells more", verb, list);
}

std::vector<std::string> verb_names(const CLI::App& app) {
  std::vector<std::string> names;
  for (const auto* verb : app.get_subcommands({})) names.push_back(verb->get_name());
  return names;
}

/// The first word of the command line that nothing takes, with what may have been meant; or CLI11's message.
std::string complaint(const CLI::App& app, const CLI::ParseError& error) {
  constexpr std::string_view value_of_flag = " was given a disallowed flag override";
  std::string text = error.what();
  if (text.ends_with(value_of_flag))
    return fmt::format("--{} takes no value", text.substr(0, text.size() - value_of_flag.size()));
  const auto verbs = app.get_subcommands();
  if (verbs.empty() && app.remaining_size() > 0) {
    const std::string word = app.remaining().front();
    return fmt::format("unknown verb '{}'{}", word, did_you_mean(word, verb_names(app)));
  }
  if (verbs.empty()) return text;
  const auto rest = verbs.front()->remaining();
  const auto option =
      std::ranges::find_if(rest, [](const std::string& word) { return word.starts_with("-"); });
  if (option == rest.end()) return text;
  std::vector<std::string> known;
  for (const auto* each : verbs.front()->get_options())
    for (const std::string& name : each->get_lnames()) known.push_back("--" + name);
  const std::string word = option->substr(0, option->find('='));
  return fmt::format("unknown option '{}'{}", word, did_you_mean(word, known));
}

int tell(const CLI::App& app, const CLI::ParseError& error) {
  if (error.get_exit_code() == static_cast<int>(CLI::ExitCodes::Success)) return app.exit(error);
  say(fmt::format("{}; {}", complaint(app, error), allowed(app)));
  return misused;
}

/// "diracstep help" and "diracstep help VERB", the same as --help.
void add_help(CLI::App& app) {
  CLI::App* verb = app.add_subcommand("help", "What a verb does and its options; the verbs without one");
  const auto about = std::make_shared<std::string>();
  verb->add_option("VERB", *about, "run, study, …");
  verb->footer("Example:  diracstep help run");
  verb->callback([&app, about] {
    const std::vector<std::string> names = verb_names(app);
    if (about->empty()) {
      print(app.get_formatter()->make_help(&app, app.get_name(), CLI::AppFormatMode::Normal));
    } else if (std::ranges::find(names, *about) == names.end()) {
      throw Misuse(fmt::format("unknown verb '{}'{}; the verbs are {}", *about, did_you_mean(*about, names),
                               fmt::join(names, " ")));
    } else {
      print(app.get_subcommand(*about)->help("diracstep"));
    }
  });
}

/// --adaptive=1e-4 would be --adaptive: what takes no value is given none.
void refuse_values_of_flags(CLI::App& app) {
  for (CLI::App* verb : app.get_subcommands({}))
    for (CLI::Option* option : verb->get_options())
      if (option->get_items_expected_max() == 0) option->disable_flag_override();
}

/// --plugin before or after every verb; the plugins are there when the verb runs, if it does.
void take_plugins(CLI::App& app, Session& session, bool run_verbs) {
  const auto add = [](CLI::App& to, std::vector<std::string>& files) {
    const char* const text =
        "Load a plugin; may be repeated. Also taken: every *.so in the\ndirectories of DIRACSTEP_PLUGIN_PATH";
    return to.add_option("--plugin", files, text)->type_name("FILE.so")->allow_extra_args(false);
  };
  const CLI::Option* const before = add(app, session.plugin_files);
  for (CLI::App* verb : app.get_subcommands({})) {
    add(*verb, session.plugin_files);
    // Here the files after the verb are in the session, and those before it only in their option.
    verb->parse_complete_callback([&session, before, run_verbs] {
      const std::vector<std::string> files = before->results();
      session.plugin_files.insert(session.plugin_files.begin(), files.begin(), files.end());
      load_plugins(session);
      if (!run_verbs) throw CLI::Success();
    });
  }
}

volatile bool under_way = false;  ///< a verb runs

/// The last function at exit: a plugin may call exit() in the middle of a run, which nothing else would tell.
void tell_of_exit() {
  if (!under_way) return;
  constexpr std::string_view message =
      "diracstep: a plugin ended the program by exit(); the files stand as they were last written\n";
  static_cast<void>(!write(STDERR_FILENO, message.data(), message.size()));
  _exit(failed);
}

class UnderWay {
 public:
  UnderWay() {
    static const int registered = std::atexit(tell_of_exit);
    static_cast<void>(registered);
    under_way = true;
  }
  ~UnderWay() { under_way = false; }
  UnderWay(const UnderWay&) = delete;
  UnderWay& operator=(const UnderWay&) = delete;
};

int read_and_run(CLI::App& app, const Session& session, int count, char** arguments) {
  const UnderWay this_call;
  try {
    app.parse(count, arguments);
    finish_output();
    return session.exit_status;
  } catch (const CLI::ParseError& error) {
    return tell(app, error);
  } catch (const Misuse& misuse) {
    say(misuse.what());
    return misused;
  } catch (const std::bad_alloc&) {
    throw;
  } catch (const std::exception& error) {
    say(error.what());
    return failed;
  }
}

int with_all_verbs(int count, char** arguments, bool run_verbs, const Processes& processes) {
  CLI::App app("Discrete Dirac integrators for constrained Lagrangian and Hamiltonian systems", "diracstep");
  app.set_version_flag("--version", "diracstep " DIRACSTEP_VERSION);
  app.require_subcommand(1);
  app.footer(
      "Examples:\n"
      "  diracstep list methods\n"
      "  diracstep run knife_edge --step 0.05 --out knife_edge.csv\n"
      "  diracstep study knife_edge --orders 2,4,8 --out results\n"
      "Exit status: 0 done, 1 numerical failure or interrupt, 2 misuse, 3 a result that is doubted.");
  Session session;
  session.processes = processes;
  add_help(app);
  add_boundary(app, session);
  add_check(app, session);
  add_control(app, session);
  add_equilibrium(app, session);
  add_expand(app, session);
  add_fit(app, session);
  add_list(app, session);
  add_new(app, session);
  add_orders(app, session);
  add_parts(app, session);
  add_plan(app, session);
  add_run(app, session);
  add_stability(app, session);
  add_start(app, session);
  add_study(app, session);
  add_sweep(app, session);
  refuse_values_of_flags(app);
  take_plugins(app, session, run_verbs);
  return read_and_run(app, session, count, arguments);
}

}  // namespace

int execute(int count, char** arguments, bool run_verbs, const Processes& processes) {
  try {
    return with_all_verbs(count, arguments, run_verbs, processes);
  } catch (const std::bad_alloc&) {  // what tells it may not take memory
    std::fputs("diracstep: there is not enough memory\n", stderr);
    return failed;
  }
}

}  // namespace diracstep::command
