#include <fmt/format.h>

#include <CLI/App.hpp>
#include <algorithm>
#include <diracstep/command/arguments.hpp>
#include <diracstep/command/files/written_file.hpp>
#include <diracstep/command/interrupt.hpp>
#include <diracstep/command/progress.hpp>
#include <diracstep/command/scene_selection.hpp>
#include <diracstep/command/verbs.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/files/input_file.hpp>
#include <diracstep/files/paths.hpp>
#include <diracstep/reports/build_facts.hpp>
#include <diracstep/reports/plot.hpp>
#include <diracstep/reports/report.hpp>
#include <diracstep/reports/study_comparison.hpp>
#include <diracstep/reports/study_page.hpp>
#include <diracstep/reports/study_plot.hpp>
#include <filesystem>
#include <memory>
#include <optional>

namespace diracstep::command {

namespace {

/// What a study without scenes runs: scenes of every constraint class, in a few minutes.
const std::vector<std::string> fair_selection{"kepler_e06",         "stiff_spring_pendulum",
                                              "pendulum_cartesian", "double_pendulum",
                                              "knife_edge",         "chaplygin_sleigh",
                                              "contact_oscillator", "nonholonomic_particle_free",
                                              "lotka_volterra_2d",  "toda_200"};

constexpr const char* best_formulation = "best";  // of IDA on a scene

struct Options {
  std::vector<std::string> scenes;
  std::optional<std::string> methods;
  std::optional<std::string> orders, steps, rtols;
  std::string ida_formulation = best_formulation;
  bool without_ida = false, without_erk = false;
  bool adaptive = false;
  int repeat = 5;
  double budget = 1.0;
  std::optional<double> end;
  std::string momentum = "projected";
  std::string out, compare, more_scenes, table;
  std::vector<std::string> set;
  bool json = false;
};

/// Where a study of no named scenes leaves its report.
const std::string default_directory = "diracstep-study";

constexpr const char* explanation =
    "# CPU time to an error\n\n"
    "Written by `diracstep study SCENE... --methods A,B,... --table FILE`: the thread's CPU time at which "
    "the relative\n"
    "error (maximum norm, q and projected p) at the end of the motion reaches each level, read off the lower "
    "envelope of\n"
    "error against time by log-log interpolation. A dash: the method does not get there. Where the "
    "coarsest step is\n"
    "below the level already, its time stands; of a baseline, a dash. The fastest of ours is bold. One run "
    "on one machine: compare within a "
    "table.\n\n";

std::string tables(const std::vector<Study>& studies) {
  std::string text = explanation;
  for (const Study& study : studies) text += at_error_markdown(study);
  return text;
}

/// The directory of --out: study.csv, study.json, summary.md, report.html, and of each scene its pictures and
/// the run looked at, renewed after each scene.
class OutputDirectory {
 public:
  explicit OutputDirectory(const std::string& path) : path_(output_directory(path)) {
    if (const auto failure = write_tables({}); !failure.empty()) throw Misuse("--out: " + failure);
  }

  /// Empty, or what could not be written.
  std::string write(const std::vector<Study>& studies, const std::vector<PageEntry>& page,
                    const PageFacts& options) const {
    draw(studies, page.back());
    const std::string stem = (path_ / file_name(page.back().study.scene)).string();
    std::string failure = write_tables(studies);
    const History& history = page.back().history;
    if (failure.empty() && !history.time.empty())
      failure = write_file(stem + "-history.csv", history_csv(history));
    if (failure.empty() && !history.time.empty())
      failure = write_file(stem + "-motion.csv", motion_csv(history));
    if (failure.empty()) failure = write_file(path_ / "report.html", study_page(page, options, path_));
    return failure;
  }

  std::string report() const { return (path_ / "report.html").string(); }

 private:
  void draw(const std::vector<Study>& studies, const PageEntry& entry) const {
    tell(draw_work_precision(entry.study, series_styles(studies), path_));
    if (!entry.history.time.empty())
      tell(draw_history(entry.history, entry.study.scene, entry.time_unit, series_styles(studies), path_));
    tell(draw_summary(studies, path_));
  }

  static void tell(const std::string& failure) {
    if (!failure.empty()) say(failure);
  }

  std::string write_tables(const std::vector<Study>& studies) const {
    std::string failure = write_file(path_ / "study.csv", studies_csv(studies));
    if (failure.empty()) failure = write_file(path_ / "study.json", studies_json(studies) + '\n');
    if (failure.empty()) failure = write_file(path_ / "summary.md", summary_markdown(studies));
    return failure;
  }

  std::filesystem::path path_;
};

std::optional<DaeFormulation> formulation(const std::string& given) {
  if (given == best_formulation) return {};
  std::string allowed = best_formulation;
  for (const DaeFormulation known : all_formulations) {
    if (given == name(known)) return known;
    allowed += std::string(", ") + name(known);
  }
  throw Misuse(fmt::format("--ida-formulation '{}' is not known; allowed are {}", given, allowed));
}

StudyOptions study_options(const Options& options) {
  StudyOptions study;
  if (options.methods)
    study.methods = names("--methods", *options.methods);
  else if (!options.orders)
    study.methods = {"type1/midpoint", "type1/gl:3", "type1/gl:4", "type1/gl:6"};
  if (options.orders) study.orders = whole_numbers("--orders", *options.orders);
  if (options.steps) study.steps = numbers("--steps", *options.steps);
  if (options.rtols) study.rtols = numbers("--rtols", *options.rtols);
  if (options.without_ida) std::erase(study.baselines, ida_method);
  if (options.without_erk) std::erase(study.baselines, erk_method);
  study.ida_formulation = formulation(options.ida_formulation);
  study.adaptive = options.adaptive;
  study.repeats = options.repeat;
  study.run_budget = options.budget;
  study.t_end = options.end;
  study.momentum = momentum(options.momentum);
  return study;
}

constexpr const char* formulations =
    "rates: multipliers as derivatives, φ = 0 beside A v + b = 0 (Gear, Gupta, Leimkuhler), index 1; "
    "rates-loose: the same without a tolerance on the multipliers; index-2: the multipliers themselves, "
    "without a tolerance; velocity: as rates with A v + b = 0 alone, so that φ drifts";

/// What was asked for, as the report tells it.
PageFacts facts_of(const StudyOptions& study) {
  PageFacts facts{{"methods", fmt::format("{}", fmt::join(study.methods, ", "))}};
  facts.emplace_back(
      "orders", study.orders.empty() ? "all that fit" : fmt::format("{}", fmt::join(study.orders, ", ")));
  facts.emplace_back("steps", study.steps.empty()
                                  ? fmt::format("a ladder, up to {:g} s of CPU time a run", study.run_budget)
                                  : fmt::format("{}", fmt::join(study.steps, ", ")));
  if (!study.baselines.empty())
    facts.emplace_back("tolerances of the baselines", fmt::format("{:g}", fmt::join(study.rtols, ", ")));
  if (std::ranges::find(study.baselines, ida_method) != study.baselines.end()) {
    facts.emplace_back("formulation of IDA",
                       study.ida_formulation ? name(*study.ida_formulation)
                                             : "on each scene those that are fastest to 1e-3, 1e-6 or 1e-9");
    facts.emplace_back("formulations", formulations);
  }
  facts.emplace_back("CPU time", fmt::format("of the thread, output excluded, median of {}", study.repeats));
  facts.emplace_back("momentum", name(study.momentum));
  return facts;
}

std::string label(const StudyRow& row) {
  if (row.is_baseline()) return fmt::format("{}, rtol {:g}", row.method, row.rtol);
  const std::string step = row.fits() ? fmt::format(", step {:g}", row.step) : "";
  return fmt::format("{} order {}{}", row.method, row.order, step);
}

/// Whether a failed row is a failure of the study.  It is where the user chose the step or the tolerance; on
/// a ladder, which looks for the largest possible step, only where no other row of the same kind succeeded.
bool counts(const StudyRow& failed_row, const Study& study, const Options& options) {
  const bool chosen = (failed_row.is_baseline() ? options.rtols : options.steps).has_value();
  if (chosen && failed_row.fits()) return true;
  return std::ranges::none_of(study.rows, [&](const StudyRow& row) {
    return row.ok() && row.method == failed_row.method &&
           (row.order == failed_row.order || !failed_row.fits());
  });
}

/// Tells of every failed row; whether one counts.
bool tell_failures(const Study& study, const Options& options) {
  bool failure = false;
  for (const StudyRow& row : study.rows) {
    if (row.ok()) continue;
    say(fmt::format("{}: {}: {}", study.scene, label(row), row.status));
    failure = counts(row, study, options) || failure;
  }
  return failure;
}

std::vector<CatalogueScene> chosen_scenes(const Options& options, const Session& session) {
  std::vector<std::string> words = options.scenes;
  if (!options.more_scenes.empty())
    for (const std::string& word : names("--scenes", options.more_scenes)) words.push_back(word);
  if (words.empty()) words = fair_selection;
  std::vector<CatalogueScene> scenes;
  const Parameters changes = parameters(options.set);
  for (const auto& word : words)
    for (CatalogueScene& scene : scenes_meant(session, word, changes)) scenes.push_back(std::move(scene));
  return scenes;
}

Study one_study(const CatalogueScene& scene, const StudyOptions& options, const Session& session,
                std::size_t number, std::size_t of) {
  Progress progress;
  return convergence_study(scene, session.registry, session.solvers, options,
                           [&](double part, const std::string& what) {
                             progress.show(part, fmt::format("{}/{} {}", number, of, what));
                             return !interrupted();
                           });
}

constexpr std::size_t largest_study = 100'000'000;  // bytes of an earlier study.json

std::string earlier_study(const std::string& path) {
  std::string text = read_file(path, "--compare:", largest_study);
  if (text.empty()) throw Misuse(fmt::format("--compare: '{}' is empty", path));
  require_study(text);
  return text;
}

/// Before anything is computed: what would be written over something read or over another output, and a table
/// that cannot be written.
void require_files(const Options& options, const Session& session) {
  std::vector<NamedPath> inputs;
  for (const std::string& scene : options.scenes)
    if (scene.ends_with(".toml")) inputs.push_back({"the scene", scene});
  for (const Plugin& plugin : session.plugins) inputs.push_back({"the plugin", plugin.path()});
  if (!options.compare.empty()) inputs.push_back({"--compare", options.compare});
  if (!options.table.empty()) require_outputs({{"--table", options.table}}, inputs);
  if (options.out.empty()) return;
  if (!options.table.empty()) inputs.push_back({"--table", options.table});
  for (const char* name : {"study.csv", "study.json", "report.html", "summary.md"})
    for (const NamedPath& other : inputs)
      if (same_file(options.out + '/' + name, other.path))
        throw Misuse(fmt::format("--out: '{}' would write its {} over {} '{}'", options.out, name, other.what,
                                 other.path));
}

PageEntry page_entry(const Study& study, const CatalogueScene& scene, const Session& session) {
  History history =
      study.interrupted ? History{} : record_history(scene, session.registry, session.solvers, study);
  return {study, std::move(history), scene.kind, scene.description, scene.source, time_unit(scene.notes)};
}

/// Where the report goes: --out, or a default where no scenes are named.
std::optional<OutputDirectory> report_directory(const Options& options) {
  const bool nothing_named = options.scenes.empty() && options.more_scenes.empty();
  if (!options.out.empty()) return OutputDirectory(options.out);
  if (nothing_named) return OutputDirectory(default_directory);
  return {};
}

void study(const Options& options, Session& session) {
  require_files(options, session);
  const std::vector<CatalogueScene> scenes = chosen_scenes(options, session);
  const StudyOptions chosen = study_options(options);
  const std::string before = options.compare.empty() ? "" : earlier_study(options.compare);
  const std::optional<OutputDirectory> out = report_directory(options);
  catch_interrupts();
  for (const auto& [name, value] : build_facts()) say(fmt::format("{}: {}", name, value));
  std::vector<Study> studies;
  std::vector<PageEntry> page;
  for (const CatalogueScene& scene : scenes) {
    if (interrupted()) break;
    studies.push_back(one_study(scene, chosen, session, studies.size() + 1, scenes.size()));
    if (tell_failures(studies.back(), options)) session.exit_status = failed;
    if (!options.json) print(study_table(studies.back()) + '\n');
    std::string failure;
    if (out) {
      page.push_back(page_entry(studies.back(), scene, session));
      failure = out->write(studies, page, facts_of(chosen));
    }
    if (failure.empty() && !options.table.empty()) failure = write_file(options.table, tables(studies));
    if (failure.empty()) continue;
    say(failure);
    session.exit_status = failed;
  }
  if (options.json) print(studies_json(studies) + '\n');
  if (!before.empty()) say(comparison_table(compare_studies(studies, before)));
  if (out) say("the report of this study: " + out->report());
  if (!interrupted()) return;
  say("interrupted; what was finished is there");
  session.exit_status = failed;
}

}  // namespace

void add_study(CLI::App& app, Session& session) {
  CLI::App* verb = app.add_subcommand(
      "study", "Error against run time, beside SUNDIALS IDA and an explicit Runge–Kutta method");
  add_solver_options(*verb, session);
  const auto options = std::make_shared<Options>();
  verb->add_option("SCENE", options->scenes,
                   "Scenes, patterns such as 'kepler*', or classes such as holonomic;\na fair selection "
                   "without any, with its report in diracstep-study/");
  verb->add_option("--scenes", options->more_scenes, "The same, as a list A,B,…");
  verb->add_option(
      "--methods", options->methods,
      "Methods, A,B,…; without it type1/midpoint,\nand GL(3), GL(4), GL(6) where no orders are given either");
  verb->add_option("--orders", options->orders, "Orders, 2,4,…; without it all that fit");
  verb->add_option("--steps", options->steps, "Step sizes, H1,H2,…; a ladder without it");
  verb->add_option("--rtols", options->rtols, "Tolerances of the baselines; 1e-4,1e-5,…,1e-14 without it");
  verb->add_flag("--adaptive", options->adaptive,
                 "Also reversible variable steps, with a ladder of eps (in the column of the steps)");
  verb->add_option("--ida-formulation", options->ida_formulation,
                   "How IDA is given the rows: rates, rates-loose, index-2 or velocity;\n"
                   "best: on each scene those that are fastest to 1e-3, 1e-6 or 1e-9")
      ->capture_default_str();
  verb->add_flag("--without-ida", options->without_ida, "No runs of IDA");
  verb->add_flag("--without-erk", options->without_erk, "No runs of the explicit Runge–Kutta method");
  verb->add_option("--repeat", options->repeat, "Timed runs of each row")->capture_default_str();
  verb->add_option("--budget", options->budget, "CPU seconds that a run of a ladder may take")
      ->capture_default_str();
  verb->add_option("--end", options->end, "End time; the scene's own without it");
  verb->add_option("--momentum", options->momentum,
                   "Representative of the momentum: plus, minus or projected")
      ->capture_default_str();
  verb->add_option("--out", options->out,
                   "Directory for report.html, study.csv, study.json, summary.md and the pictures")
      ->type_name("DIR");
  verb->add_option("--compare", options->compare,
                   "An earlier study.json: tells what got faster, slower, more or less exact")
      ->type_name("OLD.json");
  verb->add_option("--table", options->table, "Markdown file: CPU time of each method at the compared errors")
      ->type_name("FILE");
  add_redundancy_option(*verb, session);
  add_set_option(*verb, options->set);
  verb->add_flag("--json", options->json, "One JSON document on standard output");
  verb->footer(
      "Examples:\n"
      "  diracstep study --out results\n"
      "  diracstep study knife_edge --orders 2,4 --steps 0.1,0.05,0.025 --rtols 1e-6,1e-8 --json");
  verb->callback([options, &session] { study(*options, session); });
}

}  // namespace diracstep::command
