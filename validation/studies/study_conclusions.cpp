#include <algorithm>
#include <cmath>
#include <diracstep/validation/studies/convergence_study.hpp>
#include <diracstep/validation/studies/work_precision.hpp>
#include <optional>
#include <vector>

namespace diracstep {

namespace {

constexpr double smallest_error = 1e-17;  // an error of zero has no logarithm

/// The runs of a method at an order; an error below the reference's own counts as that.
std::vector<WorkPoint> points(const Study& study, const std::string& method, int order) {
  const double smallest =
      std::isfinite(study.reference_error) ? std::max(study.reference_error, smallest_error) : smallest_error;
  std::vector<WorkPoint> found;
  for (const StudyRow& row : study.rows)
    if (row.ok() && row.method == method && row.order == order)
      found.push_back({row.step, std::max(row.error(), smallest), row.cpu_seconds.median});
  return found;
}

/// Those that show an order: well above the error of the reference.
std::vector<WorkPoint> telling_points(const Study& study, const std::string& method, int order) {
  std::vector<WorkPoint> found = points(study, method, order);
  if (std::isfinite(study.reference_error))
    std::erase_if(found,
                  [&](const WorkPoint& p) { return p.error < near_the_reference * study.reference_error; });
  return found;
}

}  // namespace

void conclude(Study& study) {
  for (MeasuredOrder& measured : study.measured_orders) {
    const auto fit = measure_order(telling_points(study, measured.method, measured.order));
    measured.slope = fit ? std::optional(fit->slope) : std::nullopt;
    measured.points = fit ? fit->points : 0;
  }
  study.at_error.clear();
  const std::vector<WorkPoint> ida = points(study, ida_method, 0), erk = points(study, erk_method, 0);
  for (const double error : compared_errors) {
    const std::size_t first = study.at_error.size();
    const auto ida_seconds = cpu_seconds_within(ida, error), erk_seconds = cpu_seconds_within(erk, error);
    std::optional<std::size_t> best;
    for (const MeasuredOrder& ours : study.measured_orders) {
      AtError at{.error = error,
                 .method = ours.method,
                 .order = ours.order,
                 .ida_cpu_seconds = ida_seconds,
                 .erk_cpu_seconds = erk_seconds};
      at.cpu_seconds = cpu_seconds_within(points(study, ours.method, ours.order), error);
      if (at.cpu_seconds && ida_seconds) at.ratio = *ida_seconds / *at.cpu_seconds;
      if (at.cpu_seconds && erk_seconds) at.erk_ratio = *erk_seconds / *at.cpu_seconds;
      study.at_error.push_back(at);
      if (at.cpu_seconds && (!best || *at.cpu_seconds < *study.at_error[*best].cpu_seconds))
        best = study.at_error.size() - 1;
    }
    if (best) {
      study.at_error[*best].best = true;
      std::rotate(study.at_error.begin() + static_cast<std::ptrdiff_t>(first),
                  study.at_error.begin() + static_cast<std::ptrdiff_t>(*best),
                  study.at_error.begin() + static_cast<std::ptrdiff_t>(*best) + 1);
    }
  }
}

bool confirms_order(const MeasuredOrder& measured, double tolerance) {
  return measured.slope && std::abs(*measured.slope - measured.order) <= tolerance;
}

}  // namespace diracstep
