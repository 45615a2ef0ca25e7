#pragma once

#include <diracstep/core/numerics/types.hpp>
#include <optional>
#include <vector>

namespace diracstep {

/// Errors above it are never taken for round-off.
inline constexpr double plateau_ceiling = 1e-6;

/// One run: its step or tolerance, its error and its CPU time.
struct WorkPoint {
  double step = 0.0;
  double error = 0.0;
  double cpu_seconds = 0.0;
};

/// ‖value − reference‖∞ / ‖reference‖∞.  The reference is zero where it is below 1e-14 of the size that is
/// natural where it comes from, as the momentum of a body at rest in a closed form: then in parts of that.
double relative_error(ConstVectorRef value, ConstVectorRef reference, double natural = 1.0);

/// An order as measured: the slope of log(error) over log(step), and the number of points it rests on.
struct OrderFit {
  double slope;
  int points;
};

/// Least squares over the asymptotic points; empty where there are fewer than three.  A point counts when
///
///   * its error is below 1e-2 (coarser ones are pre-asymptotic), and
///   * it lies above round-off: above 1e-11, or above 30 times the smallest error reached.
///     Where the ladder shows a plateau (an error below plateau_ceiling that a refinement lowers by less than
///     the square root of the step ratio) only the second part holds, for the points before it;
///
/// of these the finest four are taken.
std::optional<OrderFit> measure_order(std::vector<WorkPoint> points);

/// The points that no other one beats in both error and time, by growing time, so with falling errors.
std::vector<WorkPoint> lower_envelope(std::vector<WorkPoint> points);

/// CPU time at which the lower envelope reaches an error, by log–log interpolation between its points.  Empty
/// where the envelope does not reach the error, or starts below it: nothing is extrapolated.
std::optional<double> cpu_seconds_at(const std::vector<WorkPoint>& points, double error);

/// The same, but where the cheapest point is below the error already its time: an upper bound.
std::optional<double> cpu_seconds_within(const std::vector<WorkPoint>& points, double error);

}  // namespace diracstep
