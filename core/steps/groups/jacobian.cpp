#include <algorithm>
#include <diracstep/core/steps/groups/jacobian.hpp>

namespace diracstep {

namespace {

std::size_t place(int i) { return static_cast<std::size_t>(i); }

}  // namespace

template <int D>
void GroupJacobian<D>::take(ConstVectorRef x, ColumnsRef matrix) {
  const Eigen::Index d = stages_.space.group_dimension();
  matrix.setZero();
  parts_.resize(place(stages_.s));
  curvature_ = 0.0;
  for (int i = 0; i < stages_.s; ++i) take_gauss(i);
  for (int j = 0; stages_.m > 0 && j < stages_.s; ++j) take_lobatto(x, j);
  centre_carried_.resize(d, d);
  ends_along_.resize(d, d);
  stages_.space.coadjoint(stages_.centre.adjoint.transpose() * stages_.p0, centre_carried_);
  stages_.space.dtau_transposed_along(-stages_.centre.x, stages_.p0 + stages_.middle_momentum, ends_along_);
  for (int l = 0; l < stages_.s; ++l) {
    add_velocity_columns(l, matrix);
    if (stages_.m > 0) add_rows(l, matrix);
  }
  for (int j = 0; stages_.m > 0 && j < stages_.s; ++j) add_multiplier_columns(j, matrix);
}

/// With dg = centre, dτ_X along the chart: dπ = π_g dg + π_ξ dΞ, dF likewise.
template <int D>
void GroupJacobian<D>::take_gauss(int i) {
  const Eigen::Index d = stages_.space.group_dimension();
  const GroupNode<D>& node = stages_.gauss[place(i)];
  const GroupPoint<D>& point = stages_.points[place(i)];
  NodeParts& out = parts_[place(i)];
  point.derivatives(at_node_);
  curvature_ = std::max(curvature_, at_node_.curvature);
  const Square& along = node.along;
  Square momentum_along(d, d), force_along(d, d), hessian(d, d), carried(d, d);
  stages_.space.dtau_transposed_along(node.x, point.momentum(), momentum_along);
  stages_.space.dtau_transposed_along(node.x, point.force(), force_along);
  stages_.space.pairing_hessian(node.x, stages_.v.col(i), point.momentum(), hessian);
  stages_.space.coadjoint(node.carried, carried);
  out.gauss_motion.noalias() = node.adjoint_back * stages_.centre.dtau;
  const auto parts_of = [&](const Square& by_g, const Square& by_xi) {
    return Parts{by_g * out.gauss_motion, by_g * node.dtau + by_xi * along, by_xi * node.dtau};
  };
  const Parts momentum = parts_of(at_node_.momentum_g, at_node_.momentum_xi),
              force = parts_of(at_node_.force_g, at_node_.force_xi);
  out.momentum.centre.noalias() = node.dtau.transpose() * momentum.centre;
  out.momentum.chart = momentum_along + node.dtau.transpose() * momentum.chart;
  out.momentum.own.noalias() = node.dtau.transpose() * momentum.own;
  out.phi.centre = along.transpose() * momentum.centre + node.dtau.transpose() * force.centre;
  out.phi.chart =
      hessian + force_along + along.transpose() * momentum.chart + node.dtau.transpose() * force.chart;
  out.phi.own =
      momentum_along.transpose() + along.transpose() * momentum.own + node.dtau.transpose() * force.own;
  const double weight = stages_.step.size * stages_.table.b[i];
  out.force.centre = weight * node.adjoint_back.transpose() * force.centre;
  out.force.chart = weight * (node.adjoint_back.transpose() * force.chart - carried * node.dtau_back);
  out.force.own = weight * node.adjoint_back.transpose() * force.own;
}

template <int D>
void GroupJacobian<D>::take_lobatto(ConstVectorRef x, int j) {
  const Eigen::Index d = stages_.space.group_dimension();
  const GroupNode<D>& node = stages_.lobatto[place(j)];
  NodeParts& out = parts_[place(j)];
  Square derivative(d, d), along(d, d), carried(d, d);
  stages_.space.dtau_transposed_along(node.x, stages_.impulses.col(j), along);
  stages_.space.coadjoint(node.carried, carried);
  if (j == 0)
    derivative.setZero();  // the start does not move
  else
    stages_.rows[place(j)].impulse_derivative(node.t, node.q, stages_.multipliers(x, j), derivative);
  const Square by_centre = derivative * (node.adjoint_back * stages_.centre.dtau),
               by_chart = derivative * node.dtau;
  out.impulse.centre.noalias() = node.dtau.transpose() * by_centre;
  out.impulse.chart = along + node.dtau.transpose() * by_chart;
  const double weight = stages_.table.lobatto_b[j];
  out.impulse_carried.centre = weight * node.adjoint_back.transpose() * by_centre;
  out.impulse_carried.chart = weight * (node.adjoint_back.transpose() * by_chart - carried * node.dtau_back);
  const GroupNode<D>& end = stages_.lobatto[place(j) + 1];
  out.lobatto_motion.noalias() = end.adjoint_back * stages_.centre.dtau;
}

template <int D>
void GroupJacobian<D>::add_velocity_columns(int l, ColumnsRef matrix) {
  const double by_centre = stages_.of_centre(l);
  Square middle = by_centre * (centre_carried_ * stages_.centre.dtau);
  for (int i = 0; i < stages_.s; ++i) {
    const NodeParts& here = parts_[place(i)];
    middle += by_centre * here.force.centre + stages_.gauss[place(i)].alpha[l] * here.force.chart;
    if (i == l) middle += here.force.own;
    if (stages_.m == 0) continue;
    middle += by_centre * here.impulse_carried.centre +
              stages_.lobatto[place(i)].alpha[l] * here.impulse_carried.chart;
  }
  const Square ends = 0.5 * stages_.centre.dtau_back.transpose() * middle - 0.5 * by_centre * ends_along_;
  for (int k = 0; k < stages_.s; ++k) {
    const NodeParts& own = parts_[place(k)];
    Square row =
        by_centre * own.momentum.centre + stages_.gauss[place(k)].alpha[l] * own.momentum.chart - ends;
    if (k == l) row += own.momentum.own;
    for (int i = 0; i < stages_.s; ++i) {
      const NodeParts& here = parts_[place(i)];
      const double weight = stages_.gauss_weight(i, k);
      row += (weight * by_centre) * here.phi.centre +
             (weight * stages_.gauss[place(i)].alpha[l]) * here.phi.chart;
      if (i == l) row += weight * here.phi.own;
      if (stages_.m == 0) continue;
      const double of_impulse = stages_.lobatto_weight(i, k);
      row += (of_impulse * by_centre) * here.impulse.centre +
             (of_impulse * stages_.lobatto[place(i)].alpha[l]) * here.impulse.chart;
    }
    auto block = matrix.block(stages_.n * k, stages_.n * l, stages_.n, stages_.n);
    if (stages_.space.turns().empty())
      block = row;
    else
      block = row(stages_.space.tangent(), stages_.space.tangent());
  }
}

/// The rows of the constraints of all stages, by V_l.
template <int D>
void GroupJacobian<D>::add_rows(int l, ColumnsRef matrix) {
  const Eigen::Index d = stages_.space.group_dimension();
  typename GroupSizes<D>::Rows derivative(stages_.m, d);
  for (int i = 0; i < stages_.s; ++i) {
    if (stages_.has_nonholonomic()) {
      const GroupNode<D>& node = stages_.gauss[place(i)];
      const GroupRows<D>& rows = stages_.gauss_rows[place(i)];
      Square rate = node.alpha[l] * node.along;
      if (i == l) rate += node.dtau;
      rows.derivative(node.t, node.q, stages_.xi.col(i), derivative);
      add_row_columns(i, l, derivative * motion(node, parts_[place(i)].gauss_motion, l) + rows.forms() * rate,
                      false, matrix);
    }
    if (!stages_.has_holonomic()) continue;
    const GroupNode<D>& end = stages_.lobatto[place(i) + 1];
    end_rows_.evaluate(end.t, end.q);
    add_row_columns(i, l,
                    end_rows_.forms() * motion(end, parts_[place(i)].lobatto_motion, l) / stages_.step.size,
                    true, matrix);
  }
}

/// The rows of the constraint of stage k, those that are holonomic or the others.
template <int D>
void GroupJacobian<D>::add_row_columns(int k, int l, const typename GroupSizes<D>::Rows& values,
                                       bool of_holonomic, ColumnsRef matrix) {
  for (int r = 0; r < stages_.m; ++r)
    if (stages_.holonomic(r) == of_holonomic)
      matrix.block(stages_.n * stages_.s + stages_.m * k + r, stages_.n * l, 1, stages_.n) =
          values.row(r)(stages_.space.tangent());
}

template <int D>
void GroupJacobian<D>::add_multiplier_columns(int j, ColumnsRef matrix) {
  using Transposed = Eigen::Matrix<double, D, Eigen::Dynamic>;
  const GroupNode<D>& node = stages_.lobatto[place(j)];
  const Transposed forms = stages_.rows[place(j)].forms().transpose();
  const Transposed at_node = node.dtau.transpose() * forms;
  const Transposed ends = 0.5 * stages_.table.lobatto_b[j] * stages_.centre.dtau_back.transpose() *
                          (node.adjoint_back.transpose() * forms);
  for (int k = 0; k < stages_.s; ++k) {
    const Transposed row = stages_.lobatto_weight(j, k) * at_node - ends;
    matrix.block(stages_.n * k, stages_.n * stages_.s + stages_.m * j, stages_.n, stages_.m) =
        row(stages_.space.tangent(), Eigen::all);
  }
}

template class GroupJacobian<3>;
template class GroupJacobian<6>;
template class GroupJacobian<Eigen::Dynamic>;

}  // namespace diracstep
