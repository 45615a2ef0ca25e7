#include <fmt/format.h>

#include <CLI/App.hpp>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <diracstep/command/arguments.hpp>
#include <diracstep/command/interrupt.hpp>
#include <diracstep/command/progress.hpp>
#include <diracstep/command/verbs.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/reports/json.hpp>
#include <diracstep/reports/report.hpp>
#include <diracstep/sweeps/sweep_folder.hpp>
#include <memory>
#include <optional>

namespace diracstep::command {

namespace {

struct SweepArguments {
  std::string file, out, part;
  int threads = 0;
  bool json = false;
};

struct Part {
  long number = 1, of = 1;
};

std::optional<long> whole_number(std::string_view text) {
  long value = 0;
  const auto read = std::from_chars(text.data(), text.data() + text.size(), value);
  if (read.ec != std::errc() || read.ptr != text.data() + text.size()) return std::nullopt;
  return value;
}

std::optional<long> environment_number(const char* name) {
  const char* text = std::getenv(name);
  return text == nullptr ? std::nullopt : whole_number(text);
}

/// "3/8"; without it, the place of this task in an array of Slurm's, whose numbers may begin anywhere and
/// have gaps of one size.
Part part_of(const std::string& text) {
  if (text.empty()) {
    const auto id = environment_number("SLURM_ARRAY_TASK_ID"),
               least = environment_number("SLURM_ARRAY_TASK_MIN"),
               count = environment_number("SLURM_ARRAY_TASK_COUNT"),
               step = environment_number("SLURM_ARRAY_TASK_STEP");
    if (!id || !count) return {};
    return {(*id - least.value_or(0)) / std::max(1L, step.value_or(1)) + 1, *count};
  }
  const std::size_t slash = text.find('/');
  if (slash != std::string::npos) {
    const auto number = whole_number(std::string_view(text).substr(0, slash)),
               of = whole_number(std::string_view(text).substr(slash + 1));
    if (number && of && *number >= 1 && *number <= *of) return {*number, *of};
  }
  throw Misuse(fmt::format("--part {}: expected K/N with 1 <= K <= N, as in 3/8", text));
}

std::string as_text(const SweepReport& report, const Sweep& sweep, const std::string& folder) {
  std::string text =
      fmt::format("{}: {} members of {}, {} in finished blocks, {} run here, method {}\n", sweep.file,
                  report.members, sweep.scene, report.done, report.run_here, report.method);
  if (!report.merged_here) return text;
  text += fmt::format("ok {}, doubted {}, failed {}\n", report.ok, report.doubted, report.failed);
  for (const std::string& reason : report.reasons) text += "  " + reason + '\n';
  std::vector<std::vector<std::string>> rows{{"recorded", "least", "mean", "most"}};
  for (const SweepColumn& column : report.columns)
    rows.push_back({column.name, fmt::format("{:.6g}", column.least), fmt::format("{:.6g}", column.mean),
                    fmt::format("{:.6g}", column.most)});
  return text + '\n' + aligned(rows) +
         fmt::format("\nresults: {0}/results.csv, {0}/results.npy, {0}/report.html\n", folder);
}

std::string as_json(const SweepReport& report, const std::string& folder) {
  Json json{{"members", report.members}, {"done", report.done},       {"run_here", report.run_here},
            {"block", report.block},     {"method", report.method},   {"complete", report.complete},
            {"ok", report.ok},           {"doubted", report.doubted}, {"failed", report.failed},
            {"reasons", report.reasons}, {"folder", folder}};
  json["columns"] = Json::object();
  for (const SweepColumn& column : report.columns)
    add_member(
        json["columns"], column.name,
        Json{{"count", column.count}, {"least", column.least}, {"mean", column.mean}, {"most", column.most}});
  return to_text(json, 2) + '\n';
}

/// The sweep by all processes; the first one reports, once all have ended their blocks.
template <class Run>
SweepReport shared(SweepOptions& options, const Processes& processes, const Run& run) {
  if (processes.count > 1 && options.parts > 1)
    throw Misuse("--part does not go with mpirun, whose processes share the blocks by themselves");
  Progress progress;
  if (processes.number == 0)
    options.progress = [&](double done, const std::string& what) { progress.show(done, what); };
  if (processes.count == 1) return run();
  options.next_block = processes.draw;
  const long here = run().run_here;
  processes.meet();
  if (processes.number > 0) return {};
  options.next_block = nullptr;
  SweepReport report = run();
  report.run_here += here;
  return report;
}

void sweep(const SweepArguments& arguments, Session& session) {
  const Sweep wanted = read_sweep(arguments.file);
  SweepOptions options;
  options.folder = arguments.out;
  const Part part = part_of(arguments.part);
  options.part = part.number;
  options.parts = part.of;
  options.threads = arguments.threads;
  options.goes_on = [] { return !interrupted(); };
  catch_interrupts();
  const auto scene = scene_maker(session, wanted.scene);
  const SweepReport report = shared(options, session.processes, [&] {
    return run_sweep(wanted, scene, session.registry, session.solvers, options);
  });
  if (session.processes.number > 0) return;
  for (const std::string& message : report.messages) say(message);
  print(arguments.json ? as_json(report, arguments.out) : as_text(report, wanted, arguments.out));
  if (interrupted()) {
    say(fmt::format("{}: finished blocks are kept, the same command goes on", interruption()));
    session.exit_status = failed;
  } else if (!report.complete) {
    say(fmt::format(
        "{} members are left to other parts; the results are gathered by the one that ends last, or "
        "by the same command again",
        report.members - report.done));
  } else if (report.failed == report.members) {
    session.exit_status = failed;
  }
}

}  // namespace

void add_sweep(CLI::App& app, Session& session) {
  CLI::App* verb =
      app.add_subcommand("sweep", "One scene for many parameters and starts, on any number of processes");
  const auto options = std::make_shared<SweepArguments>();
  verb->add_option("FILE", options->file, "The sweep, a TOML file: scene, what varies, what is recorded")
      ->required();
  verb->add_option("--out", options->out, "Folder for the results; blocks that are finished there are kept")
      ->required();
  verb->add_option(
      "--part", options->part,
      "K/N: of N processes that share the folder this is number K; default: the place in an array of "
      "Slurm tasks, else all");
  verb->add_option("--threads", options->threads, "0: one for each processor");
  verb->add_flag("--json", options->json, "One JSON document on standard output");
  add_redundancy_option(*verb, session);
  add_tolerance_option(*verb, session);
  add_solver_options(*verb, session);
  verb->footer(
      "Examples:\n"
      "  diracstep sweep pendulums.toml --out pendulums\n"
      "  parallel diracstep sweep pendulums.toml --out pendulums --threads 1 --part {}/8 ::: 1 2 3 4 5 6 7 "
      "8");
  verb->callback([options, &session] { sweep(*options, session); });
}

}  // namespace diracstep::command
