#include <cmath>
#include <diracstep/core/numerics/combination.hpp>
#include <diracstep/core/numerics/lu.hpp>
#include <diracstep/core/steps/gauss_lobatto/splitting.hpp>

namespace diracstep {

namespace {

int count_rows(const std::vector<StageRows>& rows) {
  int count = 0;
  for (const StageRows& block : rows) count += block.rows().rows();
  return count;
}

/// Row a of values on the pattern becomes column first + a.
void place_rows(const SparsityPattern& pattern, const double* values, int first, Columns& columns) {
  const auto starts = pattern.column_starts();
  const auto rows = pattern.row_indices();
  int k = 0;
  for (int i = 0; i < pattern.columns(); ++i)
    for (; k < starts[static_cast<std::size_t>(i) + 1]; ++k)
      columns(i, first + rows[static_cast<std::size_t>(k)]) = values[k];
}

}  // namespace

StageSplitting::StageSplitting(const GaussLobattoTableau& table, const std::vector<StageRows>& rows,
                               const Lagrangian& lagrangian)
    : s_(static_cast<int>(table.c.size())),
      n_(lagrangian.dimension()),
      m_(count_rows(rows)),
      mass_constant_(lagrangian.structure().y_hessian_constant),
      sum_(stage_sum(n_, s_)),
      impulse_weights_(table.e.leftCols(s_).transpose()),
      constraint_weights_(table.lobatto_a.bottomRows(s_).transpose()),
      response_factors_(s_ * m_) {
  for (const StageRows& block : rows) {
    const bool holonomic = block.rows().holonomic();
    Columns response = table.e.leftCols(s_);
    if (holonomic) response = table.lobatto_a.bottomRows(s_) * table.e.leftCols(s_);
    blocks_.push_back({block.first(), block.rows().rows(), holonomic, response});
  }
  for (Columns* square : {&mass_, &inverse_}) square->setZero(n_, n_);
  solution_.setZero(n_);
  for (Columns* columns : {&forms_, &through_mass_}) columns->setZero(n_, s_ * m_);
  response_.setZero(s_ * m_, s_ * m_);
  for (Columns* stages : {&mixed_, &impulses_}) stages->setZero(n_, s_);
}

void StageSplitting::take_mass(const StagePoints& at, StageMomentum& momentum, ConstVectorRef x) {
  if (mass_known_) return;
  const int middle = s_ / 2;
  momentum.second_derivatives(at, x, middle);
  set_mass(momentum.pattern(), momentum.mass(middle));
  mass_known_ = mass_constant_ && momentum.mass(middle).allFinite();
}

const Columns& StageSplitting::inverse_mass(const StagePoints& at, StageMomentum& momentum,
                                            ConstVectorRef x) {
  if (mass_known_) return inverse_;
  take_mass(at, momentum, x);
  inverse_.setIdentity();
  for (int k = 0; k < n_; ++k) solve_mass(inverse_.col(k).data());
  return inverse_;
}

void StageSplitting::move_to(const StagePoints& at, StageMomentum& momentum, std::vector<StageRows>& rows,
                             ConstVectorRef x) {
  take_mass(at, momentum, x);
  if (m_ == 0) return;
  through_mass_.setZero();  // entries outside the pattern are those of the last one
  for (StageRows& block : rows) {
    block.evaluate_constraint(at);
    for (int j = 0; j < s_; ++j) {
      const int first = m_ * j + block.first();
      place_rows(block.rows().pattern(), block.constraint(j).data(), first, forms_);
      place_rows(block.rows().pattern(), block.lobatto(j).data(), first, through_mass_);
    }
  }
  factor_rows();
}

/// Puts values of M on its pattern in place and factors it.
void StageSplitting::set_mass(const SparsityPattern& pattern, ConstVectorRef values) {
  place_rows(pattern, values.data(), 0, mass_);  // M is symmetric
  diagonal_ = mass_.isDiagonal(0.0);
  if (diagonal_)
    inverse_mass_ = mass_.diagonal().cwiseInverse();
  else
    mass_factors_.compute(mass_);
}

void StageSplitting::solve_mass(double* column) {
  if (diagonal_) {
    for (int i = 0; i < n_; ++i) column[i] *= inverse_mass_[i];
    return;
  }
  auto x = Vector::Map(column, n_);
  solve_into(mass_factors_, x, solution_);
  x = solution_;
}

double StageSplitting::dot(const double* a, const double* b) const {
  double sum = 0.0;
  for (int i = 0; i < n_; ++i) sum += a[i] * b[i];
  return sum;
}

void StageSplitting::factor_rows() {
  for (int l = 0; l < s_ * m_; ++l) solve_mass(through_mass_.col(l).data());
  for (int l = 0; l < s_; ++l)
    for (int b = 0; b < m_; ++b) {
      const double* const through_mass = through_mass_.col(m_ * l + b).data();
      double* const column = response_.col(m_ * l + b).data();
      for (const Block& block : blocks_)
        for (int j = 0; j < s_; ++j)
          for (int a = block.first; a < block.first + block.rows; ++a)
            column[m_ * j + a] = block.response(j, l) * dot(forms_.col(m_ * j + a).data(), through_mass);
    }
  regular_ = response_factors_.factor(response_.data());
}

/// y_i = base_i + Σ_k weights(k, i) x_k.
void StageSplitting::sum_stages(const double* x, const Columns& weights, const double* base,
                                double* y) const {
  if (sum_ != nullptr) return sum_(x, weights.data(), base, n_, y);
  for (int i = 0; i < s_; ++i)
    combine(n_, s_, weights.col(i).data(), x, base + static_cast<long>(n_) * i,
            y + static_cast<long>(n_) * i);
}

void StageSplitting::solve(VectorRef& f) {
  double* const velocities = f.data();
  for (int i = 0; i < s_; ++i) solve_mass(velocities + static_cast<long>(n_) * i);
  if (m_ == 0) return;
  double* const multipliers = velocities + static_cast<long>(n_) * s_;
  if (!regular_) {
    f.setConstant(std::nan(""));
    return;
  }
  for (const Block& block : blocks_) {
    if (block.holonomic) {
      impulses_.setZero();
      sum_stages(velocities, constraint_weights_, impulses_.data(), mixed_.data());
    }
    const double* const weighted = block.holonomic ? mixed_.data() : velocities;
    for (int j = 0; j < s_; ++j)
      for (int a = block.first; a < block.first + block.rows; ++a)
        multipliers[m_ * j + a] -= dot(forms_.col(m_ * j + a).data(), weighted + static_cast<long>(n_) * j);
  }
  response_factors_.solve(multipliers);
  for (int l = 0; l < s_; ++l) {
    double* const impulse = impulses_.col(l).data();
    for (int i = 0; i < n_; ++i) impulse[i] = 0.0;
    for (int b = m_ * l; b < m_ * (l + 1); ++b)
      for (int i = 0; i < n_; ++i) impulse[i] += through_mass_(i, b) * multipliers[b];
  }
  sum_stages(impulses_.data(), impulse_weights_, velocities, velocities);
}

}  // namespace diracstep
