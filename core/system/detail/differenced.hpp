#pragma once

#include <array>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/numerics/types.hpp>

namespace diracstep {

/// Σ_k weights_k (f(k) − f(−k)): the derivative of order 8 in units of the width.
template <class F>
Vector central_difference(F f) {
  constexpr std::array weights{4.0 / 5.0, -1.0 / 5.0, 4.0 / 105.0, -1.0 / 280.0};
  Vector sum = weights[0] * (f(1.0) - f(-1.0));
  for (std::size_t k = 1; k < weights.size(); ++k) {
    const auto far = static_cast<double>(k + 1);
    sum += weights.at(k) * (f(far) - f(-far));
  }
  return sum;
}

/// ∂f/∂x by differences over parts of each half of x, whose second begins at `second`.
template <class F>
Columns differenced(F f, const Vector& x, Eigen::Index second, double part, bool high_order) {
  Columns by;
  for (Eigen::Index j = 0; j < x.size(); ++j) {
    const double size = max_norm(j < second ? x.head(second) : x.tail(x.size() - second)),
                 d = part * size_or_one(size);
    const auto moved = [&](double k) {
      Vector there = x;
      there[j] += k * d;
      return f(there);
    };
    const Vector column =
        high_order ? Vector(central_difference(moved) / d) : Vector((moved(1.0) - moved(-1.0)) / (2.0 * d));
    if (j == 0) by.resize(column.size(), x.size());
    by.col(j) = column;
  }
  return by;
}

}  // namespace diracstep
