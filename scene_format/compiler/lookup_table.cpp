#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>
#include <diracstep/scene_format/compiler/lookup_table.hpp>

namespace diracstep::scene_compiler {

namespace {

constexpr double round_off = 1e-15;  // of a time at an end of the table

/// As in the source below, word for word but for the language.
double value_of_part(const double* c, double u, int order) {
  if (order == 0) return ((c[3] * u + c[2]) * u + c[1]) * u + c[0];
  if (order == 1) return (3.0 * c[3] * u + 2.0 * c[2]) * u + c[1];
  if (order == 2) return 6.0 * c[3] * u + 2.0 * c[2];
  return 6.0 * c[3];
}

long knots_up_to(const std::vector<double>& knots, double u, bool equal) {
  long low = 0, high = static_cast<long>(knots.size());
  while (low < high) {
    const long middle = (low + high) / 2;
    const double knot = knots[static_cast<std::size_t>(middle)];
    if (knot < u || (equal && knot == u))
      low = middle + 1;
    else
      high = middle;
  }
  return low;
}

}  // namespace

double LookupTable::value(double u, int order) const {
  if (!(u == u)) return u;
  const auto side = [&](long part) {
    const double from = knots[static_cast<std::size_t>(part > 0 ? part - 1 : 0)];
    return value_of_part(coefficients.data() + width * part, u - from, order);
  };
  const long before = knots_up_to(knots, u, false), behind = knots_up_to(knots, u, true);
  if (order > 0 && before == 0 && knots.front() - u <= round_off * std::abs(u))
    return side(knots_up_to(knots, knots.front(), true));
  if (order > 0 && behind == static_cast<long>(knots.size()) && u - knots.back() <= round_off * std::abs(u))
    return side(knots_up_to(knots, knots.back(), false));
  if (before == behind) return side(before);
  return 0.5 * (side(before) + side(behind));
}

const char* LookupTable::source_of_value() {
  return R"(static double diracstep_part(const double* c, double u, int order) {
  if (order == 0) return ((c[3] * u + c[2]) * u + c[1]) * u + c[0];
  if (order == 1) return (3.0 * c[3] * u + 2.0 * c[2]) * u + c[1];
  if (order == 2) return 6.0 * c[3] * u + 2.0 * c[2];
  return 6.0 * c[3];
}
static long diracstep_up_to(const double* knots, long size, double u, int equal) {
  long low = 0, high = size;
  while (low < high) {
    const long middle = (low + high) / 2;
    if (knots[middle] < u || (equal && knots[middle] == u)) low = middle + 1; else high = middle;
  }
  return low;
}
static double diracstep_table(const double* knots, const double* parts, long size, double u, int order) {
  const long before = diracstep_up_to(knots, size, u, 0), behind = diracstep_up_to(knots, size, u, 1);
  double left, right;
  if (u != u) return u;
  if (order > 0 && before == 0 && knots[0] - u <= 1e-15 * fabs(u)) {
    const long first = diracstep_up_to(knots, size, knots[0], 1);
    return diracstep_part(parts + 4 * first, u - knots[first - 1], order);
  }
  if (order > 0 && behind == size && u - knots[size - 1] <= 1e-15 * fabs(u)) {
    const long last = diracstep_up_to(knots, size, knots[size - 1], 0);
    return diracstep_part(parts + 4 * last, u - knots[last > 0 ? last - 1 : 0], order);
  }
  left = diracstep_part(parts + 4 * before, u - knots[before > 0 ? before - 1 : 0], order);
  if (before == behind) return left;
  right = diracstep_part(parts + 4 * behind, u - knots[behind > 0 ? behind - 1 : 0], order);
  return 0.5 * (left + right);
}
)";
}

std::string LookupTable::source(const std::string& name) const {
  return fmt::format(
      "static const double {0}_knots[] = {{{1:.17g}}};\nstatic const double {0}_parts[] = {{{2:.17g}}};\n",
      name, fmt::join(knots, ", "), fmt::join(coefficients, ", "));
}

}  // namespace diracstep::scene_compiler
