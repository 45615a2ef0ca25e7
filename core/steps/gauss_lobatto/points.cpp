#include <diracstep/core/steps/gauss_lobatto/points.hpp>

namespace diracstep {

void NodeWeights::scale(double h, const Columns& a, const Columns& a_hat) {
  const Eigen::Index s = a.rows();
  position = h * a.transpose();
  force = -h * a_hat.transpose();
  stiffness.resize(s, s * s);
  for (Eigen::Index i = 0; i < s; ++i)
    for (Eigen::Index k = 0; k < s; ++k)
      for (Eigen::Index j = 0; j < s; ++j) stiffness(j, i * s + k) = -h * h * a_hat(i, j) * a(j, k);
}

StageWeights::StageWeights(int s) : table(gauss_lobatto_tableau(s)) {
  impulse = -table.e.leftCols(s).transpose();
  row_curvature.setZero(s, s * s);
  scale_to(1.0);
}

void StageWeights::scale_to(double h) {
  if (h == step_) return;
  step_ = h;
  scale(h, table.a, table.a_hat);
  lobatto = h * table.lobatto_a.transpose();
  end_force = h * table.b;
  const Eigen::Index s = table.c.size();
  for (Eigen::Index i = 0; i < s; ++i)
    for (Eigen::Index k = 0; k < s; ++k)
      for (Eigen::Index j = 0; j < s; ++j)
        row_curvature(j, i * s + k) = -h * table.e(i, j) * table.lobatto_a(j, k);
}

NodePoints::NodePoints(int stages, int dimension) {
  gauss.setZero(dimension, stages);
  gauss_times.setZero(stages);
}

StagePoints::StagePoints(int stages, int dimension) : NodePoints(stages, dimension), weights(stages) {
  lobatto.setZero(dimension, stages + 1);
  lobatto_times.setZero(stages + 1);
}

void StagePoints::begin(Interval interval) {
  step = interval;
  weights.scale_to(step.size);
  const GaussLobattoTableau& table = weights.table;
  for (Eigen::Index i = 0; i < gauss_times.size(); ++i) gauss_times[i] = step.start + table.c[i] * step.size;
  for (Eigen::Index j = 0; j < lobatto_times.size(); ++j)
    lobatto_times[j] = step.start + table.lobatto_c[j] * step.size;
}

}  // namespace diracstep
