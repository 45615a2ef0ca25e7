#include <algorithm>
#include <diracstep/core/steps/groups/jacobian.hpp>

namespace diracstep {

void GroupJacobian::take(ConstVectorRef x, ColumnsRef matrix) {
  matrix.setZero();
  take_derivatives(x);
  for (int l = 0; l < stages_.s; ++l) add_velocity_columns(l, matrix);
  for (int j = 0; stages_.m > 0 && j < stages_.s; ++j) add_multiplier_columns(j, matrix);
}

void GroupJacobian::take_derivatives(ConstVectorRef x) {
  const Eigen::Index d = stages_.space.group_dimension();
  derivatives_.resize(stages_.lobatto.size());
  curvature_ = 0.0;
  for (int i = 0; i < stages_.s; ++i) {
    const GroupNode& node = stages_.gauss[GroupStages::at(i)];
    NodeDerivatives& out = derivatives_[GroupStages::at(i)];
    for (Columns* matrix : {&out.along, &out.momentum_along, &out.force_along, &out.hessian, &out.carried})
      matrix->resize(d, d);
    stages_.points[GroupStages::at(i)].derivatives(out.of);
    stages_.space.dtau_along(node.x, stages_.v.col(i), out.along);
    stages_.space.dtau_transposed_along(node.x, stages_.points[GroupStages::at(i)].momentum(),
                                        out.momentum_along);
    stages_.space.dtau_transposed_along(node.x, stages_.points[GroupStages::at(i)].force(), out.force_along);
    stages_.space.pairing_hessian(node.x, stages_.v.col(i), stages_.points[GroupStages::at(i)].momentum(),
                                  out.hessian);
    stages_.space.coadjoint(node.carried, out.carried);
    curvature_ = std::max(curvature_, out.of.curvature);
  }
  lobatto_carried_.assign(stages_.lobatto.size(), Columns(d, d));
  for (int j = 0; stages_.m > 0 && j < stages_.s; ++j) {
    const GroupNode& node = stages_.lobatto[GroupStages::at(j)];
    NodeDerivatives& out = derivatives_[GroupStages::at(j)];
    out.impulse.resize(d, d);
    out.impulse_along.resize(d, d);
    stages_.rows[GroupStages::at(j)].impulse_derivative(node.t, node.q, stages_.multipliers(x, j),
                                                        out.impulse);
    stages_.space.dtau_transposed_along(node.x, stages_.impulses.col(j), out.impulse_along);
    stages_.space.coadjoint(node.carried, lobatto_carried_[GroupStages::at(j)]);
  }
  centre_carried_.resize(d, d);
  ends_along_.resize(d, d);
  stages_.space.coadjoint(stages_.centre.adjoint.transpose() * stages_.p0, centre_carried_);
  stages_.space.dtau_transposed_along(-stages_.y, stages_.p0 + stages_.middle_momentum, ends_along_);
}

/// How the configuration at a node moves in the body as V_l does.
Columns GroupJacobian::motion_of(const GroupNode& node, int l) const {
  return stages_.of_centre(l) * (node.adjoint_back * stages_.centre.dtau) + node.alpha[l] * node.dtau;
}

void GroupJacobian::add_velocity_columns(int l, ColumnsRef matrix) {
  const Eigen::Index d = stages_.space.group_dimension();
  Columns middle = stages_.of_centre(l) * (centre_carried_ * stages_.centre.dtau);
  std::vector<Columns> phi(GroupStages::at(stages_.s)), momentum(GroupStages::at(stages_.s)),
      impulse(GroupStages::at(stages_.s));
  Columns row_derivative(stages_.m, d);
  for (int i = 0; i < stages_.s; ++i) {
    const GroupNode& node = stages_.gauss[GroupStages::at(i)];
    const NodeDerivatives& here = derivatives_[GroupStages::at(i)];
    const Columns motion = motion_of(node, l);
    Columns rate = node.alpha[l] * here.along;
    if (i == l) rate += node.dtau;
    const Columns dp = here.of.momentum_g * motion + here.of.momentum_xi * rate;
    const Columns df = here.of.force_g * motion + here.of.force_xi * rate;
    momentum[GroupStages::at(i)] = node.alpha[l] * here.momentum_along + node.dtau.transpose() * dp;
    phi[GroupStages::at(i)] = node.alpha[l] * (here.hessian + here.force_along) +
                              here.along.transpose() * dp + node.dtau.transpose() * df;
    if (i == l) phi[GroupStages::at(i)] += here.momentum_along.transpose();
    middle += stages_.step.size * stages_.table.b[i] *
              (node.adjoint_back.transpose() * df - node.alpha[l] * (here.carried * node.dtau_back));
    if (!stages_.has_nonholonomic()) continue;
    stages_.gauss_rows[GroupStages::at(i)].derivative(node.t, node.q, stages_.xi.col(i), row_derivative);
    add_row_columns(i, l, row_derivative * motion + stages_.gauss_rows[GroupStages::at(i)].forms() * rate,
                    false, matrix);
  }
  for (int j = 0; stages_.m > 0 && j < stages_.s; ++j) {
    const GroupNode& node = stages_.lobatto[GroupStages::at(j)];
    const NodeDerivatives& here = derivatives_[GroupStages::at(j)];
    const Columns moved = j == 0 ? Columns::Zero(d, d) : Columns(here.impulse * motion_of(node, l));
    impulse[GroupStages::at(j)] = node.alpha[l] * here.impulse_along + node.dtau.transpose() * moved;
    middle += stages_.table.lobatto_b[j] *
              (node.adjoint_back.transpose() * moved -
               node.alpha[l] * (lobatto_carried_[GroupStages::at(j)] * node.dtau_back));
    if (!stages_.has_holonomic()) continue;
    const GroupNode& end = stages_.lobatto[GroupStages::at(j) + 1];
    end_rows_.evaluate(end.t, end.q);
    add_row_columns(j, l, end_rows_.forms() * motion_of(end, l) / stages_.step.size, true, matrix);
  }
  const Columns ends =
      0.5 * stages_.centre.dtau_back.transpose() * middle - 0.5 * stages_.of_centre(l) * ends_along_;
  for (int k = 0; k < stages_.s; ++k) {
    Columns row = momentum[GroupStages::at(k)] - ends;
    for (int i = 0; i < stages_.s; ++i) row += stages_.gauss_weight(i, k) * phi[GroupStages::at(i)];
    for (int j = 0; stages_.m > 0 && j < stages_.s; ++j)
      row += stages_.lobatto_weight(j, k) * impulse[GroupStages::at(j)];
    matrix.block(stages_.n * k, stages_.n * l, stages_.n, stages_.n) =
        row(stages_.space.tangent(), stages_.space.tangent());
  }
}

/// The rows of the constraint of stage k, those that are holonomic or the others.
void GroupJacobian::add_row_columns(int k, int l, const Columns& values, bool of_holonomic,
                                    ColumnsRef matrix) {
  for (int r = 0; r < stages_.m; ++r)
    if (stages_.holonomic(r) == of_holonomic)
      matrix.block(stages_.n * stages_.s + stages_.m * k + r, stages_.n * l, 1, stages_.n) =
          values.row(r)(stages_.space.tangent());
}

void GroupJacobian::add_multiplier_columns(int j, ColumnsRef matrix) {
  const GroupNode& node = stages_.lobatto[GroupStages::at(j)];
  const Columns forms = stages_.rows[GroupStages::at(j)].forms().transpose();
  const Columns at_node = node.dtau.transpose() * forms;
  const Columns ends = 0.5 * stages_.table.lobatto_b[j] * stages_.centre.dtau_back.transpose() *
                       (node.adjoint_back.transpose() * forms);
  for (int k = 0; k < stages_.s; ++k) {
    const Columns row = stages_.lobatto_weight(j, k) * at_node - ends;
    matrix.block(stages_.n * k, stages_.n * stages_.s + stages_.m * j, stages_.n, stages_.m) =
        row(stages_.space.tangent(), Eigen::all);
  }
}

}  // namespace diracstep
