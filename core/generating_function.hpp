#pragma once

#include <diracstep/core/sparsity_pattern.hpp>
#include <diracstep/core/types.hpp>
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

/// The time interval of one step: from `start` to `start + size`; the size may be negative.
struct Interval {
  double start;
  double size;
};

/// S(a, b) over one step, action (energy·time), with first and second derivatives: what a construction of a
/// discrete Lagrangian or Hamiltonian, or a plugin, supplies.
///
/// The second derivatives come as values on one symmetric n×n pattern: aa(i,j) = ∂²S/∂a_i∂a_j,
/// ab(i,j) = ∂²S/∂a_i∂b_j, bb(i,j) = ∂²S/∂b_i∂b_j.  A step asks only for the ones its type needs; an output of
/// size zero is not asked for.  An object belongs to one integrator and may keep workspaces.
class GeneratingFunction {
 public:
  GeneratingFunction(GeneratingType type, SparsityPattern pattern)
      : type_(type), pattern_(std::move(pattern)) {}
  GeneratingFunction(const GeneratingFunction&) = delete;
  GeneratingFunction& operator=(const GeneratingFunction&) = delete;
  virtual ~GeneratingFunction() = default;

  GeneratingType type() const { return type_; }
  int dimension() const { return pattern_.rows(); }
  const SparsityPattern& pattern() const { return pattern_; }

  virtual double value(Interval step, ConstVectorRef a, ConstVectorRef b) = 0;
  virtual void gradient(Interval step, ConstVectorRef a, ConstVectorRef b, VectorRef d1, VectorRef d2) = 0;
  virtual void hessian(Interval step, ConstVectorRef a, ConstVectorRef b, VectorRef aa, VectorRef ab,
                       VectorRef bb) = 0;

 private:
  GeneratingType type_;
  SparsityPattern pattern_;
};

}  // namespace diracstep
