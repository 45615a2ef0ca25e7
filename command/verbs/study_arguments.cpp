#include <fmt/format.h>

#include <algorithm>
#include <diracstep/command/arguments.hpp>
#include <diracstep/command/verbs/study_arguments.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <utility>

namespace diracstep::command {

namespace {

using Series = std::vector<std::pair<std::string, int>>;
const Series quick_series{{"type1/gl:3", 6},
                          {"type1/gl:4", 8},
                          {"type1/gl:6", 12},
                          {"type1/trapezoidal", 4},
                          {"type1/trapezoidal", 8}};
const Series full_series{{"type1/midpoint", 2},     {"type1/midpoint", 4},    {"type1/midpoint", 8},
                         {"type1/trapezoidal", 4},  {"type1/trapezoidal", 6}, {"type1/trapezoidal", 8},
                         {"type1/trapezoidal", 10}, {"type1/gl:2", 4},        {"type1/gl:3", 6},
                         {"type1/gl:4", 8},         {"type1/gl:5", 10},       {"type1/gl:6", 12}};
const std::vector<double> quick_rtols{1e-2, 1e-3, 1e-5, 1e-7, 1e-9, 1e-11, 1e-13};
constexpr int quick_repeats = 3, full_repeats = 5;
constexpr double quick_budget = 0.1, full_budget = 1.0;         // CPU seconds of a run
constexpr double quick_reference = 1.5, full_reference = 30.0;  // CPU seconds

std::optional<DaeFormulation> formulation(const std::string& given) {
  if (given == best_formulation) return {};
  std::string allowed = best_formulation;
  for (const DaeFormulation known : all_formulations) {
    if (given == name(known)) return known;
    allowed += std::string(", ") + name(known);
  }
  throw Misuse(fmt::format("--ida-formulation '{}' is not known; allowed are {}", given, allowed));
}

constexpr const char* formulations =
    "rates: multipliers as derivatives, φ = 0 beside A v + b = 0 (Gear, Gupta, Leimkuhler), index 1; "
    "rates-loose: the same without a tolerance on the multipliers; index-2: the multipliers themselves, "
    "without a tolerance; velocity: as rates with A v + b = 0 alone, so that φ drifts";

}  // namespace

bool limited(const StudyArguments& options) {
  return !options.full && !options.steps && !options.rtols && !options.budget;
}

StudyOptions study_options(const StudyArguments& options) {
  StudyOptions study;
  if (options.methods)
    study.methods = names("--methods", *options.methods);
  else if (!options.orders)
    study.series = options.full ? full_series : quick_series;
  if (!options.full) study.rtols = quick_rtols;
  if (options.orders) study.orders = whole_numbers("--orders", *options.orders);
  if (options.steps) study.steps = numbers("--steps", *options.steps);
  if (options.rtols) study.rtols = numbers("--rtols", *options.rtols);
  if (options.without_ida) std::erase(study.baselines, ida_method);
  if (options.without_erk) std::erase(study.baselines, erk_method);
  study.ida_formulation = formulation(options.ida_formulation);
  study.adaptive = options.adaptive;
  study.repeats = options.repeat.value_or(options.full ? full_repeats : quick_repeats);
  study.run_budget = options.budget.value_or(options.full ? full_budget : quick_budget);
  if (limited(options)) study.smallest_error = 0.5 * compared_errors.back();
  study.reference_budget = options.full ? full_reference : quick_reference;
  study.t_end = options.end;
  study.momentum = momentum(options.momentum);
  return study;
}

bool nothing_named(const StudyArguments& options) {
  return options.scenes.empty() && options.more_scenes.empty();
}

PageFacts facts_of(const StudyOptions& study) {
  PageFacts facts;
  if (study.series.empty()) {
    facts.emplace_back("methods", fmt::format("{}", fmt::join(study.methods, ", ")));
    facts.emplace_back(
        "orders", study.orders.empty() ? "all that fit" : fmt::format("{}", fmt::join(study.orders, ", ")));
  } else {
    std::vector<std::string> names;
    for (const auto& [method, order] : study.series)
      names.push_back(fmt::format("{} order {}", method, order));
    facts.emplace_back("methods", fmt::format("{}", fmt::join(names, ", ")));
  }
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
  facts.emplace_back("time", "the ladders share the time of a quick study; --full has no limit");
  facts.emplace_back("momentum", name(study.momentum));
  return facts;
}

}  // namespace diracstep::command
