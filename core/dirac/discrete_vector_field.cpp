#include <Eigen/LU>
#include <algorithm>
#include <diracstep/core/dirac/discrete_vector_field.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/numerics/scales.hpp>

namespace diracstep {

namespace {

/// Solves residual(x) = 0 from x; false where the changes do not become small.  Differences leave a Jacobian
/// that is right to about 1e-9, so each iteration gains that many digits.
template <class Residual>
bool solve_by_differences(Residual residual, Vector& x) {
  for (int iteration = 0; iteration < 30; ++iteration) {
    const Vector r = residual(x);
    Columns jacobian(r.size(), x.size());
    for (Eigen::Index i = 0; i < x.size(); ++i) {
      const Vector change = Vector::Unit(x.size(), i) * 1e-5 * std::max(1.0, std::abs(x[i]));
      jacobian.col(i) = (residual(x + change) - residual(x - change)) / (2.0 * change[i]);
    }
    if (!r.allFinite() || !jacobian.allFinite()) return false;  // its solution would be zero
    const Vector change = jacobian.fullPivLu().solve(-r);
    x += change;
    const double size = std::max(1.0, max_norm(x));
    if (max_norm(change) <= 1e-12 * size) return max_norm(residual(x)) <= 1e-10 * size;
  }
  return false;
}

/// What both fields share: z1 or z0 is looked for, with multipliers and the inner columns of S.
class FieldEquations {
 public:
  FieldEquations(GeneratingFunction& s, DiscreteDiracStructure& structure, Interval step,
                 const PhasePoint& given, bool forward)
      : s_(s), structure_(structure), step_(step), given_(given), forward_(forward) {
    if (s.type() == GeneratingType::four)
      throw Misuse("no discrete vector field is stated for generating functions of type 4");
    for (const Vector* part : {&given.q, &given.p})
      require_size("a point of the phase space", part->size(), s.dimension());
    one_forms_ = structure.one_forms(forward ? step.start : step.end(), given.q);
  }

  std::optional<PhasePoint> solve(const PhasePoint& guess) {
    const Eigen::Index n = s_.dimension();
    for (const Vector* part : {&guess.q, &guess.p})
      require_size("a guess of a point of the phase space", part->size(), n);
    Columns inner(n, s_.inner_columns());
    const PhasePoint &z0 = forward_ ? given_ : guess, &z1 = forward_ ? guess : given_;
    s_.guess_inner(step_, z0.q, z0.p, (z1.q - z0.q) / step_.size, inner);
    Vector x(2 * n + structure_.rows() + inner.size());
    x << guess.q, guess.p, Vector::Zero(structure_.rows()), inner.reshaped();
    if (!solve_by_differences([this](const Vector& at) { return residual(at); }, x)) return std::nullopt;
    return PhasePoint{x.head(n), x.segment(n, n)};
  }

 private:
  /// The graph of S with the impulse at the given point, the discrete constraint, stationary inner columns.
  Vector residual(const Vector& x) {
    const Eigen::Index n = s_.dimension(), m = structure_.rows();
    const PhasePoint found{x.head(n), x.segment(n, n)};
    PhasePoint z0 = forward_ ? given_ : found, z1 = forward_ ? found : given_;
    (forward_ ? z0 : z1).p += one_forms_.transpose() * x.segment(2 * n, m);
    const GraphOf graph = graph_of(s_.type());
    Columns y(n, s_.columns()), g(n, s_.columns());
    y.col(0) = graph.starts_from_position ? z0.q : z0.p;
    y.col(1) = graph.ends_at_position ? z1.q : z1.p;
    y.rightCols(s_.inner_columns()) = x.tail(n * s_.inner_columns()).reshaped(n, s_.inner_columns());
    s_.gradient(step_, y, g);
    Vector r(x.size());
    r << (graph.starts_from_position ? z0.p : z0.q) - graph.start_sign * g.col(0),
        (graph.ends_at_position ? z1.p : z1.q) - graph.end_sign * g.col(1),
        structure_.discrete_constraint(step_, z0.q, z1.q, !forward_),
        g.rightCols(s_.inner_columns()).reshaped();
    return r;
  }

  GeneratingFunction& s_;
  DiscreteDiracStructure& structure_;
  Interval step_;
  PhasePoint given_;
  bool forward_;
  Columns one_forms_;
};

}  // namespace

std::optional<PhasePoint> discrete_vector_field_plus(GeneratingFunction& s, DiscreteDiracStructure& structure,
                                                     Interval step, const PhasePoint& z0,
                                                     const PhasePoint& guess) {
  return FieldEquations(s, structure, step, z0, true).solve(guess);
}

std::optional<PhasePoint> discrete_vector_field_minus(GeneratingFunction& s,
                                                      DiscreteDiracStructure& structure, Interval step,
                                                      const PhasePoint& z1, const PhasePoint& guess) {
  return FieldEquations(s, structure, step, z1, false).solve(guess);
}

}  // namespace diracstep
