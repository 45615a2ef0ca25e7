#pragma once

#include <diracstep/core/numerics/sparsity_pattern.hpp>
#include <diracstep/core/numerics/types.hpp>
#include <memory>
#include <string>
#include <utility>

namespace diracstep {

/// Which of its four arguments a generating function of a symplectic map (q0,p0) ↦ (q1,p1) lives on, and the
/// map it generates (Leok and Ohsawa (2.11)–(2.27); type 4 is beyond that paper):
///
///   one    S(q0,q1)   p0 = −D1S   p1 =  D2S
///   two    S(q0,p1)   p0 =  D1S   q1 =  D2S
///   three  S(p0,q1)   q0 = −D1S   p1 = −D2S
///   four   S(p0,p1)   q0 =  D1S   q1 = −D2S
enum class GeneratingType { one = 1, two = 2, three = 3, four = 4 };

/// What a type's arguments are, and the signs of its graph: start data = start_sign · D1S, end data =
/// end_sign · D2S, where start and end data are whatever the arguments are not.
struct GraphOf {
  bool starts_from_position;
  bool ends_at_position;
  double start_sign;
  double end_sign;
};
/// The table above, for one type.
constexpr GraphOf graph_of(GeneratingType type) {
  switch (type) {
    case GeneratingType::one:
      return {true, true, -1.0, 1.0};
    case GeneratingType::two:
      return {true, false, 1.0, 1.0};
    case GeneratingType::three:
      return {false, true, -1.0, -1.0};
    case GeneratingType::four:
      break;
  }
  return {false, false, 1.0, -1.0};
}

/// The time interval of one step: from `start` to `start + size`; the size may be negative.
struct Interval {
  double start;
  double size;

  double end() const { return start + size; }
};

/// The graph of a generating function solved for its end, where that takes no nonlinear solve.
class ExplicitGraph {
 public:
  virtual ~ExplicitGraph() = default;
  /// Pattern of ∂q1/∂p0.
  virtual const SparsityPattern& mobility_pattern() const = 0;
  virtual void map(Interval step, ConstVectorRef q0, ConstVectorRef p0, VectorRef q1, VectorRef p1) = 0;
  /// ∂q1/∂p0 at the last point mapped.
  virtual void mobility(Interval step, VectorRef values) = 0;
};

/// S over one step, action (energy·time), with first and second derivatives: what a construction of a
/// discrete Lagrangian or Hamiltonian, or a plugin, supplies.
///
/// S is a function of 2 + r columns of n numbers: its arguments a and b, whose meaning the type fixes, and r
/// inner columns (stages, or the end points of a Legendre transform) at which S is stationary.  Second
/// derivatives come as values on one symmetric n×n pattern, block by block: column pair(i,j), i ≤ j, of the
/// output holds ∂²S/∂y_i∂y_j, rows for y_i.  An object belongs to one integrator and may keep workspaces.
class GeneratingFunction {
 public:
  GeneratingFunction(GeneratingType type, SparsityPattern pattern, int inner_columns = 0)
      : type_(type), pattern_(std::move(pattern)), inner_columns_(inner_columns) {}
  GeneratingFunction(const GeneratingFunction&) = delete;
  GeneratingFunction& operator=(const GeneratingFunction&) = delete;
  virtual ~GeneratingFunction() = default;

  GeneratingType type() const { return type_; }
  int dimension() const { return pattern_.rows(); }
  const SparsityPattern& pattern() const { return pattern_; }
  int inner_columns() const { return inner_columns_; }
  int columns() const { return 2 + inner_columns_; }

  /// Number of block (i,j), i ≤ j, among the columns of a hessian; there are pairs() of them.
  int pair(int i, int j) const { return i * columns() - i * (i - 1) / 2 + j - i; }
  int pairs() const { return columns() * (columns() + 1) / 2; }

  virtual double value(Interval step, ConstColumnsRef y) = 0;
  /// Column j of g is ∂S/∂y_j.
  virtual void gradient(Interval step, ConstColumnsRef y, ColumnsRef g) = 0;
  virtual void hessian(Interval step, ConstColumnsRef y, ColumnsRef blocks) = 0;

  /// From now on column 1 of y is the increment b − a of the arguments (a, b) of type one, derivatives stay
  /// those by a and b: velocities (b − a)/h then lose nothing to the round-off of b.  False where S has no
  /// such form.
  virtual bool take_increments() { return false; }

  /// Starting values of the inner columns from the start point and a velocity there.
  virtual void guess_inner(Interval /*step*/, ConstVectorRef /*q0*/, ConstVectorRef /*p0*/,
                           ConstVectorRef /*v0*/, ColumnsRef /*inner*/) {}

  /// The graph solved for its end, or null where that needs a nonlinear solve.
  virtual ExplicitGraph* explicit_graph() { return nullptr; }

 private:
  GeneratingType type_;
  SparsityPattern pattern_;
  int inner_columns_;
};

/// Moves the inner columns of y to where S is stationary in them, by Newton's method from where they are;
/// false where that fails.  For looking at S alone: a step solves for its inner columns along with the rest.
bool make_stationary(GeneratingFunction& s, Interval step, ColumnsRef y);

}  // namespace diracstep
