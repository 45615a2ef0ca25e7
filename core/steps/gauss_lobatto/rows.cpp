#include <algorithm>
#include <cmath>
#include <diracstep/core/numerics/combination.hpp>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/steps/gauss_lobatto/rows.hpp>
#include <utility>

namespace diracstep {

StageRows::StageRows(std::shared_ptr<const ConstraintRows> rows, int stages, int first, int stride)
    : rows_(std::move(rows)),
      s_(stages),
      n_(rows_->dimension()),
      first_(first),
      stride_(stride),
      leading_(rows_->pattern()) {
  const int nonzeros = rows_->pattern().nonzeros(), curved = curvature_pattern().nonzeros();
  at_lobatto_.setZero(nonzeros, s_ + 1);
  at_gauss_.setZero(nonzeros, s_);
  curvature_.setZero(curved, s_);
  derivative_.setZero(nonzeros, s_);
  sum_.setZero(curved);
  for (Columns* at_nodes : {&offset_, &positions_, &multipliers_}) at_nodes->setZero(rows_->rows(), s_);
  lambda_.setZero(rows_->rows());
  start_curvature_.setZero(rows_->curvature_pattern().nonzeros());
}

const SparsityPattern& StageRows::curvature_pattern() const {
  static const SparsityPattern none;
  return s_ > 1 ? rows_->curvature_pattern() : none;
}

void StageRows::plan(BlockPattern& layout) {
  const SparsityPattern& a = rows_->pattern();
  for (int i = 0; i < s_; ++i)
    for (int k = 0; k < s_; ++k) {
      const int number = layout.add(a, n_ * i, first_ + stride_ * k, true);
      if (first_layout_ < 0) first_layout_ = number;
      layout.add(curvature_pattern(), n_ * i, n_ * k);
      layout.add(a, first_ + stride_ * i, n_ * k);
    }
}

void StageRows::evaluate_lobatto(const StagePoints& at, int first, int count) {
  rows_->coefficients_at(at.at_lobatto(first, count), at_lobatto_.col(first).data(), offset_.data());
}

void StageRows::add_impulses(const StagePoints& at, ConstVectorRef x, Columns& impulses) {
  gauss_known_ = false;
  if (s_ > 1) evaluate_lobatto(at, 1, s_ - 1);
  for (int j = 0; j < s_; ++j) {
    rows_->pattern().transposed_multiply_add(at_lobatto_.col(j).data(), x.data() + first_ + stride_ * j,
                                             impulses.col(j).data());
  }
}

void StageRows::residual(const StagePoints& at, ConstVectorRef x, VectorRef& f) {
  const int m = rows_->rows();
  if (rows_->holonomic()) {
    rows_->positions(at.at_lobatto(1, s_), positions_.data());
    const double per_step = 1.0 / at.step.size;
    for (int j = 0; j < s_; ++j)
      for (int r = 0; r < m; ++r) f[first_ + stride_ * j + r] = per_step * positions_(r, j);
    return;
  }
  rows_->coefficients_at(at.at_gauss(), at_gauss_.data(), offset_.data());
  gauss_known_ = true;
  for (int j = 0; j < s_; ++j) {
    double* const out = f.data() + first_ + stride_ * j;
    std::copy_n(offset_.data() + m * j, m, out);
    rows_->pattern().multiply_add(at_gauss_.col(j).data(), x.data() + n_ * j, out);
  }
}

void StageRows::add_to_jacobian(const StagePoints& at, const BlockPattern& layout, ConstVectorRef x,
                                VectorRef& values) {
  second_derivatives(at, x);
  for (int i = 0; i < s_; ++i)
    for (int k = 0; k < s_; ++k) {
      const int place = first_layout_ + 3 * (i * s_ + k);
      layout.add_to(values.data(), place, at.weights.impulse(k, i), at_lobatto_.col(k).data());
      if (s_ == 1) continue;
      combine(static_cast<int>(sum_.size()), s_ - 1, &at.weights.row_curvature(1, i * s_ + k),
              curvature_.col(1).data(), nullptr, sum_.data());
      layout.add_to(values.data(), place + 1, 1.0, sum_.data());
    }
  for (int j = 0; j < s_; ++j) add_constraint(at, layout, j, values);
}

void StageRows::evaluate_constraint(const StagePoints& at) {
  if (rows_->holonomic()) return evaluate_lobatto(at, s_, 1);  // no impulse enters there
  if (!gauss_known_) rows_->coefficients_at(at.at_gauss(), at_gauss_.data(), offset_.data());
  gauss_known_ = true;
}

void StageRows::second_derivatives(const StagePoints& at, ConstVectorRef x) {
  evaluate_constraint(at);
  if (!rows_->holonomic()) rows_->derivatives(at.at_gauss(x.data()), derivative_.data());
  if (s_ == 1) return;
  for (int j = 1; j < s_; ++j) multipliers_.col(j) = x.segment(first_ + stride_ * j, rows_->rows());
  rows_->annihilator_derivatives(at.at_lobatto(1, s_ - 1), multipliers_.col(1).data(),
                                 curvature_.col(1).data());
}

void StageRows::place(StageArrays& arrays) {
  arrays.rows = rows_.get();
  arrays.at_lobatto = at_lobatto_.data();
  arrays.at_gauss = at_gauss_.data();
  arrays.offset = offset_.data();
  arrays.curvature = curvature_.data();
  arrays.derivative = derivative_.data();
}

void StageRows::add_constraint(const StagePoints& at, const BlockPattern& layout, int j, VectorRef& values) {
  const auto place = [&](int k) { return first_layout_ + 3 * (j * s_ + k) + 2; };
  if (rows_->holonomic()) {
    for (int k = 0; k < s_; ++k)
      layout.add_to(values.data(), place(k), at.weights.table.lobatto_a(j + 1, k),
                    at_lobatto_.col(j + 1).data());
    return;
  }
  layout.add_to(values.data(), place(j), 1.0, at_gauss_.col(j).data());
  for (int k = 0; k < s_; ++k)
    layout.add_to(values.data(), place(k), at.weights.position(k, j), derivative_.col(j).data());
}

double StageRows::form_size() const { return largest_entry(at_lobatto_.col(0).data(), at_lobatto_.rows()); }

double StageRows::impulse_size(ConstVectorRef multipliers) const {
  const auto places = rows_->pattern().row_indices();
  const double* const a = at_lobatto_.data();
  double largest = 0.0;
  for (int j = 0; j < s_; ++j) {
    const double* const lambda = multipliers.data() + first_ - n_ * s_ + stride_ * j;
    largest = std::max(largest, largest_product(a, places, lambda));
  }
  return largest;
}

double StageRows::curvature_size() const {
  return s_ == 1 ? 0.0 : largest_entry(curvature_.data(), curvature_.size());
}

void StageRows::add_impulse_sizes(const StagePoints& at, ConstVectorRef x, const Vector& q, Vector& sizes) {
  lambda_.setZero();
  for (int j = 0; j < s_; ++j) lambda_ += x.segment(first_ + stride_ * j, rows_->rows()).cwiseAbs();
  rows_->pattern().for_each(
      [&](Eigen::Index e, int r, int c) { sizes[c] += std::abs(at_lobatto_(e, 0) * lambda_[r]); });
  rows_->annihilator_derivative(at.lobatto_time(0), at.lobatto.col(0), lambda_, start_curvature_);
  rows_->curvature_pattern().for_each(
      [&](Eigen::Index e, int r, int c) { sizes[r] += std::abs(start_curvature_[e] * q[c]); });
}

void StageRows::size_terms(double h, const Vector& q, const Vector& v, Vector& sizes) {
  leading_.add_up(rows_->pattern(), sizes.data() + first(), [&](Eigen::Index e, int c) {
    return std::abs(at_lobatto_(e, 0)) * (std::abs(q[c]) / h + std::abs(v[c]));
  });
}

double form_size(const std::vector<StageRows>& all) {
  double largest = 0.0;
  for (const StageRows& rows : all) largest = std::max(largest, rows.form_size());
  return largest;
}

double impulse_size(const std::vector<StageRows>& all, ConstVectorRef multipliers) {
  double largest = 0.0;
  for (const StageRows& rows : all) largest = std::max(largest, rows.impulse_size(multipliers));
  return largest;
}

}  // namespace diracstep
