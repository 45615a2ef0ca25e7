#include <Eigen/Cholesky>
#include <Eigen/QR>
#include <diracstep/validation/references/group_lagrangian_dae.hpp>

namespace diracstep {

namespace {

/// A of a block of rows as a matrix; `b` is resized to its offsets.
Columns one_forms(const ConstraintRows& rows, double t, ConstVectorRef q, Vector& b) {
  Vector a(rows.pattern().nonzeros());
  b.resize(rows.rows());
  rows.coefficients(t, q, a, b);
  return rows.pattern().full(a);
}

/// ∂(ad*_v p)/∂v and ∂(ad*_v p)/∂p.
struct TurningDerivatives {
  Columns by_velocity, by_momentum;
};

TurningDerivatives turning_derivatives(const Space& space, ConstVectorRef v, ConstVectorRef p) {
  const Eigen::Index d = space.group_dimension();
  const auto n = static_cast<Eigen::Index>(space.tangent().size());
  Vector velocity(d), covector(d);
  space.embed(v, velocity);
  space.embed(p, covector);
  Columns k(d, d);
  space.coadjoint(covector, k);
  TurningDerivatives derivatives{k(space.tangent(), space.tangent()), Columns(n, n)};
  for (Eigen::Index j = 0; j < n; ++j) {
    space.coadjoint(Vector::Unit(d, space.tangent()[static_cast<std::size_t>(j)]), k);
    derivatives.by_momentum.col(j) = (k * velocity)(space.tangent());
  }
  return derivatives;
}

/// ∂(B w)/∂q along the space, N×n.
Columns motion_derivative(const Space& space, ConstVectorRef q, ConstVectorRef w) {
  Columns derivative(q.size(), w.size());
  for (Eigen::Index k = 0; k < q.size(); ++k)
    derivative.row(k) = w.transpose() * space.basis_curvature(q, Vector::Unit(q.size(), k));
  return derivative;
}

}  // namespace

GroupLagrangianDae::GroupLagrangianDae(const Scene& scene, DaeFormulation formulation)
    : scene_(scene),
      space_(*scene.space),
      formulation_(formulation),
      numbers_(scene.storage_size()),
      n_(scene.dimension()),
      force_(numbers_ + 2 * n_),
      drift_(force_ + scene.rows()),
      size_(dae_unknowns(scene, formulation)),
      pattern_(SparsityPattern::dense(size_, size_)) {}

ConstVectorRef GroupLagrangianDae::multipliers(ConstVectorRef y, ConstVectorRef rate) const {
  return formulation_ == DaeFormulation::index_2 ? y : rate;
}

Vector GroupLagrangianDae::moving_velocity(double t, ConstVectorRef y, ConstVectorRef multipliers) const {
  Vector w = y.segment(numbers_, n_), b;
  Eigen::Index drift = drift_;
  for (const auto& rows : scene_.constraints) {
    if (!stabilised(*rows, formulation_)) continue;
    w += one_forms(*rows, t, y.head(numbers_), b).transpose() * multipliers.segment(drift, rows->rows());
    drift += rows->rows();
  }
  return w;
}

void GroupLagrangianDae::residual(double t, ConstVectorRef y, ConstVectorRef rate, VectorRef f) {
  const auto q = y.head(numbers_), v = y.segment(numbers_, n_), p = y.segment(numbers_ + n_, n_);
  ConstVectorRef known = multipliers(y, rate);
  Vector lq(n_), lv(n_), b;
  scene_.lagrangian->gradient(t, q, v, lq, lv);
  f.segment(numbers_ + n_, n_) = p - lv;
  if (scene_.force) {
    scene_.force->value(t, q, v, lv);
    lq += lv;
  }
  scene_.add_turning(v, p, lq);
  f.head(numbers_) = rate.head(numbers_) - space_.tangent_basis(q) * moving_velocity(t, y, known);
  f.segment(numbers_, n_) = rate.segment(numbers_ + n_, n_) - lq;
  Eigen::Index force = force_, drift = drift_;
  for (const auto& rows : scene_.constraints) {
    const Eigen::Index m = rows->rows();
    const Columns a = one_forms(*rows, t, q, b);
    f.segment(numbers_, n_) -= a.transpose() * known.segment(force, m);
    f.segment(force, m) = a * v + b;
    force += m;
    if (!stabilised(*rows, formulation_)) continue;
    rows->position(t, q, f.segment(drift, m));
    drift += m;
  }
}

void GroupLagrangianDae::jacobian(double t, double cj, ConstVectorRef y, ConstVectorRef rate,
                                  VectorRef values) {
  const auto q = y.head(numbers_), v = y.segment(numbers_, n_), p = y.segment(numbers_ + n_, n_);
  ConstVectorRef known = multipliers(y, rate);
  const double of_multiplier = formulation_ == DaeFormulation::index_2 ? 1.0 : cj;
  const Columns basis = space_.tangent_basis(q);
  const Columns along = (basis.transpose() * basis).ldlt().solve(basis.transpose());  // B⁺
  auto j = values.reshaped(size_, size_);
  j.setZero();
  const Eigen::Index velocity = numbers_, momentum = numbers_ + n_;
  const SparsityPattern& hessian = scene_.lagrangian->pattern();
  Vector lqq(hessian.nonzeros()), lqv(lqq), lvv(lqq), b;
  scene_.lagrangian->hessian(t, q, v, lqq, lqv, lvv);
  Columns position_by_q = motion_derivative(space_, q, moving_velocity(t, y, known));
  Columns momentum_by_q = hessian.full(lqq), momentum_by_v = hessian.full(lqv);
  j.block(momentum, 0, n_, numbers_) = -momentum_by_v.transpose() * along;
  j.block(momentum, velocity, n_, n_) = -hessian.full(lvv);
  j.block(momentum, momentum, n_, n_).setIdentity();
  if (scene_.force) {
    Vector fq(scene_.force->pattern().nonzeros()), fv(fq);
    scene_.force->derivatives(t, q, v, fq, fv);
    momentum_by_q += scene_.force->pattern().full(fq);
    momentum_by_v += scene_.force->pattern().full(fv);
  }
  const TurningDerivatives turning = turning_derivatives(space_, v, p);
  Eigen::Index force = force_, drift = drift_;
  for (const auto& rows : scene_.constraints) {
    const Eigen::Index m = rows->rows();
    const Columns a = one_forms(*rows, t, q, b);
    Vector by_q(rows->pattern().nonzeros()), curvature(rows->curvature_pattern().nonzeros());
    rows->derivative(t, q, v, 1.0, by_q);
    j.block(force, 0, m, numbers_) = rows->pattern().full(by_q) * along;
    j.block(force, velocity, m, n_) = a;
    rows->annihilator_derivative(t, q, known.segment(force, m), curvature);
    momentum_by_q += rows->curvature_pattern().full(curvature);
    j.block(velocity, force, n_, m) = -of_multiplier * a.transpose();
    force += m;
    if (!stabilised(*rows, formulation_)) continue;
    rows->annihilator_derivative(t, q, known.segment(drift, m), curvature);
    position_by_q += basis * rows->curvature_pattern().full(curvature);
    j.block(0, drift, numbers_, m) = -of_multiplier * basis * a.transpose();
    j.block(drift, 0, m, numbers_) = a * along;
    drift += m;
  }
  j.topLeftCorner(numbers_, numbers_) = -position_by_q * along;
  j.topLeftCorner(numbers_, numbers_).diagonal().array() += cj;
  j.block(0, velocity, numbers_, n_) = -basis;
  j.block(velocity, 0, n_, numbers_) = -momentum_by_q * along;
  j.block(velocity, velocity, n_, n_) = -(momentum_by_v + turning.by_velocity);
  j.block(velocity, momentum, n_, n_) = -turning.by_momentum;
  j.block(velocity, momentum, n_, n_).diagonal().array() += cj;
  add_across(t, y, rate, basis, values);
}

/// What moves off the space change, which predicted numbers make: one or two directions, by differences.
void GroupLagrangianDae::add_across(double t, ConstVectorRef y, ConstVectorRef rate, const Columns& basis,
                                    VectorRef values) {
  constexpr double apart = 1e-6;
  const Columns q = basis.householderQr().householderQ() * Columns::Identity(numbers_, numbers_);
  auto j = values.reshaped(size_, size_);
  Vector ahead(size_), behind(size_), there = y;
  for (Eigen::Index k = n_; k < numbers_; ++k) {
    there.head(numbers_) = y.head(numbers_) + apart * q.col(k);
    residual(t, there, rate, ahead);
    there.head(numbers_) = y.head(numbers_) - apart * q.col(k);
    residual(t, there, rate, behind);
    j.leftCols(numbers_) += (ahead - behind) / (2.0 * apart) * q.col(k).transpose();
  }
}

}  // namespace diracstep
