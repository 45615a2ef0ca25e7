#include <fmt/format.h>

#include <CLI/App.hpp>
#include <diracstep/boundary_values/named_ends.hpp>
#include <diracstep/command/arguments.hpp>
#include <diracstep/command/motion_search.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/files/output_file.hpp>
#include <diracstep/reports/report.hpp>
#include <diracstep/scene_format/position_names.hpp>

namespace diracstep::command {

void add_search_options(CLI::App& verb, Session& session, MotionSearchArguments& arguments) {
  add_solver_options(verb, session);
  add_redundancy_option(verb, session);
  add_method_options(verb, arguments.method);
  verb.add_option("--end", arguments.end, "Time of the end; the scene's own without it");
  verb.add_option("--step", arguments.step, "Step size; the scene's own without it");
  add_set_option(verb, arguments.set);
  verb.add_flag("--json", arguments.json, "One JSON document on standard output");
}

CatalogueScene searched_scene(MotionSearchArguments& arguments, Session& session, const std::string& verb) {
  std::vector<NamedPath> inputs = inputs_of({arguments.scene}, session);
  if (!arguments.guess.empty()) inputs.push_back({"--guess", arguments.guess});
  if (!arguments.out.empty()) require_outputs({{"--out", arguments.out}}, inputs);
  CatalogueScene entry = make_scene(session, arguments.scene, parameters(arguments.set));
  require_flat(*entry.scene, verb);
  if (!entry.events.empty())
    throw Misuse(verb + " does not go with the events of the scene: when one is met is not known before");
  take_recommendation(entry, arguments.method, arguments.step);
  return entry;
}

StepGrid searched_steps(const MotionSearchArguments& arguments, const CatalogueScene& entry) {
  return fit_steps(entry.scene->start.time, arguments.end.value_or(entry.t_end),
                   arguments.step.value_or(entry.natural_step));
}

std::string first_line(const Scene& scene, const Vector& times, long steps, const std::string& method,
                       int iterations) {
  return fmt::format("{} from t = {:g} to {:g}: {} steps with {}, {} iterations", scene.name, times[0],
                     times[times.size() - 1], steps, method, iterations);
}

void write_motion(const std::string& path, const Scene& scene, const FoundMotion& motion,
                  const std::vector<std::string>& further,
                  const std::function<Vector(Eigen::Index k)>& values) {
  std::string text = "t";
  for (const std::string& name : names_at_an_end(scene)) text += "," + csv_field(name);
  for (const std::string& name : further) text += "," + csv_field(name);
  text += '\n';
  for (Eigen::Index k = 0; k < motion.times.size(); ++k) {
    text += fmt::format("{:.17g}", motion.times[k]);
    for (const Columns* of : {&motion.q, &motion.v, &motion.p})
      for (const double value : of->col(k)) text += fmt::format(",{:.17g}", value);
    if (values)
      for (const double value : values(k)) text += fmt::format(",{:.17g}", value);
    text += '\n';
  }
  OutputFile file(path, OutputFile::Mode::fresh);
  file.write(text);
  file.close();
}

}  // namespace diracstep::command
