#include <fmt/format.h>
#include <unistd.h>

#include <array>
#include <cmath>
#include <diracstep/command/files/written_file.hpp>
#include <diracstep/command/gradient_study.hpp>
#include <diracstep/command/interrupt.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/files/csv_table.hpp>
#include <diracstep/files/input_file.hpp>
#include <diracstep/files/temporary_folder.hpp>
#include <diracstep/reports/json.hpp>
#include <diracstep/reports/plot.hpp>
#include <diracstep/reports/report.hpp>
#include <diracstep/scene_format/loader/compiler_process.hpp>
#include <filesystem>
#include <optional>
#include <string_view>

namespace diracstep::command {

namespace {

constexpr double most_gradient_seconds = 3600.0;
constexpr std::size_t most_gradient_bytes = 1'000'000;

std::string program_for_gradients() {
  std::error_code failed;
  const auto own = std::filesystem::read_symlink("/proc/self/exe", failed).parent_path();
  for (const auto& folder : {own, own / ".." / "bin"})
    if (const auto program = folder / "diracstep-gradients"; access(program.c_str(), X_OK) == 0)
      return program.string();
  throw Misuse(
      "--sensitivities: the program diracstep-gradients is not beside this one: it is built where SUNDIALS "
      "has "
      "IDAS");
}

/// After an interrupt those that were computed, nothing where there are none.
std::optional<CsvTable> gradients_of(const std::string& program, const GradientStudy& study,
                                     const std::string& scene, const TemporaryFolder& directory) {
  const std::string file = directory.file("gradients.csv"), messages = directory.file("messages");
  std::vector<std::string> words{program, file, scene, fmt::format("{:.17g}", study.end.value_or(0.0))};
  words.insert(words.end(), study.set.begin(), study.set.end());
  std::filesystem::remove(file);
  const ProcessEnd end = run_process(words, messages, most_gradient_seconds, [] { return !interrupted(); });
  if (interrupted()) {
    constexpr std::string_view head = "side,setting,seconds,error\n";
    std::error_code missing;
    const auto size = std::filesystem::file_size(file, missing);
    if (missing || size <= head.size()) return std::nullopt;
  } else if (end.kind != ProcessEnd::Kind::exited || end.status != 0) {
    std::string why =
        end.kind == ProcessEnd::Kind::out_of_time ? "out of time" : read_file(messages, "messages", 10'000);
    while (!why.empty() && why.back() == '\n') why.pop_back();
    throw Error(fmt::format("gradients of '{}': {}", scene, why));
  }
  return read_csv(file, "gradients", most_gradient_bytes, 4, EmptyFields::missing);
}

std::string side_name(double side) {
  if (side == 0.0) return "IDAS, at once with the motion";
  if (side == 1.0) return "IDAS, behind the motion";
  return fmt::format("type1/gl:{:g}", side);
}

std::string gradient_table(const CsvTable& table) {
  std::vector<std::vector<std::string>> rows{{"", "tolerance, steps", "CPU ms", "error"}};
  for (const auto& line : table.lines)
    rows.push_back({side_name(line[0]), fmt::format("{:g}", line[1]),
                    std::isnan(line[2]) ? "failed" : fmt::format("{:.2f}", 1e3 * line[2]),
                    std::isnan(line[3]) ? "" : fmt::format("{:.1e}", line[3])});
  return aligned(rows);
}

Json gradient_json(const CsvTable& table, const std::string& scene) {
  Json json{{"scene", scene}, {"runs", Json::array()}};
  for (const auto& line : table.lines) {
    Json run{{"side", side_name(line[0])}};
    run[line[0] < 2.0 ? "tolerance" : "steps"] = line[1];
    run["seconds"] = Json(line[2]);
    run["error"] = Json(line[3]);
    json["runs"].push_back(std::move(run));
  }
  return json;
}

/// Error over processor time, a line for each side.
std::string draw_gradients(const CsvTable& table, const std::string& scene, const std::string& stem) {
  std::string script = fmt::format(
      "set title {}\nset logscale xy\nset format '10^{{%T}}'\nset grid\nset key outside\n"
      "set xlabel 'CPU time, s'\nset ylabel 'error of the gradient'\n",
      gnuplot_text(scene));
  std::string curves;
  for (const double side : {0.0, 1.0, 2.0, 3.0, 4.0}) {
    script += fmt::format("$side{:g} << EOD\n", side);
    for (const auto& line : table.lines)
      if (line[0] == side && line[2] > 0.0 && line[3] > 0.0)
        script += fmt::format("{:.17g} {:.17g}\n", line[2], line[3]);
    script += "EOD\n";
    curves += fmt::format("{} $side{:g} using 1:2 with linespoints title {}", curves.empty() ? "plot" : ",",
                          side, gnuplot_text(side_name(side)));
  }
  return render(script + curves + '\n', stem, 700, 450);
}

}  // namespace

void study_gradients(const GradientStudy& study, Session& session) {
  const std::string program = program_for_gradients();
  std::vector<std::string> scenes = study.scenes;
  if (scenes.empty()) scenes = {"kepler_e06", "chaplygin_sleigh", "pendulum_cartesian", "double_pendulum"};
  const std::filesystem::path out = study.out.empty() ? std::filesystem::path{} : output_directory(study.out);
  const TemporaryFolder directory("gradients");
  Json all = Json::array();
  catch_interrupts();
  for (const std::string& scene : scenes) {
    const std::optional<CsvTable> gradients = gradients_of(program, study, scene, directory);
    if (!gradients) break;
    const CsvTable& table = *gradients;
    const std::string name = file_name(std::filesystem::path(scene).stem().string());
    if (study.json)
      all.push_back(gradient_json(table, scene));
    else
      print(fmt::format("{}: derivatives of the end by the start\n{}\n", scene, gradient_table(table)));
    if (out.empty()) continue;
    const std::string stem = (out / ("gradients_" + name)).string();
    std::filesystem::copy_file(directory.file("gradients.csv"), stem + ".csv",
                               std::filesystem::copy_options::overwrite_existing);
    if (const std::string failure = draw_gradients(table, scene, stem); !failure.empty()) {
      say(failure);
      session.exit_status = failed;
    }
    if (interrupted()) break;
  }
  if (study.json) print(to_text(all, 2) + '\n');
  if (!interrupted()) return;
  say("interrupted; what was finished is there");
  session.exit_status = failed;
}

}  // namespace diracstep::command
