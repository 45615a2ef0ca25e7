#include <algorithm>
#include <cmath>
#include <diracstep/core/dirac/discrete_action.hpp>
#include <diracstep/core/numerics/errors.hpp>

namespace diracstep {

namespace {

/// The columns of S on step k of the curve, inner ones made stationary; NaN where that fails.
Columns columns_on(GeneratingFunction& s, const DiscreteCurve& curve, std::size_t k) {
  const GraphOf graph = graph_of(s.type());
  const Interval step = curve.interval(k);
  Columns y(s.dimension(), s.columns());
  y.col(0) = graph.starts_from_position ? curve.q0[k] : curve.p[k];
  y.col(1) = graph.ends_at_position ? curve.q1[k] : curve.p[k + 1];
  if (s.inner_columns() > 0) {
    const Vector velocity = (curve.q1[k] - curve.q0[k]) / step.size;
    s.guess_inner(step, curve.q0[k], curve.p[k], velocity, y.rightCols(s.inner_columns()));
    if (!make_stationary(s, step, y)) y.setConstant(std::nan(""));
  }
  return y;
}

void require_type(const GeneratingFunction& s, GeneratingType a, GeneratingType b, const char* message) {
  if (s.type() != a && s.type() != b) throw Misuse(message);
}

}  // namespace

DiscreteCurve curve_of(double start, double step, const std::vector<Vector>& q,
                       const std::vector<Vector>& p) {
  if (q.size() < 2 || q.size() != p.size())
    throw Misuse("a discrete curve needs two points or more, and as many momenta as configurations");
  return {start, step, {q.begin(), q.end() - 1}, {q.begin() + 1, q.end()}, p};
}

double hamilton_pontryagin_sum(GeneratingFunction& lagrangian, const DiscreteCurve& curve) {
  require_type(lagrangian, GeneratingType::one, GeneratingType::one,
               "the Hamilton-Pontryagin sum takes a generating function of type 1");
  double sum = 0.0;
  for (std::size_t k = 0; k < curve.steps(); ++k) {
    sum += lagrangian.value(curve.interval(k), columns_on(lagrangian, curve, k));
    if (k + 1 < curve.steps()) sum -= curve.p[k + 1].dot(curve.q1[k] - curve.q0[k + 1]);
  }
  return sum;
}

double phase_space_sum(GeneratingFunction& hamiltonian, const DiscreteCurve& curve) {
  require_type(hamiltonian, GeneratingType::two, GeneratingType::three,
               "the phase-space sum takes a generating function of type 2 or 3");
  const bool plus = hamiltonian.type() == GeneratingType::two;
  double sum = 0.0;
  for (std::size_t k = 0; k < curve.steps(); ++k) {
    sum -= hamiltonian.value(curve.interval(k), columns_on(hamiltonian, curve, k));
    sum += plus ? curve.p[k + 1].dot(curve.q1[k]) : -curve.p[k].dot(curve.q0[k]);
  }
  return sum;
}

double stationarity_residual(GeneratingFunction& s, DiscreteDiracStructure& structure,
                             const DiscreteCurve& curve) {
  if (s.type() == GeneratingType::four)
    throw Misuse("no principle is stated for generating functions of type 4");
  const GraphOf graph = graph_of(s.type());
  double largest = 0.0;
  const auto take = [&](double violation) { largest = std::max(largest, violation); };
  Columns g(s.dimension(), s.columns());
  for (std::size_t k = 0; k < curve.steps(); ++k) {
    const Interval step = curve.interval(k);
    s.gradient(step, columns_on(s, curve, k), g);
    const Vector start = graph.start_sign * g.col(0), end = graph.end_sign * g.col(1);
    if (!start.allFinite() || !end.allFinite()) return HUGE_VAL;
    take(graph.starts_from_position
             ? structure.outside_annihilator(step.start, curve.q0[k], curve.p[k] - start)
             : (curve.q0[k] - start).lpNorm<Eigen::Infinity>());
    take(graph.ends_at_position ? structure.outside_annihilator(step.end(), curve.q1[k], curve.p[k + 1] - end)
                                : (curve.q1[k] - end).lpNorm<Eigen::Infinity>());
    if (k + 1 < curve.steps()) take((curve.q1[k] - curve.q0[k + 1]).lpNorm<Eigen::Infinity>());
  }
  return largest;
}

}  // namespace diracstep
