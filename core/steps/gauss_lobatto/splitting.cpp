#include <diracstep/core/numerics/lu.hpp>
#include <diracstep/core/steps/gauss_lobatto/splitting.hpp>

namespace diracstep {

StageSplitting::StageSplitting(const GaussLobattoTableau& table, int n, int m, bool holonomic)
    : s_(static_cast<int>(table.c.size())), n_(n), m_(m), impulse_weights_(table.e.leftCols(s_)) {
  constraint_weights_.setIdentity(s_, s_);
  if (holonomic) constraint_weights_ = table.lobatto_a.bottomRows(s_);
  if (m_ > 0) unmix_ = (constraint_weights_ * impulse_weights_).inverse();
  mass_.setZero(n_, n_);
  solution_.setZero(n_);
  rows_.setZero(m_, n_);
  response_.setZero(m_, m_);
  through_mass_.setZero(n_, m_);
  for (Columns* stages : {&velocities_, &forces_}) stages->setZero(n_, s_);
  for (Columns* stages : {&gaps_, &impulses_}) stages->setZero(m_, s_);
}

void StageSplitting::set_mass(const SparsityPattern& pattern, ConstVectorRef values) {
  Eigen::Index k = 0;
  const auto starts = pattern.column_starts();
  const auto rows = pattern.row_indices();
  for (int j = 0; j < n_; ++j)
    for (; k < starts[static_cast<std::size_t>(j) + 1]; ++k)
      mass_(rows[static_cast<std::size_t>(k)], j) = values[k];
  diagonal_ = mass_.isDiagonal(0.0);
  if (diagonal_)
    inverse_mass_ = mass_.diagonal().cwiseInverse();
  else
    mass_factors_.compute(mass_);
}

void StageSplitting::set_rows(int first, const SparsityPattern& pattern, ConstVectorRef values) {
  Eigen::Index k = 0;
  const auto starts = pattern.column_starts();
  const auto rows = pattern.row_indices();
  for (int j = 0; j < n_; ++j)
    for (; k < starts[static_cast<std::size_t>(j) + 1]; ++k)
      rows_(first + rows[static_cast<std::size_t>(k)], j) = values[k];
}

void StageSplitting::solve_mass(Columns& columns) {
  if (diagonal_) {
    for (Eigen::Index k = 0; k < columns.cols(); ++k) columns.col(k).array() *= inverse_mass_.array();
    return;
  }
  for (Eigen::Index k = 0; k < columns.cols(); ++k) {
    solve_into(mass_factors_, columns.col(k), solution_);
    columns.col(k) = solution_;
  }
}

void StageSplitting::factor_rows() {
  through_mass_ = rows_.transpose();
  solve_mass(through_mass_);
  response_ = rows_.lazyProduct(through_mass_);
  response_factors_.compute(response_);
}

void StageSplitting::solve(VectorRef& f) {
  velocities_ = f.head(n_ * s_).reshaped(n_, s_);
  solve_mass(velocities_);
  if (m_ > 0) {
    gaps_ = rows_.lazyProduct(velocities_);
    impulses_ = f.tail(m_ * s_).reshaped(m_, s_) - gaps_.lazyProduct(constraint_weights_.transpose());
    gaps_ = impulses_.lazyProduct(unmix_.transpose());
    solve_into(response_factors_, gaps_, impulses_);
    f.tail(m_ * s_) = impulses_.reshaped();
    gaps_ = impulses_.lazyProduct(impulse_weights_.transpose());
    forces_ = through_mass_.lazyProduct(gaps_);
    velocities_ += forces_;
  }
  f.head(n_ * s_) = velocities_.reshaped();
}

}  // namespace diracstep
