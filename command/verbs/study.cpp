#include <fmt/format.h>
#include <unistd.h>

#include <CLI/App.hpp>
#include <algorithm>
#include <atomic>
#include <diracstep/command/arguments.hpp>
#include <diracstep/command/files/written_file.hpp>
#include <diracstep/command/gradient_study.hpp>
#include <diracstep/command/interrupt.hpp>
#include <diracstep/command/progress.hpp>
#include <diracstep/command/scene_selection.hpp>
#include <diracstep/command/verbs.hpp>
#include <diracstep/command/verbs/study_arguments.hpp>
#include <diracstep/command/verbs/study_output.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/files/input_file.hpp>
#include <diracstep/files/paths.hpp>
#include <diracstep/reports/build_facts.hpp>
#include <diracstep/reports/report.hpp>
#include <diracstep/reports/study_comparison.hpp>
#include <diracstep/reports/study_page.hpp>
#include <diracstep/reports/study_plot.hpp>
#include <diracstep/solvers/sundials_build.hpp>
#include <diracstep/validation/references/explicit_reference.hpp>
#include <exception>
#include <filesystem>
#include <functional>
#include <future>
#include <limits>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>

namespace diracstep::command {

namespace {

/// What a study without scenes runs: scenes of every class, also those where ours is slower.
const std::vector<std::string> fair_selection{"knife_edge",
                                              "nonholonomic_particle_free",
                                              "lotka_volterra_2d",
                                              "chaplygin_sleigh",
                                              "double_pendulum",
                                              "flyball_governor",
                                              "contact_oscillator",
                                              "stiff_spring_pendulum",
                                              "andrews_squeezer",
                                              "mass_spring_torn",
                                              "pendulum_cartesian",
                                              "kepler_e06",
                                              "pleiades",
                                              "kepler_e099",
                                              "toda_200"};
/// … and with --full these as well.
const std::vector<std::string> more_scenes{"vertical_rolling_disk", "car_axis",   "rigid_body_quat",
                                           "point_vortices_two",    "lc_circuit", "hanging_chain"};
constexpr int most_threads = 1024;
constexpr double quick_time = 34.0;  // CPU seconds for all scenes, pictures left out

/// Where a study of no named scenes leaves its report.
const std::string default_directory = "diracstep-study";

std::string label(const StudyRow& row) {
  if (row.is_baseline()) return fmt::format("{}, rtol {:g}", row.method, row.rtol);
  const std::string step = row.fits() ? fmt::format(", step {:g}", row.step) : "";
  return fmt::format("{} order {}{}", row.method, row.order, step);
}

/// Whether a failed row is a failure of the study.  It is where the user chose the step or the tolerance; on
/// a ladder, which looks for the largest possible step, only where no other row of the same kind succeeded. A
/// baseline that the scene has no equations for has not failed.
bool counts(const StudyRow& failed_row, const Study& study, const StudyArguments& options) {
  if (failed_row.status.starts_with(not_explicit)) return false;
  const bool chosen = (failed_row.is_baseline() ? options.rtols : options.steps).has_value();
  if (chosen && failed_row.fits()) return true;
  return std::ranges::none_of(study.rows, [&](const StudyRow& row) {
    return row.ok() && row.method == failed_row.method &&
           (row.order == failed_row.order || !failed_row.fits());
  });
}

/// Tells of every failed row; whether one counts.
bool tell_failures(const Study& study, const StudyArguments& options) {
  const bool ladders = !options.steps && !options.methods && !options.orders;
  bool failure = false;
  for (const StudyRow& row : study.rows) {
    if (row.ok()) continue;
    if (!(ladders && !counts(row, study, options)))  // a ladder looks for the largest possible step
      say(fmt::format("{}: {}: {}", study.scene, label(row), row.status));
    failure = counts(row, study, options) || failure;
  }
  return failure;
}

std::vector<CatalogueScene> chosen_scenes(const StudyArguments& options, const Session& session) {
  std::vector<std::string> words = options.scenes;
  if (!options.more_scenes.empty())
    for (const std::string& word : names("--scenes", options.more_scenes)) words.push_back(word);
  if (words.empty()) words = fair_selection;
  if (options.full && nothing_named(options))
    words.insert(words.end(), more_scenes.begin(), more_scenes.end());
  std::vector<CatalogueScene> scenes;
  const Parameters changes = parameters(options.set);
  for (const auto& word : words)
    for (CatalogueScene& scene : scenes_meant(session, word, changes)) scenes.push_back(std::move(scene));
  return scenes;
}

/// The scenes of a study, run by so many threads, with one line of progress for all of them.  The ladders of
/// all scenes share `time` CPU seconds: each has the part of what is left that it is expected to take.
class Course {
 public:
  Course(std::vector<CatalogueScene> scenes, const StudyOptions& options, const Session& session,
         bool in_order, double time)
      : options_(options), session_(session), time_(time) {
    for (CatalogueScene& scene : scenes) {
      const double seconds = expected_seconds(scene, session.registry, session.solvers, options);
      stages_.push_back({std::move(scene), seconds});
      all_ += seconds;
    }
    if (!in_order) std::ranges::stable_sort(stages_, {}, &Stage::seconds);
  }

  std::size_t size() const { return stages_.size(); }
  const CatalogueScene& scene(std::size_t i) const { return stages_[i].scene; }

  /// Calls `finished` on this thread for each scene in turn, as soon as it and those before it are done.  An
  /// interrupt leaves out what was not begun.
  void run(int threads, const std::function<void(std::size_t, Study)>& finished) {
    std::vector<std::promise<std::optional<Study>>> results(stages_.size());
    std::atomic<std::size_t> next = 0;
    const auto work_on = [&](std::size_t i) {
      try {
        results[i].set_value(interrupted() ? std::nullopt : std::optional(study(i)));
      } catch (...) {
        results[i].set_exception(std::current_exception());
      }
    };
    const auto work = [&] {
      for (std::size_t i = next++; i < stages_.size(); i = next++) work_on(i);
    };
    std::vector<std::jthread> others;
    if (threads > 1)
      for (int k = 0; k < threads; ++k) others.emplace_back(work);
    try {
      for (std::size_t i = 0; i < stages_.size(); ++i) {
        if (threads == 1) work_on(i);
        std::optional<Study> result = results[i].get_future().get();
        wipe();
        if (result) finished(i, std::move(*result));
      }
    } catch (...) {
      next = stages_.size();  // no thread begins another scene
      throw;
    }
  }

 private:
  struct Stage {
    CatalogueScene scene;
    double seconds;     ///< expected
    double part = 0.0;  ///< done
  };

  Study study(std::size_t i) {
    Stage& stage = stages_[i];
    StudyOptions options = options_;
    options.time_limit = share(stage);
    const double begin = thread_seconds();
    Study result = convergence_study(stage.scene, session_.registry, session_.solvers, options,
                                     [&](double part, const std::string& what) {
                                       show(stage, part, what);
                                       return !interrupted();
                                     });
    const std::lock_guard lock(mutex_);
    stage.part = 1.0;
    done_ += stage.seconds;
    time_ -= thread_seconds() - begin;
    return result;
  }

  double share(const Stage& stage) {
    const std::lock_guard lock(mutex_);
    return std::max(0.0, time_) * stage.seconds / std::max(all_ - done_, stage.seconds);
  }

  void show(Stage& stage, double part, const std::string& what) {
    const std::lock_guard lock(mutex_);
    stage.part = part;
    double seconds = 0.0;
    for (const Stage& each : stages_) seconds += each.part * each.seconds;
    progress_.show(all_ > 0.0 ? seconds / all_ : 0.0, what);
  }

  void wipe() {
    const std::lock_guard lock(mutex_);
    progress_.wipe();
  }

  const StudyOptions& options_;
  const Session& session_;
  std::vector<Stage> stages_;
  std::mutex mutex_;  // for the parts, the times and the line of progress
  double time_, all_ = 0.0, done_ = 0.0;
  Progress progress_;
};

constexpr std::size_t largest_study = 100'000'000;  // bytes of an earlier study.json

std::string earlier_study(const std::string& path) {
  std::string text = read_file(path, "--compare:", largest_study);
  if (text.empty()) throw Misuse(fmt::format("--compare: '{}' is empty", path));
  require_study(text);
  return text;
}

/// Before anything is computed: what would be written over something read or over another output, and a table
/// that cannot be written.
void require_files(const StudyArguments& options, const Session& session) {
  std::vector<NamedPath> inputs = inputs_of(options.scenes, session);
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
  History history = study.interrupted || !acting_events(scene).empty()
                        ? History{}
                        : record_history(scene, session.registry, session.solvers, study);
  return {study, std::move(history), scene.kind, scene.description, scene.source, time_unit(scene.notes)};
}

/// Where the report goes: --out, or a default where no scenes are named.
std::optional<OutputDirectory> report_directory(const StudyArguments& options) {
  if (!options.out.empty()) return OutputDirectory(options.out);
  if (nothing_named(options)) return OutputDirectory(default_directory);
  return {};
}

/// What the screen shows of a study: with a report the summary, since the files have the rows; else all of
/// it. On a pipe the summary has one line for each scene.
class Screen {
 public:
  Screen(const StudyArguments& options, bool with_report)
      : silent_(options.json), rows_(!with_report), terminal_(isatty(STDOUT_FILENO) == 1) {
    if (!silent_ && !rows_) print(terminal_ ? summary_head() : sundials_build() + '\n');
  }

  void show(const Study& study) const {
    if (silent_) return;
    print(rows_ ? study_table(study) + '\n' : terminal_ ? summary_rows(study) : summary_line(study));
    finish_output();
  }

 private:
  bool silent_, rows_, terminal_;
};

void tell_baselines_left_out(const CatalogueScene& entry) {
  if (!acting_events(entry).empty())
    say(fmt::format(
        "scene '{}' is run through its events ({}), by steps of one size; the baselines know none",
        entry.scene->name, acting_events(entry)));
}

void study(const StudyArguments& options, Session& session) {
  if (options.sensitivities)
    return study_gradients({options.scenes, options.set, options.end, options.out, options.json}, session);
  require_files(options, session);
  std::vector<CatalogueScene> scenes = chosen_scenes(options, session);
  for (const CatalogueScene& entry : scenes) tell_baselines_left_out(entry);
  const StudyOptions chosen = study_options(options);
  const std::string before = options.compare.empty() ? "" : earlier_study(options.compare);
  std::optional<OutputDirectory> out = report_directory(options);
  catch_interrupts();
  for (const auto& [name, value] : build_facts())
    say(fmt::format("{}: {}", name == "diracstep" ? "version" : name, value));
  const Screen screen(options, out.has_value());
  Course course(std::move(scenes), chosen, session, !nothing_named(options),
                limited(options) ? quick_time : std::numeric_limits<double>::infinity());
  std::vector<Study> studies;
  std::vector<PageEntry> page;
  course.run(options.parallel, [&](std::size_t i, Study result) {
    studies.push_back(std::move(result));
    if (tell_failures(studies.back(), options)) session.exit_status = failed;
    screen.show(studies.back());
    std::string failure;
    if (out) {
      page.push_back(page_entry(studies.back(), course.scene(i), session));
      failure = out->write(studies, page, facts_of(chosen), i + 1 == course.size() || interrupted());
    }
    if (failure.empty() && !options.table.empty()) failure = write_file(options.table, tables(studies));
    if (failure.empty()) return;
    say(failure);
    session.exit_status = failed;
  });
  if (options.json) print(studies_json(studies) + '\n');
  if (!before.empty()) say(comparison_table(compare_studies(studies, before)));
  if (out) say("the report of this study: " + out->report());
  if (!interrupted()) return;
  say("interrupted; what was finished is there");
  session.exit_status = failed;
}

}  // namespace

void add_study(CLI::App& app, Session& session) {
  CLI::App* verb =
      app.add_subcommand("study", "Error against run time, beside SUNDIALS IDA and an explicit code");
  add_solver_options(*verb, session);
  const auto options = std::make_shared<StudyArguments>();
  verb->add_option("SCENE", options->scenes,
                   "Scenes, patterns such as 'kepler*', or classes such as holonomic;\na fair selection "
                   "without any, with its report in diracstep-study/");
  verb->add_option("--scenes", options->more_scenes, "The same, as a list A,B,…");
  verb->add_option("--methods", options->methods,
                   "Methods, A,B,…; without it type1/midpoint and, where no orders are given\neither, GL(3), "
                   "GL(4), GL(6) and compositions of type1/trapezoidal");
  verb->add_option("--orders", options->orders, "Orders, 2,4,…; without it all that fit");
  verb->add_option("--steps", options->steps, "Step sizes, H1,H2,…; a ladder without it");
  verb->add_option("--rtols", options->rtols,
                   "Tolerances of the baselines; 1e-2,1e-3,1e-5,…,1e-13 without it");
  verb->add_flag("--adaptive", options->adaptive,
                 "Also reversible variable steps, with a ladder of eps (in the column of the steps)");
  verb->add_option("--ida-formulation", options->ida_formulation,
                   "How IDA is given the rows: rates, rates-loose, index-2 or velocity;\n"
                   "best: on each scene those that are fastest to 1e-3, 1e-6 or 1e-9")
      ->capture_default_str();
  verb->add_flag("--without-ida", options->without_ida, "No runs of IDA");
  verb->add_flag("--without-erk", options->without_erk, "No runs of the explicit code");
  verb->add_flag("--full", options->full,
                 "More methods, tolerances, repeats and, where none are named, scenes; no limit of time");
  verb->add_flag("--sensitivities", options->sensitivities,
                 "Instead of motions their derivatives by the start, beside forward sensitivities by IDAS;\n"
                 "takes SCENE, --end, --set, --out and --json");
  verb->add_option("--repeat", options->repeat, "Timed runs of each row; 3, and 5 with --full");
  verb->add_option(
          "--parallel", options->parallel,
          "Scenes at a time, each by a thread of its own whose CPU time is taken; 1, since threads that\n"
          "share caches and clocks slow each other")
      ->check(CLI::Range(1, most_threads));
  verb->add_option("--budget", options->budget,
                   "CPU seconds that a run of a ladder may take; 0.1, and 1 with --full");
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
  add_tolerance_option(*verb, session);
  add_set_option(*verb, options->set);
  verb->add_flag("--json", options->json, "One JSON document on standard output");
  verb->footer(
      "Examples:\n"
      "  diracstep study\n"
      "  diracstep study --full --out results\n"
      "  diracstep study knife_edge --orders 2,4 --steps 0.1,0.05,0.025 --rtols 1e-6,1e-8 --json");
  verb->callback([options, &session] { study(*options, session); });
}

}  // namespace diracstep::command
