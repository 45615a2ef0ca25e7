#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <diracstep/command/kept_invariants.hpp>

namespace diracstep::command {

namespace {

constexpr double stated_to = 1e-6;  ///< relative, of an invariant's stated value

/// How much errors `error` of q and v, in parts of the largest of each, may change an invariant, to first
/// order.
double change_by_error(const Invariant& invariant, const Sample& end, const Vector& speeds, double error) {
  const double here = invariant.at(end.time, end.q, speeds);
  double sum = 0.0;
  Vector q = end.q, y = speeds;
  for (Vector* column : {&q, &y}) {
    const double off = error * column->lpNorm<Eigen::Infinity>();
    for (Eigen::Index i = 0; i < column->size(); ++i) {
      const double kept = (*column)[i];
      (*column)[i] = kept + off;
      sum += std::abs(invariant.at(end.time, q, y) - here);
      (*column)[i] = kept;
    }
  }
  return sum;
}

/// Empty, or that an accepted run cannot have the error asked for, since an invariant changed by more.
std::string denied_by(const InvariantEnds& ends, const Invariant& invariant, const Sample& end,
                      const Vector& speeds, double error) {
  constexpr int most_coordinates = 200;
  constexpr double more = 10.0, rounding = 1e-12;
  if (end.q.size() > most_coordinates) return {};
  const double change = std::abs(ends.end - ends.start);
  const double allowed = change_by_error(invariant, end, speeds, error);
  if (!(change > more * allowed + rounding * std::max(std::abs(ends.start), std::abs(ends.end)))) return {};
  return fmt::format(
      "the invariant {} changed by {:.2e}; an error of {:g} allows about {:.2e}, so that the "
      "runs agree on a wrong motion",
      ends.name, change, error, allowed);
}

}  // namespace

void compare_invariants(const CatalogueScene& entry, bool stated, std::optional<double> error,
                        RunResult& result) {
  if (!result.has_end()) return;
  const auto scene = completed(entry.scene);
  const Start& start = scene->start;
  const bool by_momentum = !entry.scene->lagrangian;
  for (const Invariant& invariant : entry.invariants) {
    const Vector& first = by_momentum ? entry.scene->start.p : start.v;
    if (first.size() == 0) continue;
    InvariantEnds ends{
        .name = invariant.name,
        .start = invariant.at(start.time, start.q, first),
        .end = invariant.at(result.end.time, result.end.q, by_momentum ? result.end.p : result.end.v),
        .stated = invariant.value};
    if (ends.stated && stated &&
        !(std::abs(ends.start - *ends.stated) <= stated_to * std::abs(*ends.stated)) && result.doubt.empty())
      result.doubt = fmt::format("the invariant {} is {:.15g} at the start; the scene states {:.15g}",
                                 ends.name, ends.start, *ends.stated);
    if (error && result.search && result.search->ok() && result.doubt.empty())
      result.doubt =
          denied_by(ends, invariant, result.end, by_momentum ? result.end.p : result.end.v, *error);
    result.invariants.push_back(std::move(ends));
  }
}

}  // namespace diracstep::command
