#pragma once

#include <Eigen/Dense>
#include <vector>

namespace diracstep::testing {

using LongReal = long double;
using LongVector = Eigen::Matrix<LongReal, Eigen::Dynamic, 1>;
using LongMatrix = Eigen::Matrix<LongReal, Eigen::Dynamic, Eigen::Dynamic>;

/// y' = f(t, y) from 0 to `end` by the explicit midpoint rule with Gragg's smoothing, extrapolated to order
/// 18 in each of `pieces` equal parts, in long double: a reference that shares no line with the library.
template <class F>
LongVector extrapolated(F f, LongVector y, LongReal end, int pieces = 24) {
  const LongReal whole = end / pieces;
  for (int piece = 0; piece < pieces; ++piece) {
    const LongReal t = piece * whole;
    std::vector<LongVector> column;
    for (int j = 1; j <= 9; ++j) {
      const int n = 2 * j;
      const LongReal h = whole / n;
      LongVector before = y, here = y + h * f(t, y);
      for (int m = 1; m < n; ++m) {
        const LongVector next = before + 2 * h * f(t + m * h, here);
        before = here;
        here = next;
      }
      column.push_back((before + here + h * f(t + whole, here)) / 2);
      for (int l = j - 2; l >= 0; --l) {
        const LongReal ratio = LongReal(n) / (2 * (l + 1));
        const auto i = static_cast<std::size_t>(l);
        column[i] = column[i + 1] + (column[i + 1] - column[i]) / (ratio * ratio - 1);
      }
    }
    y = column.front();
  }
  return y;
}

/// g_i,j = ∂f_i/∂x_j by differences of order 4 in long double: good to about 1e-14 for functions of size 1.
template <class F>
LongMatrix long_jacobian(F f, const LongVector& x) {
  const LongReal e = 1e-4L;
  LongMatrix g(f(x).size(), x.size());
  for (Eigen::Index j = 0; j < x.size(); ++j) {
    const LongVector d = e * LongVector::Unit(x.size(), j);
    g.col(j) = (8 * (f(x + d) - f(x - d)) - (f(x + 2 * d) - f(x - 2 * d))) / (12 * e);
  }
  return g;
}

}  // namespace diracstep::testing
