#include <Eigen/QR>
#include <algorithm>
#include <diracstep/core/dirac/dirac_structure.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/numerics/scales.hpp>

namespace diracstep {

Covector omega_flat(const PhaseVelocity& z) { return {z.q, z.p, -z.p_rate, z.q_rate}; }
Covector kappa(const PhaseVelocity& z) { return {z.q, z.q_rate, z.p_rate, z.p}; }
Covector gamma(const Covector& a) { return {a.x, a.eta, -a.xi, a.y}; }

Covector discrete_kappa(const PhasePoint& z0, const PhasePoint& z1) { return {z0.q, z1.q, -z0.p, z1.p}; }
Covector omega_flat_plus(const PhasePoint& z0, const PhasePoint& z1) { return {z0.q, z1.p, z0.p, z1.q}; }
Covector omega_flat_minus(const PhasePoint& z0, const PhasePoint& z1) { return {z0.p, z1.q, -z0.q, -z1.p}; }
Covector gamma_plus(const Covector& a) { return {a.x, a.eta, -a.xi, a.y}; }
Covector gamma_minus(const Covector& a) { return {-a.xi, a.y, -a.x, -a.eta}; }

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

DiscreteDiracStructure::DiscreteDiracStructure(const ConstraintBlocks& constraints, int dimension,
                                               const ConstraintRule& rule)
    : rows_(constraints, dimension), discrete_constraint_(constraints, dimension, rule) {}

double DiscreteDiracStructure::constraint_norm(Interval step, const Vector& q0, const Vector& q1) {
  Vector c(discrete_constraint_.rows());
  discrete_constraint_.residual(step, q0, q1, c);
  return max_norm(c);
}

double DiscreteDiracStructure::outside_annihilator(double t, const Vector& q, const Vector& covector) {
  if (rows_.rows() == 0) return max_norm(covector);
  rows_.evaluate(t, q);
  const Columns one_forms = rows_.pattern().full(rows_.coefficients()).transpose();
  const Vector lambda = one_forms.colPivHouseholderQr().solve(covector);
  return max_norm(covector - one_forms * lambda);
}

Membership DiscreteDiracStructure::plus(Interval step, const PhasePoint& z0, const PhasePoint& z1,
                                        const Covector& alpha) {
  const Covector flat = omega_flat_plus(z0, z1);
  const double outside = std::max({outside_annihilator(step.start, z0.q, alpha.xi - flat.xi),
                                   max_norm(alpha.eta - flat.eta), max_norm(alpha.x - flat.x)});
  const Vector momentum = alpha.y - flat.y;
  return {constraint_norm(step, z0.q, z1.q), std::max(outside, max_norm(momentum)),
          std::max(outside, outside_annihilator(step.end(), z1.q, momentum))};
}

Membership DiscreteDiracStructure::minus(Interval step, const PhasePoint& z0, const PhasePoint& z1,
                                         const Covector& alpha) {
  const Covector flat = omega_flat_minus(z0, z1);
  const double outside = std::max({outside_annihilator(step.end(), z1.q, alpha.eta - flat.eta),
                                   max_norm(alpha.xi - flat.xi), max_norm(alpha.y - flat.y)});
  const Vector momentum = alpha.x - flat.x;
  return {constraint_norm(step, z0.q, z1.q), std::max(outside, max_norm(momentum)),
          std::max(outside, outside_annihilator(step.start, z0.q, momentum))};
}

}  // namespace diracstep
