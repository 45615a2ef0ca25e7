#include <fmt/format.h>

#include <cmath>
#include <diracstep/command/arguments.hpp>
#include <diracstep/command/verbs/run_times.hpp>
#include <diracstep/core/numerics/errors.hpp>

namespace diracstep::command {

namespace {

constexpr double most_chosen_times = 1e8;

}  // namespace

std::vector<double> chosen_times(const RunArguments& options, const CatalogueScene& entry, double end) {
  if (!options.at.empty()) return numbers("--at", options.at);
  if (!options.every_time) return {};
  const double start = entry.scene->start.time,
               count = std::floor(std::abs(end - start) / *options.every_time + 1e-9);
  if (count > most_chosen_times)
    throw Misuse(fmt::format("--every-time {:g} asks for {:g} points; {:g} are the most", *options.every_time,
                             count, most_chosen_times));
  std::vector<double> times;
  for (double k = 0.0; k <= count; ++k)
    times.push_back(start + std::copysign(k * *options.every_time, end - start));
  return times;
}

void require_within(const std::vector<double>& times, double start, double end, double step) {
  const auto reaches = [step](double from, double to) { return (to - from) * step >= -1e-9 * step * step; };
  double last = start;
  for (const double t : times) {
    if (!reaches(last, t))
      throw Misuse(fmt::format("--at: t = {:g} is not ahead of t = {:g}, {}", t, last,
                               last == start ? "the start" : "the time before"));
    last = t;
  }
  if (!reaches(last, end))
    throw Misuse(fmt::format("--at: t = {:g} lies behind t = {:g}, the end; --end moves it", last, end));
}

}  // namespace diracstep::command
