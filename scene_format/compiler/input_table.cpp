#include <diracstep/scene_format/compiler/input_table.hpp>

namespace diracstep::scene_compiler {

namespace {

/// Second derivatives of the natural cubic spline at its points, by elimination of the tridiagonal system
///   h_{k−1} m_{k−1} + 2 (h_{k−1} + h_k) m_k + h_k m_{k+1} = 6 (s_k − s_{k−1}),   s the slopes of the chords.
std::vector<double> bends(const std::vector<double>& x, const std::vector<double>& y) {
  const std::size_t n = x.size();
  std::vector<double> bend(n, 0.0), above(n, 0.0);
  const auto width = [&](std::size_t k) { return x[k + 1] - x[k]; };
  const auto slope = [&](std::size_t k) { return (y[k + 1] - y[k]) / width(k); };
  for (std::size_t k = 1; k + 1 < n; ++k) {
    const double pivot = 2.0 * (width(k - 1) + width(k)) - width(k - 1) * above[k - 1];
    above[k] = width(k) / pivot;
    bend[k] = (6.0 * (slope(k) - slope(k - 1)) - width(k - 1) * bend[k - 1]) / pivot;
  }
  for (std::size_t k = n - 1; k-- > 1;) bend[k] -= above[k] * bend[k + 1];
  return bend;
}

}  // namespace

LookupTable table_of(const SceneDocument::Input& input) {
  using Kind = SceneDocument::Input::Kind;
  const std::vector<double>&x = input.times, &y = input.values;
  LookupTable table{input.kind == Kind::step     ? 0
                    : input.kind == Kind::linear ? 1
                                                 : 3,
                    x,
                    {y.front(), 0, 0, 0}};
  const auto add = [&](double c0, double c1, double c2, double c3) {
    table.coefficients.insert(table.coefficients.end(), {c0, c1, c2, c3});
  };
  const std::vector<double> bend =
      input.kind == Kind::cubic ? bends(x, y) : std::vector<double>(x.size(), 0.0);
  for (std::size_t k = 0; k + 1 < x.size(); ++k) {
    const double h = x[k + 1] - x[k], slope = (y[k + 1] - y[k]) / h;
    if (input.kind == Kind::step)
      add(y[k], 0.0, 0.0, 0.0);
    else if (input.kind == Kind::linear)
      add(y[k], slope, 0.0, 0.0);
    else
      add(y[k], slope - h * (2.0 * bend[k] + bend[k + 1]) / 6.0, bend[k] / 2.0,
          (bend[k + 1] - bend[k]) / (6.0 * h));
  }
  add(y.back(), 0.0, 0.0, 0.0);
  return table;
}

}  // namespace diracstep::scene_compiler
