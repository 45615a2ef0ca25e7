#pragma once

#include <diracstep/core/numerics/jet.hpp>
#include <diracstep/core/system/constraint_rows.hpp>
#include <functional>
#include <string>
#include <vector>

namespace diracstep {

/// A function of the time alone with its derivative.
struct Waveform {
  std::function<double(double t)> value, rate;
};

/// A waveform from one formula that is generic in its argument: `waveform([](const auto& t) { return sin(t);
/// })`.
template <class F>
Waveform waveform(F formula) {
  using Time = Jet<1, 1>;
  return {[formula](double t) { return static_cast<double>(formula(t)); },
          [formula](double t) { return Time(formula(Time::variable(t, 0))).gradient(0); }};
}

/// Rows A v + b(t) = 0 with constant coefficients, on the pattern of those other than zero: interconnections,
/// Kirchhoff's current law.  `b` is empty or has a waveform for each row.  Throws Misuse where the numbers of
/// names or of waveforms are not those of the rows.
std::shared_ptr<const ConstraintRows> linear_rows(const Columns& a, std::vector<std::string> names = {},
                                                  std::vector<Waveform> b = {});

}  // namespace diracstep
