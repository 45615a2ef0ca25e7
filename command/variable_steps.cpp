#include <fmt/format.h>

#include <cmath>
#include <diracstep/command/variable_steps.hpp>
#include <diracstep/reports/report.hpp>
#include <utility>

namespace diracstep::command {

namespace {

std::string short_number(double value) { return std::isnan(value) ? "" : fmt::format("{:.2e}", value); }

}  // namespace

std::string summary(const VariableSteps& steps) {
  const ControlReport& report = steps.report;
  if (steps.control == StepControl::local_error)
    return fmt::format(
        "variable steps: local error {:g}, sizes {:.3g} to {:.3g}, each of two halves, {} refused, {} side "
        "steps for output\n",
        steps.eps, report.smallest_step, report.largest_step, report.refused, report.side_steps);
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

}  // namespace diracstep::command
