#include <algorithm>
#include <diracstep/core/steps/implicit_jacobian.hpp>
#include <utility>

namespace diracstep {

ImplicitJacobian::ImplicitJacobian(const GeneratingFunction& s, const Patterns& patterns, bool dense)
    : graph_(graph_of(s.type())),
      columns_(s.columns()),
      n_(s.dimension()),
      m_(patterns.start_rows.rows()),
      layout_(n_ + m_ + n_ * s.inner_columns(), n_ + m_ + n_ * s.inner_columns()),
      has_force_(patterns.force != nullptr) {
  plan_hessian(s);
  if (m_ > 0) plan_rows(s, patterns);
  if (has_force_) plan_force(s, *patterns.force);
  pattern_ = layout_.assemble(dense);
}

void ImplicitJacobian::plan_hessian(const GeneratingFunction& s) {
  for (int row = 0; row < columns_; ++row)
    for (int unknown = 1; unknown < columns_; ++unknown) {
      if (row == 1) continue;
      const bool lower = row > unknown;
      const int pair = s.pair(std::min(row, unknown), std::max(row, unknown));
      hessian_blocks_.push_back(
          {row, unknown, pair, layout_.add(s.pattern(), row_of(row), place_of(unknown), lower)});
    }
}

ImplicitJacobian::ProductBlock ImplicitJacobian::product(int column, int pair, PatternProduct product) const {
  const Vector values = Vector::Zero(product.pattern().nonzeros());
  return {column, pair, -1, std::move(product), values};
}

void ImplicitJacobian::plan_rows(const GeneratingFunction& s, const Patterns& patterns) {
  const SparsityPattern &a0 = patterns.start_rows, &c1 = patterns.end_rows;
  if (graph_.starts_from_position) {
    impulse_layout_ = layout_.add(a0, 0, n_, true);
  } else {
    for (int row = 0; row < columns_; ++row) {
      if (row == 1 && graph_.ends_at_position) continue;
      // Row `row` of S holds a = p̂0 = p0 + A0ᵀλ; block (row, a) is the transpose of pair (a, row).
      ProductBlock block = product(row, s.pair(0, row), PatternProduct(s.pattern(), row > 0, a0, true));
      if (row != 1) block.layout = layout_.add(block.product.pattern(), row_of(row), n_);
      columns_of_impulse_.push_back(std::move(block));
    }
  }
  if (graph_.ends_at_position) {
    end_layout_ = layout_.add(c1, n_, 0);
    return;
  }
  for (int unknown = 1; unknown < columns_; ++unknown) {
    ProductBlock block = product(unknown, s.pair(1, unknown), PatternProduct(c1, false, s.pattern(), false));
    block.layout = layout_.add(block.product.pattern(), n_, place_of(unknown));
    rows_of_end_.push_back(std::move(block));
  }
  if (!graph_.starts_from_position) {
    impulse_through_end_ = PatternProduct(c1, false, columns_of_impulse_[1].product.pattern(), false);
    impulse_through_end_layout_ = layout_.add(impulse_through_end_.pattern(), n_, n_);
  }
  through_end_values_.setZero(impulse_through_end_.pattern().nonzeros());
}

/// F⁻ depends on the end: directly (one), through q1 = D2S (two), and as part of the argument p̂0 (three).
void ImplicitJacobian::plan_force(const GeneratingFunction& s, const SparsityPattern& force) {
  const auto plan = [&](int row, int place, ProductBlock block) {
    block.layout = layout_.add(block.product.pattern(), row, place);
    force_products_.push_back(std::move(block));
  };
  if (graph_.ends_at_position && graph_.starts_from_position) {
    force_layout_ = layout_.add(force, 0, 0);
  } else if (graph_.ends_at_position) {
    for (int row = 0; row < columns_; ++row)
      if (row != 1)
        plan(row_of(row), 0,
             product(row, s.pair(0, row), PatternProduct(s.pattern(), row > 0, force, false)));
  } else {
    for (int unknown = 1; unknown < columns_; ++unknown)
      plan(0, place_of(unknown),
           product(unknown, s.pair(1, unknown), PatternProduct(force, false, s.pattern(), false)));
  }
}

void ImplicitJacobian::assemble(const Factors& at, VectorRef values) {
  values.setZero();
  for (const HessianBlock& block : hessian_blocks_) {
    const double of_row = block.row_column == 0 ? -graph_.start_sign * row_factor(at.h) : 1.0;
    const double factor = of_row * (block.unknown == 1 ? end_factor(at.h) : 1.0);
    layout_.add_to(values.data(), block.layout, factor, at.hessian.col(block.pair).data());
  }
  if (has_force_) add_force(at, values);
  if (m_ == 0) return;
  add_constraint_columns(at, values);
  add_constraint_rows(at, values);
}

void ImplicitJacobian::add_force(const Factors& at, VectorRef& values) {
  if (force_layout_ >= 0)
    return layout_.add_to(values.data(), force_layout_, row_factor(at.h), at.force.data());
  const bool in_argument = graph_.ends_at_position;
  for (ProductBlock& block : force_products_) {
    const double* s = at.hessian.col(block.pair).data();
    const double* f = at.force.data();
    block.product.multiply(in_argument ? s : f, in_argument ? f : s, block.values.data());
    double factor = 1.0;
    if (!in_argument)
      factor = row_factor(at.h) * graph_.end_sign * (block.column == 1 ? end_factor(at.h) : 1.0);
    if (in_argument && block.column == 0) factor = -graph_.start_sign;
    layout_.add_to(values.data(), block.layout, factor, block.values.data());
  }
}

/// ∂/∂(hλ) of the graph and stationarity rows.
void ImplicitJacobian::add_constraint_columns(const Factors& at, VectorRef& values) {
  const double* const a0 = at.start_rows.data();
  if (graph_.starts_from_position) return layout_.add_to(values.data(), impulse_layout_, 1.0, a0);
  for (ProductBlock& block : columns_of_impulse_) {
    block.product.multiply(at.hessian.col(block.pair).data(), a0, block.values.data());
    if (block.column == 1) continue;  // the end is no row; see add_constraint_rows
    const double factor = block.column == 0 ? -graph_.start_sign : 1.0;
    layout_.add_to(values.data(), block.layout, factor / at.h, block.values.data());
  }
}

/// The rows c(q0,q1): ∂/∂(end) and ∂/∂(inner), and ∂/∂(hλ) for type four.
void ImplicitJacobian::add_constraint_rows(const Factors& at, VectorRef& values) {
  const double* const c1 = at.end_rows.data();
  if (graph_.ends_at_position) return layout_.add_to(values.data(), end_layout_, 1.0, c1);
  for (ProductBlock& block : rows_of_end_) {
    block.product.multiply(c1, at.hessian.col(block.pair).data(), block.values.data());
    const double factor = block.column == 1 ? end_factor(at.h) : 1.0;
    layout_.add_to(values.data(), block.layout, graph_.end_sign * factor, block.values.data());
  }
  if (graph_.starts_from_position) return;
  impulse_through_end_.multiply(c1, columns_of_impulse_[1].values.data(), through_end_values_.data());
  layout_.add_to(values.data(), impulse_through_end_layout_, graph_.end_sign / at.h,
                 through_end_values_.data());
}

}  // namespace diracstep
