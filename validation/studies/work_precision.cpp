#include <algorithm>
#include <cmath>
#include <diracstep/validation/studies/work_precision.hpp>
#include <limits>

namespace diracstep {

namespace {

constexpr double zero_reference = 1e-14;
constexpr double pre_asymptotic = 1e-2;
constexpr double round_off = 1e-11;
constexpr double round_off_margin = 30.0;
constexpr double plateau_slope = 0.5;
constexpr std::size_t max_points = 4;
constexpr std::size_t fewest_points = 3;

bool usable(const WorkPoint& point) { return std::isfinite(point.error) && point.error > 0.0; }

double slope_between(const WorkPoint& coarse, const WorkPoint& fine) {
  return std::log(coarse.error / fine.error) / std::log(coarse.step / fine.step);
}

/// Index of the last point before the error stops falling; points come from coarse to fine.
std::size_t last_before_plateau(const std::vector<WorkPoint>& points) {
  for (std::size_t i = 0; i + 1 < points.size(); ++i)
    if (points[i].error < plateau_ceiling && slope_between(points[i], points[i + 1]) < plateau_slope)
      return i;
  return points.size();
}

/// The points the order is read off, from coarse to fine.
std::vector<WorkPoint> asymptotic(const std::vector<WorkPoint>& points) {
  double smallest = std::numeric_limits<double>::infinity();
  for (const WorkPoint& point : points) smallest = std::min(smallest, point.error);
  const std::size_t last = last_before_plateau(points);
  const bool plateau = last < points.size();
  std::vector<WorkPoint> kept;
  for (std::size_t i = 0; i < points.size() && i <= last; ++i) {
    const bool above =
        points[i].error > round_off_margin * smallest || (!plateau && points[i].error > round_off);
    if (above && points[i].error < pre_asymptotic) kept.push_back(points[i]);
  }
  if (kept.size() > max_points) kept.erase(kept.begin(), kept.end() - max_points);
  return kept;
}

double least_squares_slope(const std::vector<WorkPoint>& points) {
  const double count = static_cast<double>(points.size());
  double mean_x = 0.0, mean_y = 0.0, xx = 0.0, xy = 0.0;
  for (const WorkPoint& point : points) {
    mean_x += std::log(point.step) / count;
    mean_y += std::log(point.error) / count;
  }
  for (const WorkPoint& point : points) {
    const double dx = std::log(point.step) - mean_x;
    xx += dx * dx;
    xy += dx * (std::log(point.error) - mean_y);
  }
  return xy / xx;
}

}  // namespace

double relative_error(ConstVectorRef value, ConstVectorRef reference, double natural) {
  if (value.size() == 0) return 0.0;
  const Vector difference = value - reference;
  if (!difference.allFinite()) return std::numeric_limits<double>::quiet_NaN();
  const double size = reference.lpNorm<Eigen::Infinity>(), error = difference.lpNorm<Eigen::Infinity>();
  if (size > zero_reference * natural) return error / size;
  return natural > 0.0 ? error / natural : error;
}

std::optional<OrderFit> measure_order(std::vector<WorkPoint> points) {
  for (WorkPoint& point : points) point.step = std::abs(point.step);
  std::erase_if(points, [](const WorkPoint& point) { return !usable(point) || !(point.step > 0.0); });
  std::ranges::sort(points, std::ranges::greater{}, &WorkPoint::step);
  const auto same_step = [](const WorkPoint& a, const WorkPoint& b) { return a.step == b.step; };
  points.erase(std::unique(points.begin(), points.end(), same_step), points.end());
  const std::vector<WorkPoint> kept = asymptotic(points);
  if (kept.size() < fewest_points) return std::nullopt;
  return OrderFit{least_squares_slope(kept), static_cast<int>(kept.size())};
}

std::vector<WorkPoint> lower_envelope(std::vector<WorkPoint> points) {
  std::erase_if(points, [](const WorkPoint& point) { return !usable(point) || !(point.cpu_seconds > 0.0); });
  std::ranges::sort(points, [](const WorkPoint& a, const WorkPoint& b) {
    return a.cpu_seconds != b.cpu_seconds ? a.cpu_seconds < b.cpu_seconds : a.error < b.error;
  });
  std::vector<WorkPoint> envelope;
  for (const WorkPoint& point : points)
    if (envelope.empty() || point.error < envelope.back().error) envelope.push_back(point);
  return envelope;
}

std::optional<double> cpu_seconds_at(const std::vector<WorkPoint>& points, double error) {
  const std::vector<WorkPoint> envelope = lower_envelope(points);
  if (envelope.empty() || !(error <= envelope.front().error)) return std::nullopt;
  for (std::size_t i = 0; i < envelope.size(); ++i) {
    const WorkPoint& fine = envelope[i];
    if (fine.error > error) continue;
    if (i == 0) return fine.cpu_seconds;
    const WorkPoint& coarse = envelope[i - 1];
    const double part = std::log(coarse.error / error) / std::log(coarse.error / fine.error);
    return coarse.cpu_seconds * std::pow(fine.cpu_seconds / coarse.cpu_seconds, part);
  }
  return std::nullopt;
}

std::optional<double> cpu_seconds_within(const std::vector<WorkPoint>& points, double error) {
  const std::vector<WorkPoint> envelope = lower_envelope(points);
  if (!envelope.empty() && envelope.front().error < error) return envelope.front().cpu_seconds;
  return cpu_seconds_at(points, error);
}

}  // namespace diracstep
