#include <fmt/format.h>

#include <CLI/App.hpp>
#include <algorithm>
#include <cerrno>
#include <cstring>
#include <diracstep/core/errors.hpp>
#include <diracstep/validation/command/arguments.hpp>
#include <diracstep/validation/command/interrupt.hpp>
#include <diracstep/validation/command/verbs.hpp>
#include <diracstep/validation/plot.hpp>
#include <diracstep/validation/progress.hpp>
#include <diracstep/validation/report.hpp>
#include <filesystem>
#include <memory>
#include <optional>

namespace diracstep::command {

namespace {

/// What a study without scenes runs: one of each constraint class with a closed form.
const std::vector<std::string> published_scenes{"kepler_e06", "pendulum_cartesian", "knife_edge",
                                                "nonholonomic_particle_free"};

struct Options {
  std::vector<std::string> scenes;
  std::optional<std::string> methods;
  std::optional<std::string> orders, steps, rtols;
  bool without_ida = false;
  bool adaptive = false;
  int repeat = 5;
  double budget = 1.0;
  std::optional<double> end;
  std::string momentum = "projected";
  std::string out;
  std::vector<std::string> set;
  bool json = false;
};

/// Replaces a file; what went wrong, or empty.
std::string write_file(const std::filesystem::path& path, const std::string& text) {
  std::FILE* file = std::fopen(path.c_str(), "w");
  if (file == nullptr) return fmt::format("'{}' cannot be written: {}", path.string(), std::strerror(errno));
  const bool written =
      std::fwrite(text.data(), 1, text.size(), file) == text.size() && std::fflush(file) == 0;
  const int error = errno;
  if (std::fclose(file) == 0 && written) return {};
  return fmt::format("'{}' could not be written in full: {}", path.string(),
                     std::strerror(written ? errno : error));
}

/// The directory of --out: study.csv, study.json and the pictures, renewed after each scene.
class OutputDirectory {
 public:
  explicit OutputDirectory(const std::string& path) : path_(path) {
    std::error_code error;
    std::filesystem::create_directories(path_, error);
    if (error) throw Misuse(fmt::format("--out: '{}' cannot be made: {}", path, error.message()));
    if (const auto failure = write_tables({}); !failure.empty()) throw Misuse("--out: " + failure);
  }

  /// Empty, or what could not be written.
  std::string write(const std::vector<Study>& studies) const {
    const std::string failure = write_tables(studies);
    if (const auto no_picture = draw_work_precision(studies.back(), path_); !no_picture.empty())
      say(no_picture);
    return failure;
  }

 private:
  std::string write_tables(const std::vector<Study>& studies) const {
    const std::string csv = write_file(path_ / "study.csv", studies_csv(studies));
    const std::string json = write_file(path_ / "study.json", studies_json(studies) + '\n');
    return csv.empty() ? json : csv;
  }

  std::filesystem::path path_;
};

StudyOptions study_options(const Options& options) {
  StudyOptions study;
  if (options.methods)
    study.methods = names("--methods", *options.methods);
  else if (!options.orders)
    study.methods = {"type1/midpoint", "type1/gl:3", "type1/gl:4", "type1/gl:6"};
  if (options.orders) study.orders = whole_numbers("--orders", *options.orders);
  if (options.steps) study.steps = numbers("--steps", *options.steps);
  if (options.rtols) study.rtols = numbers("--rtols", *options.rtols);
  if (options.without_ida) study.rtols.clear();
  study.adaptive = options.adaptive;
  study.repeats = options.repeat;
  study.run_budget = options.budget;
  study.t_end = options.end;
  study.momentum = momentum(options.momentum);
  return study;
}

std::string label(const StudyRow& row) {
  if (row.is_ida()) return fmt::format("IDA, rtol {:g}", row.rtol);
  const std::string step = row.fits() ? fmt::format(", step {:g}", row.step) : "";
  return fmt::format("{} order {}{}", row.method, row.order, step);
}

/// Whether a failed row is a failure of the study.  It is where the user chose the step or the tolerance; on
/// a ladder, which looks for the largest possible step, only where no other row of the same kind succeeded.
bool counts(const StudyRow& failed_row, const Study& study, const Options& options) {
  const bool chosen = (failed_row.is_ida() ? options.rtols : options.steps).has_value();
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

std::vector<CatalogueScene> chosen_scenes(const Options& options) {
  std::vector<CatalogueScene> scenes;
  const Parameters changes = parameters(options.set);
  for (const auto& scene : options.scenes.empty() ? published_scenes : options.scenes)
    scenes.push_back(make_scene(scene, changes));
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

void study(const Options& options, Session& session) {
  const std::vector<CatalogueScene> scenes = chosen_scenes(options);
  const StudyOptions chosen = study_options(options);
  std::optional<OutputDirectory> out;
  if (!options.out.empty()) out.emplace(options.out);
  std::vector<Study> studies;
  for (const CatalogueScene& scene : scenes) {
    if (interrupted()) break;
    studies.push_back(one_study(scene, chosen, session, studies.size() + 1, scenes.size()));
    if (tell_failures(studies.back(), options)) session.exit_status = failed;
    if (!options.json) print(study_table(studies.back()) + '\n');
    const std::string failure = out ? out->write(studies) : "";
    if (failure.empty()) continue;
    say(failure);
    session.exit_status = failed;
  }
  if (options.json) print(studies_json(studies) + '\n');
  if (!interrupted()) return;
  say("interrupted; what was finished is there");
  session.exit_status = failed;
}

}  // namespace

void add_study(CLI::App& app, Session& session) {
  CLI::App* verb = app.add_subcommand("study", "Error against run time, with SUNDIALS IDA beside it");
  const auto options = std::make_shared<Options>();
  verb->add_option("SCENE", options->scenes, "Scenes, all without any; see diracstep list scenes");
  verb->add_option(
      "--methods", options->methods,
      "Methods, A,B,…; without it type1/midpoint,\nand GL(3), GL(4), GL(6) where no orders are given either");
  verb->add_option("--orders", options->orders, "Orders, 2,4,…; without it all that fit");
  verb->add_option("--steps", options->steps, "Step sizes, H1,H2,…; a ladder without it");
  verb->add_option("--rtols", options->rtols, "Tolerances of IDA; 1e-4,1e-5,…,1e-12 without it");
  verb->add_flag("--adaptive", options->adaptive,
                 "Also reversible variable steps, with a ladder of eps (in the column of the steps)");
  verb->add_flag("--without-ida", options->without_ida, "No runs of IDA");
  verb->add_option("--repeat", options->repeat, "Timed runs of each row")->capture_default_str();
  verb->add_option("--budget", options->budget, "CPU seconds that a run of a ladder may take")
      ->capture_default_str();
  verb->add_option("--end", options->end, "End time; the scene's own without it");
  verb->add_option("--momentum", options->momentum,
                   "Representative of the momentum: plus, minus or projected")
      ->capture_default_str();
  verb->add_option("--out", options->out, "Directory for study.csv, study.json, SCENE.svg and SCENE.png")
      ->type_name("DIR");
  verb->add_option("--set", options->set, "Set a parameter of the scenes; may be repeated")
      ->type_name("NAME=VALUE")
      ->allow_extra_args(false);
  verb->add_flag("--json", options->json, "One JSON document on standard output");
  verb->footer(
      "Examples:\n"
      "  diracstep study --out results\n"
      "  diracstep study knife_edge --orders 2,4 --steps 0.1,0.05,0.025 --rtols 1e-6,1e-8 --json");
  verb->callback([options, &session] { study(*options, session); });
}

}  // namespace diracstep::command
