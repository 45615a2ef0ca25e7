#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/steps/groups/point.hpp>

namespace diracstep {

namespace {

/// A matrix over components of velocities as one over group columns, others zero.
Columns embedded(const Space& space, const Columns& of_velocities) {
  Columns whole = Columns::Zero(space.group_dimension(), space.group_dimension());
  whole(space.tangent(), space.tangent()) = of_velocities;
  return whole;
}

Vector unit(const Space& space, int a) { return Vector::Unit(space.group_dimension(), a); }

/// ad*_{e_a} c
Vector coadjoint_unit(const Space& space, int a, const Vector& c) {
  Columns k(c.size(), c.size());
  space.coadjoint(c, k);
  return k.col(a);
}

}  // namespace

GroupPoint::GroupPoint(const Scene& scene)
    : scene_(scene), space_(*scene.space), v_(Vector::Zero(scene.dimension())) {
  own_force_ = lq_ = lv_ = v_;
  momentum_ = force_ = Vector::Zero(space_.group_dimension());
}

void GroupPoint::evaluate(double t, ConstVectorRef q, ConstVectorRef xi) {
  t_ = t;
  q_ = q;
  xi_ = xi;
  space_.restrict(xi, v_);
  scene_.lagrangian->gradient(t, q, v_, lq_, lv_);
  space_.embed(lv_, momentum_);
  if (scene_.force) {
    scene_.force->value(t, q, v_, own_force_);
    lq_ += own_force_;
  }
  space_.embed(lq_, force_);
  for (const int a : space_.turns()) force_[a] = momentum_.dot(space_.bracket(unit(space_, a), xi_));
}

void GroupPoint::derivatives(Derivatives& out) const {
  const Lagrangian& lagrangian = *scene_.lagrangian;
  const SparsityPattern& pattern = lagrangian.pattern();
  Vector qq(pattern.nonzeros()), qv(qq), vv(qq);
  lagrangian.hessian(t_, q_, v_, qq, qv, vv);
  out.curvature = max_norm(qq);
  const Columns by_qv = embedded(space_, pattern.full(qv));
  out.momentum_xi = embedded(space_, pattern.full(vv));
  out.momentum_g = by_qv.transpose();
  out.force_g = embedded(space_, pattern.full(qq));
  out.force_xi = by_qv;
  if (scene_.force) {
    const SparsityPattern& own = scene_.force->pattern();
    Vector by_q(own.nonzeros()), by_v(by_q);
    scene_.force->derivatives(t_, q_, v_, by_q, by_v);
    out.force_g += embedded(space_, own.full(by_q));
    out.force_xi += embedded(space_, own.full(by_v));
  }
  for (const int a : space_.turns()) {
    const Vector turned = space_.bracket(unit(space_, a), xi_);
    out.force_g.row(a) = turned.transpose() * out.momentum_g;
    out.force_xi.row(a) = turned.transpose() * out.momentum_xi;
    for (const int j : space_.tangent())
      out.force_xi(a, j) += momentum_.dot(space_.bracket(unit(space_, a), unit(space_, j)));
  }
  for (const int a : space_.turns()) {
    const Vector turned = space_.bracket(unit(space_, a), xi_);
    out.momentum_g.col(a) = coadjoint_unit(space_, a, momentum_) + out.momentum_xi * turned;
    out.force_g.col(a) = coadjoint_unit(space_, a, force_) + out.force_xi * turned;
  }
}

GroupRows::GroupRows(const Scene& scene)
    : scene_(scene),
      space_(*scene.space),
      a_(Columns::Zero(scene.rows(), space_.group_dimension())),
      b_(Vector::Zero(scene.rows())) {
  for (const auto& block : scene.constraints)
    holonomic_.insert(holonomic_.end(), static_cast<std::size_t>(block->rows()), block->holonomic());
}

void GroupRows::evaluate(double t, ConstVectorRef q) {
  int row = 0;
  for (const auto& block : scene_.constraints) {
    const int m = block->rows();
    Vector values(block->pattern().nonzeros());
    block->coefficients(t, q, values, b_.segment(row, m));
    a_.middleRows(row, m)(Eigen::all, space_.tangent()) = block->pattern().full(values);
    row += m;
  }
}

void GroupRows::positions(double t, ConstVectorRef q, VectorRef phi) const {
  phi.setZero();
  int row = 0;
  for (const auto& block : scene_.constraints) {
    if (block->holonomic()) block->position(t, q, phi.segment(row, block->rows()));
    row += block->rows();
  }
}

void GroupRows::derivative(double t, ConstVectorRef q, ConstVectorRef xi, ColumnsRef out) const {
  Vector v(scene_.dimension());
  space_.restrict(xi, v);
  out.setZero();
  int row = 0;
  for (const auto& block : scene_.constraints) {
    const int m = block->rows();
    Vector values(block->pattern().nonzeros());
    block->derivative(t, q, v, 1.0, values);
    out.middleRows(row, m)(Eigen::all, space_.tangent()) = block->pattern().full(values);
    row += m;
  }
  for (const int a : space_.turns()) out.col(a) = a_ * space_.bracket(unit(space_, a), xi);
}

void GroupRows::impulse_derivative(double t, ConstVectorRef q, ConstVectorRef lambda, ColumnsRef out) const {
  const int n = scene_.dimension();
  Columns sum = Columns::Zero(n, n);
  int row = 0;
  for (const auto& block : scene_.constraints) {
    Vector values(block->curvature_pattern().nonzeros());
    block->annihilator_derivative(t, q, lambda.segment(row, block->rows()), values);
    sum += block->curvature_pattern().full(values);
    row += block->rows();
  }
  out = embedded(space_, sum);
  for (const int a : space_.turns()) out.col(a) = coadjoint_unit(space_, a, impulse(lambda));
}

}  // namespace diracstep
