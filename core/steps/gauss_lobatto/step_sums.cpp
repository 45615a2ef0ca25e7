#include <diracstep/core/numerics/combination.hpp>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/steps/gauss_lobatto/step_sums.hpp>

namespace diracstep {

StepSums::StepSums(int stages, int dimension, int rows)
    : s_(stages), n_(dimension), m_(rows), sum_(stage_sum(dimension, stages)) {}

void StepSums::move(StagePoints& points, ConstVectorRef x) {
  const int first_lobatto = m_ > 0 ? 1 : s_ + 1;
  if (compensated_) {
    const ExtendedGaussLobattoTableau& table = compensated_->table;
    const auto start = points.lobatto.col(0);
    const double h = points.step.size;
    for (int i = 0; i < s_; ++i)
      compensated_->position(h, table.a.row(i), start, velocities(x), points.gauss.col(i));
    for (int j = first_lobatto; j <= s_; ++j)
      compensated_->position(h, table.lobatto_a.row(j), start, velocities(x), points.lobatto.col(j));
    return;
  }
  const StageWeights& weights = points.weights;
  const double* const q0 = points.lobatto.data();
  if (sum_ != nullptr) {
    sum_(x.data(), weights.position.data(), q0, 0, points.gauss.data());
    if (m_ > 0) sum_(x.data(), &weights.lobatto(0, 1), q0, 0, &points.lobatto(0, 1));
    return;
  }
  for_each_piece(n_, [&](int first, int rows) {
    for (int i = 0; i < s_; ++i)
      combine_piece(first, rows, n_, s_, &weights.position(0, i), x.data(), q0, &points.gauss(0, i));
    for (int j = first_lobatto; j <= s_; ++j)
      combine_piece(first, rows, n_, s_, &weights.lobatto(0, j), x.data(), q0, &points.lobatto(0, j));
  });
}

void StepSums::momentum_rows(const StagePoints& points, const StageColumns& stages, const Vector& p0,
                             VectorRef& f) {
  if (compensated_) {
    for (int i = 0; i < s_; ++i)
      compensated_->momentum_row(i, points.step.size, stages.momenta.col(i), p0, stages.forces,
                                 stages.impulses, f.segment(n_ * i, n_));
    return;
  }
  if (sum_ == nullptr) {
    for (int i = 0; i < s_; ++i)
      long_momentum_row(points, stages, p0, i, f.data() + static_cast<long>(n_) * i);
    return;
  }
  double* const rows = f.data();
  const double* lv = stages.momenta.data();
  for (int i = 0; i < s_; ++i)
    for (int k = 0; k < n_; ++k) rows[n_ * i + k] = *lv++ - p0[k];
  sum_(stages.forces.data(), points.weights.force.data(), rows, n_, rows);
  if (m_ > 0) sum_(stages.impulses.data(), points.weights.impulse.data(), rows, n_, rows);
}

void StepSums::long_momentum_row(const StagePoints& points, const StageColumns& stages, const Vector& p0,
                                 int i, double* row) const {
  const auto lv = stages.momenta.col(i);
  const StageWeights& weights = points.weights;
  for_each_piece(n_, [&](int first, int rows) {
    for (int k = first; k < first + rows; ++k) row[k] = lv[k] - p0[k];
    combine_piece(first, rows, n_, s_, &weights.force(0, i), stages.forces.data(), row, row);
    if (m_ > 0) combine_piece(first, rows, n_, s_, &weights.impulse(0, i), stages.impulses.data(), row, row);
  });
}

void StepSums::end(const StagePoints& points, const StageColumns& stages, const Vector& p0, ConstVectorRef x,
                   StepEnd& end) {
  const auto q0 = points.lobatto.col(0);
  if (compensated_)
    return compensated_->end(points.step.size, q0, p0, velocities(x), stages.forces, stages.impulses, end);
  const StageWeights& weights = points.weights;
  end.at.q.resize(n_);
  end.at.p.resize(n_);
  double* const p1 = end.at.p.data();
  if (m_ > 0) end.at.q = points.lobatto.col(s_);
  for_each_piece(n_, [&](int first, int rows) {
    if (m_ == 0)  // nothing else looks there
      combine_piece(first, rows, n_, s_, &weights.lobatto(0, s_), x.data(), q0.data(), end.at.q.data());
    combine_piece(first, rows, n_, s_, weights.end_force.data(), stages.forces.data(), p0.data(), p1);
    if (m_ > 0)
      combine_piece(first, rows, n_, s_, weights.table.lobatto_b.data(), stages.impulses.data(), p1, p1);
  });
}

}  // namespace diracstep
