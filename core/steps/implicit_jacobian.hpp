#pragma once

#include <diracstep/core/dirac/generating_function.hpp>
#include <diracstep/core/numerics/sparsity_pattern.hpp>
#include <diracstep/core/numerics/types.hpp>
#include <vector>

namespace diracstep {

/// The Jacobian of the step of a generating function S, in the unknowns and rows of dirac_step(): blocks of
/// the Hessian of S, and their products with the rows at both ends and with the derivative of the force, for
/// what enters through p̂0 or leaves through q1 = ±D2S.
class ImplicitJacobian {
 public:
  /// Patterns of the factors: A(q0), ∂c/∂q1, and ∂F⁻/∂(end), null where the scene has no force.
  struct Patterns {
    const SparsityPattern& start_rows;
    const SparsityPattern& end_rows;
    const SparsityPattern* force;
  };
  ImplicitJacobian(const GeneratingFunction& s, const Patterns& patterns, bool dense);

  const SparsityPattern& pattern() const { return pattern_; }

  /// Values of the factors in a step of size h.
  struct Factors {
    double h;
    const Columns& hessian;  ///< of S, by pairs of columns
    const Vector& start_rows;
    const Vector& end_rows;
    const Vector& force;
  };
  void assemble(const Factors& at, VectorRef values);

 private:
  /// A block of the Jacobian that is a block of the Hessian of S times factors of h.
  struct HessianBlock {
    int row_column;  ///< the column of S whose derivative is the row: 0 graph, 2… stationarity
    int unknown;     ///< the column of S that is the unknown: 1 end, 2… inner
    int pair;
    int layout;
  };
  /// A product of the rows or of the force with a block of the Hessian of S.
  struct ProductBlock {
    int column;  ///< the column of S that the row belongs to, or that the unknown is
    int pair;
    int layout;
    PatternProduct product;
    Vector values;
  };

  int row_of(int column) const { return column == 0 ? 0 : n_ + m_ + n_ * (column - 2); }
  int place_of(int column) const { return column == 1 ? 0 : n_ + m_ + n_ * (column - 2); }
  double row_factor(double h) const { return graph_.starts_from_position ? h : 1.0; }
  double end_factor(double h) const { return graph_.ends_at_position ? 1.0 : 1.0 / h; }

  ProductBlock product(int column, int pair, PatternProduct product) const;
  void plan_hessian(const GeneratingFunction& s);
  void plan_rows(const GeneratingFunction& s, const Patterns& patterns);
  void plan_force(const GeneratingFunction& s, const SparsityPattern& force);
  void add_force(const Factors& at, VectorRef& values);
  void add_constraint_columns(const Factors& at, VectorRef& values);
  void add_constraint_rows(const Factors& at, VectorRef& values);

  GraphOf graph_;
  int columns_, n_, m_;
  BlockPattern layout_;
  SparsityPattern pattern_;
  std::vector<HessianBlock> hessian_blocks_;
  int impulse_layout_ = -1, end_layout_ = -1, impulse_through_end_layout_ = -1, force_layout_ = -1;
  std::vector<ProductBlock> columns_of_impulse_, rows_of_end_, force_products_;
  PatternProduct impulse_through_end_;
  Vector through_end_values_;
  bool has_force_;
};

}  // namespace diracstep
