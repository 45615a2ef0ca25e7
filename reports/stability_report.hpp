#pragma once

#include <diracstep/validation/studies/stability_study.hpp>
#include <filesystem>
#include <string>
#include <vector>

namespace diracstep {

/// Linear stability as a table for a terminal.
std::string linear_stability_table(const std::vector<LinearStability>& linear);

/// One case with every method, and IDA below, as a table for a terminal.
std::string stability_table(const StabilityResult& result);

/// {"growth_tolerance": …, "linear": […], "cases": […]}; a number that does not apply or is not finite is
/// null.
///
///   linear[]  method, order, oscillator_limit (hω), damping_limit (hγ), growth[]: step, oscillator, damping
///   cases[]   group, value, case, scene, parameters{}, step, t_end, accuracy, reference (how it is known, or
///             null), rows[], ida[]
///     rows[]  method, order, outcome ("accurate", "bounded", "doubted", "stopped", "refused", "wrong"),
///     message, steps,
///             t_reached, watches[]: name, band, drift, drift_half_width, bounded_until; constraint, error,
///             failed_solves, newton_iterations, cpu_seconds, ida (as in ida[], at this cost, or null)
///     ida[]   rtol, status, error, deviation, constraint, cpu_seconds
std::string stability_json(const std::vector<LinearStability>& linear,
                           const std::vector<StabilityResult>& results);

/// Three Markdown tables: the linear limits; every outcome, a line for a case and a column for a method; and
/// the numbers of the best method of each case, with IDA at its cost.
std::string stability_markdown(const std::vector<LinearStability>& linear,
                               const std::vector<StabilityResult>& results);

/// Writes pictures with gnuplot: growth over hω and hγ, and for each group of at least three cases the error
/// at the end (where it has no reference the band of the first watch) over its number.  Empty, or what went
/// wrong.
std::string draw_linear_stability(const std::vector<LinearStability>& linear,
                                  const std::filesystem::path& directory);
std::string draw_stability(const std::vector<StabilityResult>& results,
                           const std::filesystem::path& directory);

}  // namespace diracstep
