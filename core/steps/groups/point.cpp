#include <algorithm>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/steps/groups/point.hpp>

namespace diracstep {

namespace {

Vector unit(const Space& space, int a) { return Vector::Unit(space.group_dimension(), a); }

/// ad*_{e_a} c
Vector coadjoint_unit(const Space& space, int a, const Vector& c) {
  Columns k(c.size(), c.size());
  space.coadjoint(c, k);
  return k.col(a);
}

/// Values on a pattern over the components of velocities, as a matrix over group columns.
template <class Square>
void embed_values(const Space& space, const SparsityPattern& pattern, const Vector& values, Square& whole) {
  const Eigen::Index n = pattern.rows();
  if (values.size() == n * n && whole.rows() == n)  // full, and no turns
    whole = values.reshaped(n, n);
  else
    embed_block(space, pattern.full(values), whole);
}

}  // namespace

template <int D>
GroupPoint<D>::GroupPoint(const Scene& scene)
    : scene_(scene), space_(*scene.space), v_(Vector::Zero(scene.dimension())) {
  own_force_ = lq_ = lv_ = v_;
  qq_ = qv_ = vv_ = Vector::Zero(scene.lagrangian->pattern().nonzeros());
  momentum_ = force_ = xi_ = Column::Zero(space_.group_dimension());
}

template <int D>
void GroupPoint<D>::evaluate(double t, ConstVectorRef q, const Column& xi) {
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

template <int D>
void GroupPoint<D>::derivatives(Derivatives& out) const {
  const Eigen::Index d = space_.group_dimension();
  for (Square* matrix : {&out.momentum_g, &out.momentum_xi, &out.force_g, &out.force_xi})
    matrix->resize(d, d);
  const SparsityPattern& pattern = scene_.lagrangian->pattern();
  scene_.lagrangian->hessian(t_, q_, v_, qq_, qv_, vv_);
  out.curvature = max_norm(qq_);
  embed_values(space_, pattern, qq_, out.force_g);
  embed_values(space_, pattern, qv_, out.force_xi);
  embed_values(space_, pattern, vv_, out.momentum_xi);
  out.momentum_g = out.force_xi.transpose();
  if (scene_.force) {
    const SparsityPattern& own = scene_.force->pattern();
    Vector by_q(own.nonzeros()), by_v(by_q);
    scene_.force->derivatives(t_, q_, v_, by_q, by_v);
    out.curvature = std::max(out.curvature, max_norm(by_q));
    Square added(d, d);
    embed_values(space_, own, by_q, added);
    out.force_g += added;
    embed_values(space_, own, by_v, added);
    out.force_xi += added;
  }
  if (!space_.turns().empty()) add_turns(out);
}

template <int D>
void GroupPoint<D>::add_turns(Derivatives& out) const {
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

template <int D>
GroupRows<D>::GroupRows(const Scene& scene)
    : scene_(scene),
      space_(*scene.space),
      a_(Rows::Zero(scene.rows(), space_.group_dimension())),
      b_(Vector::Zero(scene.rows())) {
  for (const auto& block : scene.constraints)
    holonomic_.insert(holonomic_.end(), static_cast<std::size_t>(block->rows()), block->holonomic());
}

template <int D>
void GroupRows<D>::evaluate(double t, ConstVectorRef q) {
  int row = 0;
  for (const auto& block : scene_.constraints) {
    const int m = block->rows();
    Vector values(block->pattern().nonzeros());
    block->coefficients(t, q, values, b_.segment(row, m));
    a_.middleRows(row, m)(Eigen::all, space_.tangent()) = block->pattern().full(values);
    row += m;
  }
}

template <int D>
void GroupRows<D>::positions(double t, ConstVectorRef q, VectorRef phi) const {
  phi.setZero();
  int row = 0;
  for (const auto& block : scene_.constraints) {
    if (block->holonomic()) block->position(t, q, phi.segment(row, block->rows()));
    row += block->rows();
  }
}

template <int D>
void GroupRows<D>::derivative(double t, ConstVectorRef q, const Column& xi, Rows& out) const {
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

template <int D>
void GroupRows<D>::impulse_derivative(double t, ConstVectorRef q, ConstVectorRef lambda, Square& out) const {
  const int n = scene_.dimension();
  Columns sum = Columns::Zero(n, n);
  int row = 0;
  for (const auto& block : scene_.constraints) {
    Vector values(block->curvature_pattern().nonzeros());
    block->annihilator_derivative(t, q, lambda.segment(row, block->rows()), values);
    sum += block->curvature_pattern().full(values);
    row += block->rows();
  }
  embed_block(space_, sum, out);
  for (const int a : space_.turns()) out.col(a) = coadjoint_unit(space_, a, impulse(lambda));
}

template class GroupPoint<3>;
template class GroupPoint<6>;
template class GroupPoint<Eigen::Dynamic>;
template class GroupRows<3>;
template class GroupRows<6>;
template class GroupRows<Eigen::Dynamic>;

}  // namespace diracstep
