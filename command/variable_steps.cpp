#include <fmt/format.h>

#include <array>
#include <cmath>
#include <diracstep/command/variable_steps.hpp>
#include <diracstep/core/adaptive/rate_survey.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/reports/report.hpp>
#include <utility>

namespace diracstep::command {

namespace {

constexpr std::array<std::pair<const char*, StepControl>, 3> controls{
    {{"integrating", StepControl::integrating},
     {"in-step", StepControl::in_step},
     {"irreversible", StepControl::irreversible}}};

constexpr long plan_survey_steps = 2000;

std::string short_number(double value) { return std::isnan(value) ? "" : fmt::format("{:.2e}", value); }

}  // namespace

StepControl step_control(const std::string& text) {
  for (const auto& [name, control] : controls)
    if (text == name) return control;
  throw Misuse(fmt::format("--control: '{}' is not one of integrating, in-step, irreversible", text));
}

const char* name(StepControl control) {
  for (const auto& [name, value] : controls)
    if (control == value) return name;
  return "";
}

std::string summary(const VariableSteps& steps) {
  const ControlReport& report = steps.report;
  return fmt::format(
      "variable steps: eps {:g}, {} control, sizes {:.3g} to {:.3g}, {} resets, {} side steps for output, {} "
      "accelerations\n",
      steps.eps, name(steps.control), report.smallest_step, report.largest_step, report.resets,
      report.side_steps, report.accelerations);
}

std::string warning(const VariableSteps& steps, long taken) {
  if (steps.report.resets * 1000 <= taken) return {};
  return fmt::format(
      "the step controller was reset {} times in {} steps, which breaks its reversibility; take a smaller "
      "--eps "
      "or --control in-step",
      steps.report.resets, taken);
}

std::string search_table(const ErrorControlReport& search) {
  std::vector<std::vector<std::string>> rows{
      {search.adaptive ? "eps" : "step", "steps", "solves", "difference", "estimate", "order", ""}};
  for (const ErrorControlRun& run : search.runs)
    rows.push_back({fmt::format("{:.4g}", run.step), std::to_string(run.steps), std::to_string(run.solves),
                    short_number(run.difference), short_number(run.estimate),
                    std::isnan(run.observed_order) ? "" : fmt::format("{:.1f}", run.observed_order),
                    run.failure});
  std::string head = fmt::format("{} steps with {}, order {}", search.adaptive ? "variable" : "fixed",
                                 search.method, search.order);
  for (const std::string& reason : {search.method_reason, search.reason})
    if (!reason.empty()) head += "; " + reason;
  return fmt::format("{}\n{}", head, aligned(rows));
}

PlanLine rate_line(const Scene& given, const SolverFactory& solvers, double end) {
  const auto scene = completed(std::make_shared<const Scene>(given));
  if (!has_accelerations(*scene))
    return {"variable steps", "not offered", "L is linear in v: no accelerations to choose them by"};
  const RateSurvey survey = survey_rate(*scene, solvers, end, plan_survey_steps);
  if (!survey.failure.empty()) return {"variable steps", "not known", survey.failure};
  const std::string reason =
      fmt::format("max ω / min ω = {:.2g} over the first {:.3g} of {:.3g} units of time", survey.ratio(),
                  survey.covered, std::abs(end - scene->start.time));
  if (survey.variable_steps_pay()) return {"variable steps", "pay: --adaptive", reason};
  return {"variable steps", "left out", reason + ", they pay above 5"};
}

}  // namespace diracstep::command
