#include <Eigen/QR>
#include <cmath>
#include <diracstep/core/dirac/discrete_rows.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/system/constraint_distribution.hpp>
#include <sstream>

namespace diracstep {

namespace {

constexpr double tolerance = 1e-9, difference_tolerance = 1e-6;

Vector residual(const DiscreteRows& rows, Interval step, ConstVectorRef q0, ConstVectorRef q1) {
  Vector c(rows.rows());
  rows.residual(step, q0, q1, c);
  return c;
}

Columns derivative(const DiscreteRows& rows, Interval step, ConstVectorRef q0, ConstVectorRef q1) {
  Vector d(rows.pattern().nonzeros());
  rows.end_derivative(step, q0, q1, d);
  return rows.pattern().full(d);
}

void require_below(double value, double allowed, const char* what) {
  if (value <= allowed) return;
  std::ostringstream message;
  message << "the discrete constraint is none of these rows: " << what << " by " << value << ", allowed "
          << allowed;
  throw Misuse(message.str());
}

/// Distance of the row space of `rows` from that of `forms`, relative to the largest entry of each row.
double outside_span(Columns rows, const Columns& forms) {
  for (Eigen::Index r = 0; r < rows.rows(); ++r)
    rows.row(r) /= size_or_one(max_norm(rows.row(r).transpose()));
  const Columns transposed = forms.transpose();
  const Eigen::ColPivHouseholderQR<Columns> qr(transposed);
  const Columns coefficients = qr.solve(Columns(rows.transpose()));
  return max_norm(rows.transpose() - transposed * coefficients);
}

/// Largest difference between ∂c/∂q1 and central differences of c at (q0, q1).
double derivative_error(const DiscreteRows& rows, Interval step, const Vector& q0, const Vector& q1) {
  const Columns exact = derivative(rows, step, q0, q1);
  const double size = max_norm(q1);
  double largest = 0.0;
  for (Eigen::Index i = 0; i < q1.size(); ++i) {
    const double delta = 1e-5 * size_beside(q1[i], size);
    Vector forward = q1, backward = q1;
    forward[i] += delta;
    backward[i] -= delta;
    const Vector column =
        (residual(rows, step, q0, forward) - residual(rows, step, q0, backward)) / (2.0 * delta);
    largest = std::max(largest, max_norm(column - exact.col(i)));
  }
  return largest / size_or_one(max_norm(exact));
}

}  // namespace

void require_discretisation(const DiscreteRows& rows, const ConstraintBlocks& constraints, double t,
                            ConstVectorRef q) {
  const int n = static_cast<int>(q.size());
  const ConstraintBlocks blocks = only_nonholonomic(constraints);
  require_size("the discrete constraint: its number of rows", rows.rows(), row_count(blocks));
  require_size("the discrete constraint: its number of coordinates", rows.pattern().columns(), n);
  ConstraintsAtPoint at(blocks, n);
  at.evaluate(t, q);
  const Columns forms = at.pattern().full(at.coefficients());
  const double terms = size_or_one(max_norm(forms) * max_norm(q));
  const Interval none{t, 0.0}, small{t, 1e-7};
  require_below(max_norm(residual(rows, none, q, q)), tolerance * terms,
                "the diagonal q1 = q0 violates it (4.17)");
  const Columns d = derivative(rows, none, q, q);
  require_below(outside_span(d, forms), tolerance,
                "∂c/∂q1 on the diagonal leaves the annihilator of Δ_Q (4.18)");
  require_below(outside_span(forms, d), tolerance,
                "∂c/∂q1 on the diagonal does not span the annihilator (4.19)");
  Vector offset(rows.rows());
  at.velocity_residual(Vector::Zero(n), offset);
  // c may be any combination of the rows; on the diagonal ∂c/∂q1 = T A, so c/h → T b.
  const Columns combination =
      Columns(forms.transpose()).colPivHouseholderQr().solve(Columns(d.transpose())).transpose();
  const Vector rate = residual(rows, small, q, q) / small.size;
  require_below(max_norm(rate - combination * offset),
                1e-5 * size_or_one(std::max({max_norm(rate), max_norm(offset), max_norm(d)})),
                "c(q,q)/h misses the term b of A v + b");
  Vector q1 = q;
  for (int i = 0; i < n; ++i) q1[i] += 1e-2 * std::sin(1.0 + 1.7 * i) * size_beside(q[i], max_norm(q));
  require_below(derivative_error(rows, {t, 0.05}, q, q1), difference_tolerance,
                "∂c/∂q1 differs from differences");
}

}  // namespace diracstep
