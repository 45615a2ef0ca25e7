#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <diracstep/core/dirac/dirac_structure.hpp>
#include <diracstep/core/dirac/orthonormal_bases.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/numerics/scales.hpp>

namespace diracstep {

namespace {

Columns one_forms_at(ConstraintsAtPoint& rows, double t, const Vector& q) {
  rows.evaluate(t, q);
  return rows.pattern().full(rows.coefficients());
}

/// Maximum norm of what a covector has outside the span of the rows.
double outside_row_space(const Columns& one_forms, const Vector& covector) {
  if (one_forms.rows() == 0) return max_norm(covector);
  const Columns transposed = one_forms.transpose();
  const Vector lambda = transposed.colPivHouseholderQr().solve(covector);
  return max_norm(covector - transposed * lambda);
}

/// rows f_q = 0,  e_q + f_p − C e_c ∈ range of one_formsᵀ,  e_p = f_q,  f_c = −Cᵀ f_q.
FlowEffortSpace canonical_structure(const Columns& rows, const Columns& one_forms, const Columns& ports) {
  const Eigen::Index n = ports.rows(), c = ports.cols(), m = rows.rows();
  // Covectors in the annihilator are those that vanish on Δ_Q.
  const Columns on_distribution = orthonormal_bases(one_forms.transpose()).complement.transpose();
  const Eigen::Index k = on_distribution.rows();
  Columns flows = Columns::Zero(m + k + n + c, 2 * n + c), efforts = flows;
  flows.block(0, 0, m, n) = rows;
  flows.block(m, n, k, n) = efforts.block(m, 0, k, n) = on_distribution;
  efforts.block(m, 2 * n, k, c) = -on_distribution * ports;
  flows.block(m + k, 0, n, n) = -Columns::Identity(n, n);
  efforts.block(m + k, n, n, n).setIdentity();
  flows.block(m + k + n, 0, c, n) = ports.transpose();
  flows.block(m + k + n, 2 * n, c, c).setIdentity();
  return FlowEffortSpace::kernel_of(flows, efforts);
}

Vector q_then_p(const Vector& a, const Vector& b) {
  Vector both(a.size() + b.size());
  both << a, b;
  return both;
}

}  // namespace

Covector omega_flat(const PhaseVelocity& z) { return {z.q, z.p, -z.p_rate, z.q_rate}; }
Covector kappa(const PhaseVelocity& z) { return {z.q, z.q_rate, z.p_rate, z.p}; }
Covector gamma(const Covector& a) { return {a.x, a.eta, -a.xi, a.y}; }

Covector discrete_kappa(const PhasePoint& z0, const PhasePoint& z1) { return {z0.q, z1.q, -z0.p, z1.p}; }
Covector omega_flat_plus(const PhasePoint& z0, const PhasePoint& z1) { return {z0.q, z1.p, z0.p, z1.q}; }
Covector omega_flat_minus(const PhasePoint& z0, const PhasePoint& z1) { return {z0.p, z1.q, -z0.q, -z1.p}; }
Covector gamma_plus(const Covector& a) { return {a.x, a.eta, -a.xi, a.y}; }
Covector gamma_minus(const Covector& a) { return {-a.xi, a.y, -a.x, -a.eta}; }

Covector dirac_differential(const Lagrangian& lagrangian, double t, const Vector& q, const Vector& v) {
  Vector lq(q.size()), lv(q.size());
  lagrangian.gradient(t, q, v, lq, lv);
  return gamma({q, v, lq, lv});
}
Covector differential(const Hamiltonian& hamiltonian, double t, const Vector& q, const Vector& p) {
  Vector hq(q.size()), hp(q.size());
  hamiltonian.gradient(t, q, p, hq, hp);
  return {q, p, hq, hp};
}

double PairForm::on(const PhasePoint& w0, const PhasePoint& w1) const {
  return dq0.dot(w0.q) + dp0.dot(w0.p) + dq1.dot(w1.q) + dp1.dot(w1.p);
}
PairForm lambda_d(const PhasePoint& z0, const PhasePoint& z1) {
  const Covector a = discrete_kappa(z0, z1);
  const Vector zero = Vector::Zero(z0.q.size());
  return {a.xi, zero, a.eta, zero};
}
PairForm chi_plus(const PhasePoint& z0, const PhasePoint& z1) {
  const Covector a = omega_flat_plus(z0, z1);
  const Vector zero = Vector::Zero(z0.q.size());
  return {a.xi, zero, zero, a.eta};
}
PairForm chi_minus(const PhasePoint& z0, const PhasePoint& z1) {
  const Covector a = omega_flat_minus(z0, z1);
  const Vector zero = Vector::Zero(z0.q.size());
  return {zero, a.xi, a.eta, zero};
}
double symplectic_form(const PhasePoint& w0, const PhasePoint& w1, const PhasePoint& u0,
                       const PhasePoint& u1) {
  return w1.q.dot(u1.p) - w1.p.dot(u1.q) - w0.q.dot(u0.p) + w0.p.dot(u0.q);
}

FlowAndEffort flow_and_effort(const PhaseVelocity& x, const Covector& alpha) {
  return {q_then_p(x.q_rate, x.p_rate), q_then_p(alpha.xi, alpha.eta)};
}
FlowAndEffort flow_and_effort_plus(const PhasePoint& z0, const PhasePoint& z1, const Covector& alpha) {
  return {q_then_p(z1.q - z0.q, z1.p - z0.p), q_then_p(alpha.xi - z1.p, alpha.eta - z0.q)};
}
FlowAndEffort flow_and_effort_minus(const PhasePoint& z0, const PhasePoint& z1, const Covector& alpha) {
  return {q_then_p(z1.q - z0.q, z1.p - z0.p), q_then_p(alpha.eta + z0.p, alpha.xi + z1.q)};
}

DiscreteLagrangianAt evaluate(GeneratingFunction& lagrangian, Interval step, const Columns& y) {
  if (lagrangian.type() != GeneratingType::one)
    throw Misuse("a discrete Lagrangian is a generating function of type 1");
  require_size("the columns of a generating function", y.cols(), lagrangian.columns());
  Columns g(y.rows(), y.cols());
  lagrangian.gradient(step, y, g);
  return {y.col(0), y.col(1), lagrangian.value(step, y), g.col(0), g.col(1)};
}

PhasePoint legendre_plus(const DiscreteLagrangianAt& l) { return {l.q1, l.d2}; }
PhasePoint legendre_minus(const DiscreteLagrangianAt& l) { return {l.q0, -l.d1}; }
double momentum_function_plus(const PhasePoint&, const PhasePoint& z1) { return z1.p.dot(z1.q); }
double momentum_function_minus(const PhasePoint& z0, const PhasePoint&) { return -z0.p.dot(z0.q); }
double generalised_energy_plus(const DiscreteLagrangianAt& l, const Vector& p1) {
  return p1.dot(l.q1) - l.value;
}
double generalised_energy_minus(const DiscreteLagrangianAt& l, const Vector& p0) {
  return -p0.dot(l.q0) - l.value;
}
double discrete_hamiltonian_plus(const DiscreteLagrangianAt& l) { return generalised_energy_plus(l, l.d2); }
double discrete_hamiltonian_minus(const DiscreteLagrangianAt& l) {
  return generalised_energy_minus(l, -l.d1);
}
Covector differential_plus(const DiscreteLagrangianAt& l) { return gamma_plus({l.q0, l.q1, l.d1, l.d2}); }
Covector differential_minus(const DiscreteLagrangianAt& l) { return gamma_minus({l.q0, l.q1, l.d1, l.d2}); }

DiracStructure::DiracStructure(const ConstraintBlocks& constraints, int dimension)
    : rows_(constraints, dimension) {}

FlowEffortSpace DiracStructure::at(double t, const Vector& q) {
  return with_ports(t, q, Columns(q.size(), 0));
}

FlowEffortSpace DiracStructure::with_ports(double t, const Vector& q, const Columns& ports) {
  require_size("the rows of the ports", ports.rows(), q.size());
  const Columns one_forms = one_forms_at(rows_, t, q);
  return canonical_structure(one_forms, one_forms, ports);
}

Membership DiracStructure::membership(double t, const PhaseVelocity& x, const Covector& alpha) {
  const Columns one_forms = one_forms_at(rows_, t, x.q);
  const Covector flat = omega_flat(x);
  Vector c(rows_.rows());
  rows_.velocity_residual(x.q_rate, c);
  const double outside = std::max({outside_row_space(one_forms, alpha.xi - flat.xi),
                                   max_norm(alpha.eta - flat.eta), max_norm(alpha.x - flat.x)});
  const Vector momentum = alpha.y - flat.y;
  return {max_norm(c), std::max(outside, max_norm(momentum)),
          std::max(outside, outside_row_space(one_forms, momentum))};
}

DiscreteDiracStructure::DiscreteDiracStructure(const ConstraintBlocks& constraints, int dimension,
                                               const ConstraintRule& rule)
    : rows_(constraints, dimension),
      discrete_constraint_(constraints, dimension, rule),
      reversed_constraint_(constraints, dimension, mirrored(rule.nodes)),
      own_rows_(rule.own != nullptr) {}

Columns DiscreteDiracStructure::one_forms(double t, const Vector& q) { return one_forms_at(rows_, t, q); }

Vector DiscreteDiracStructure::discrete_constraint(Interval step, const Vector& q0, const Vector& q1,
                                                   bool holonomic_at_start) {
  Vector c(discrete_constraint_.rows());
  discrete_constraint_.residual(step, q0, q1, c);
  if (!holonomic_at_start) return c;
  int row = 0;
  for (const auto& block : rows_.distribution().blocks()) {
    if (block->holonomic()) block->position(step.start, q0, c.segment(row, block->rows()));
    row += block->rows();
  }
  return c;
}

double DiscreteDiracStructure::outside_annihilator(double t, const Vector& q, const Vector& covector) {
  return outside_row_space(one_forms(t, q), covector);
}

FlowEffortSpace DiscreteDiracStructure::plus_at(Interval step, const Vector& q0, const Vector& q1) {
  Vector d(discrete_constraint_.pattern().nonzeros());
  discrete_constraint_.end_derivative(step, q0, q1, d);
  return canonical_structure(discrete_constraint_.pattern().full(d), one_forms(step.start, q0),
                             Columns(q0.size(), 0));
}

FlowEffortSpace DiscreteDiracStructure::minus_at(Interval step, const Vector& q0, const Vector& q1) {
  return canonical_structure(start_derivative(step, q0, q1), one_forms(step.end(), q1),
                             Columns(q1.size(), 0));
}

/// Rows by a rule read the same backwards by the mirrored one, up to their sign.  Of rows of one's own only
/// ∂c/∂q1 is known: central differences, off by about 1e-10.
Columns DiscreteDiracStructure::start_derivative(Interval step, const Vector& q0, const Vector& q1) {
  if (!own_rows_) {
    Vector d(reversed_constraint_.pattern().nonzeros());
    reversed_constraint_.end_derivative({step.end(), -step.size}, q1, q0, d);
    return reversed_constraint_.pattern().full(d);
  }
  Columns derivative(rows(), q0.size());
  const double size = max_norm(q0);
  for (Eigen::Index i = 0; i < q0.size(); ++i) {
    const Vector change = Vector::Unit(q0.size(), i) * 1e-5 * size_beside(q0[i], size);
    derivative.col(i) = (discrete_constraint(step, q0 + change, q1, true) -
                         discrete_constraint(step, q0 - change, q1, true)) /
                        (2.0 * change[i]);
  }
  return derivative;
}

Membership DiscreteDiracStructure::plus(Interval step, const PhasePoint& z0, const PhasePoint& z1,
                                        const Covector& alpha) {
  const Covector flat = omega_flat_plus(z0, z1);
  const double outside = std::max({outside_annihilator(step.start, z0.q, alpha.xi - flat.xi),
                                   max_norm(alpha.eta - flat.eta), max_norm(alpha.x - flat.x)});
  const Vector momentum = alpha.y - flat.y;
  return {max_norm(discrete_constraint(step, z0.q, z1.q, false)), std::max(outside, max_norm(momentum)),
          std::max(outside, outside_annihilator(step.end(), z1.q, momentum))};
}

Membership DiscreteDiracStructure::minus(Interval step, const PhasePoint& z0, const PhasePoint& z1,
                                         const Covector& alpha) {
  const Covector flat = omega_flat_minus(z0, z1);
  const double outside = std::max({outside_annihilator(step.end(), z1.q, alpha.eta - flat.eta),
                                   max_norm(alpha.xi - flat.xi), max_norm(alpha.y - flat.y)});
  const Vector momentum = alpha.x - flat.x;
  return {max_norm(discrete_constraint(step, z0.q, z1.q, false)), std::max(outside, max_norm(momentum)),
          std::max(outside, outside_annihilator(step.start, z0.q, momentum))};
}

}  // namespace diracstep
