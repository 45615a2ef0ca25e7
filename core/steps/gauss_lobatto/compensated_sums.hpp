#pragma once

#include <array>
#include <diracstep/core/numerics/snapshot.hpp>
#include <diracstep/core/numerics/types.hpp>
#include <diracstep/core/steps/gauss_lobatto/tableau.hpp>

namespace diracstep {

/// The sums of GL(s) with an unrounded tableau in extended precision, and compensated addition of their
/// results.
///
/// Where an end (q1,p1) is rounded to double, the remainder is kept and enters the step that starts there.
/// Round-off is then that of the functions and of the solver alone: random in sign, so that the energy error
/// grows like √N over N steps, where the rounded tableau makes it grow like N (Hairer, McLachlan,
/// Razakarivony, Achieving Brouwer's law with implicit Runge–Kutta methods, BIT 48, 2008).
class CompensatedSums {
 public:
  CompensatedSums(int stages, int dimension);

  ExtendedGaussLobattoTableau table;

  void forget();

  /// Keeps the remainder at the end of the step just taken, so that attempts at the next one which fail leave
  /// no trace.
  void keep();
  void save(Snapshot& to) const;
  void restore(Snapshot& from);

  /// A step begins at (q0,p0) after one that began at (last_q0,last_p0): takes over the remainder that
  /// belongs to the point.
  void begin(const Vector& q0, const Vector& p0, const Vector& last_q0, const Vector& last_p0);

  /// q0 + h Σ_k weights_k V_k, rounded.
  template <class Weights>
  void position(double h, const Weights& weights, const Vector& q0, ConstColumnsRef v, VectorRef q) {
    add_stages(h, weights, v);
    for (Eigen::Index r = 0; r < q0.size(); ++r) q[r] = static_cast<double>(q0[r] + (start_.q[r] + sum_[r]));
  }

  /// lv − p0 − h Σ_j â_ij lq_j − Σ_j e_ij impulse_j, rounded.
  void momentum_row(int i, double h, ConstVectorRef lv, const Vector& p0, ConstColumnsRef lq,
                    ConstColumnsRef impulses, VectorRef row);

  /// The end of the step, rounded, its remainder kept.
  void end(double h, const Vector& q0, const Vector& p0, ConstColumnsRef v, ConstColumnsRef lq,
           ConstColumnsRef impulses, Vector& q1, Vector& p1);

 private:
  using Extended = Eigen::Matrix<long double, Eigen::Dynamic, 1>;
  /// What rounding has dropped at a point, which is known by its bits.
  struct Remainder {
    Extended q, p;
  };

  template <class Weights>
  void add_stages(double h, const Weights& weights, ConstColumnsRef v) {
    sum_.setZero();
    for (Eigen::Index k = 0; k < v.cols(); ++k) {
      const long double factor = h * weights[k];
      for (Eigen::Index r = 0; r < v.rows(); ++r) sum_[r] += factor * v(r, k);
    }
  }
  static void round(const Vector& from, const Extended& change, Vector& to, Extended& remainder);

  /// The columns of all remainders, and the points of those at ends.
  std::array<Extended*, 6> remainders() {
    return {&start_.q, &start_.p, &end_.q, &end_.p, &kept_.q, &kept_.p};
  }
  std::array<Vector*, 4> points() { return {&end_q_, &end_p_, &kept_q_, &kept_p_}; }

  Remainder start_, end_, kept_;
  Vector end_q_, end_p_, kept_q_, kept_p_;
  Extended sum_;
};

}  // namespace diracstep
