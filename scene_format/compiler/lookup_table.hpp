#pragma once

#include <string>
#include <vector>

namespace diracstep::scene_compiler {

/// A function of one variable by cubic polynomials between knots, a constant before the first and behind the
/// last; at a knot the mean of both sides, of derivatives at the first and the last, to round-off, the one
/// within.  The part is found by bisection, so that a table of many knots costs little more than one of few.
struct LookupTable {
  static constexpr int width = 4;    ///< coefficients of a part
  int degree = 0;                    ///< the highest of any part
  std::vector<double> knots;         ///< ascending
  std::vector<double> coefficients;  ///< Σ c_k (u − knot before)^k: before the first knot, behind each

  /// Its derivative of this order, 0 to 3.
  double value(double u, int order) const;

  /// value() in C for the tables of generated sources, and this table as two arrays NAME_knots and
  /// NAME_parts.
  static const char* source_of_value();
  std::string source(const std::string& name) const;
};

}  // namespace diracstep::scene_compiler
