#pragma once

#include <diracstep/core/numerics/types.hpp>
#include <diracstep/core/steps/gauss_lobatto/tableau.hpp>
#include <diracstep/core/steps/state.hpp>

namespace diracstep {

/// The sums of GL(s) with an unrounded tableau in extended precision, and compensated addition of their
/// results.
///
/// Where an end (q1,p1) is rounded to double, the remainder goes with it and enters the step that starts
/// there. Round-off is then that of the functions and of the solver alone: random in sign, so that the energy
/// error grows like √N over N steps, where the rounded tableau makes it grow like N (Hairer, McLachlan,
/// Razakarivony, Achieving Brouwer's law with implicit Runge–Kutta methods, BIT 48, 2008).
class CompensatedSums {
 public:
  CompensatedSums(int stages, int dimension);

  ExtendedGaussLobattoTableau table;

  /// A step begins at a point where rounding has dropped so much; nothing where `rest` is empty.
  void begin(const Remainder& rest);

  /// q0 + h Σ_k weights_k V_k, rounded.
  template <class Weights>
  void position(double h, const Weights& weights, ConstVectorRef q0, ConstColumnsRef v, VectorRef q) {
    add_stages(h, weights, v);
    for (Eigen::Index r = 0; r < q0.size(); ++r) q[r] = static_cast<double>(q0[r] + (start_.q[r] + sum_[r]));
  }

  /// lv − p0 − h Σ_j â_ij lq_j − Σ_j e_ij impulse_j, rounded.
  void momentum_row(int i, double h, ConstVectorRef lv, const Vector& p0, ConstColumnsRef lq,
                    ConstColumnsRef impulses, VectorRef row);

  /// The end of the step, rounded, and the remainder there.
  void end(double h, ConstVectorRef q0, const Vector& p0, ConstColumnsRef v, ConstColumnsRef lq,
           ConstColumnsRef impulses, StepEnd& end);

 private:
  template <class Weights>
  void add_stages(double h, const Weights& weights, ConstColumnsRef v) {
    sum_.setZero();
    for (Eigen::Index k = 0; k < v.cols(); ++k) {
      const long double factor = h * weights[k];
      for (Eigen::Index r = 0; r < v.rows(); ++r) sum_[r] += factor * v(r, k);
    }
  }
  static void round(ConstVectorRef from, const ExtendedVector& change, Vector& to, ExtendedVector& remainder);

  Remainder start_;
  ExtendedVector sum_;
};

}  // namespace diracstep
