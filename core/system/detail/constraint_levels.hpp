#pragma once

#include <Eigen/LU>
#include <algorithm>
#include <diracstep/core/system/detail/equation_array.hpp>
#include <diracstep/core/system/first_order_motions.hpp>
#include <string>
#include <vector>

namespace diracstep {

/// The constraint algorithm (M. J. Gotay, J. M. Nester, G. Hinds, J. Math. Phys. 19, 1978) of a degenerate
/// Lagrangian, on its equations and their time derivatives up to an order K (equation_array.hpp),
/// F(t,z,W) = 0 with z = (q, p_i).  Each derivative is a level of the algorithm.
///
/// Where ∂F/∂W has constant rank, and its kernel no part in v_0 and Λ_0, as many rows `kept`, those of low
/// order first, are solved for as many unknowns `by`, v_0 and Λ_0 among them, the others left at zero. So v
/// and Λ are functions of (t,z), near the constraints as well, and z' = g(t,z).  Those of the other rows that
/// say something new, `left`, are the constraints of all levels, C(t,z) = F_left(t,z,W(t,z)), beside the
/// holonomic rows φ; with N = (−J_lk J_kk⁻¹, 1), ∂C/∂z = N ∂F/∂z.  So rows between positions of canonical
/// pairs, whose rates hold momenta, two-forms dθ that are singular, and multipliers as coordinates.
struct LevelledPoint {
  Vector w;                                     ///< W, a guess before solve()
  Vector rate;                                  ///< g
  Vector constraints;                           ///< φ and C
  Columns rate_by_state, constraints_by_state;  ///< of differentiate()
  Vector state = {};                            ///< where w was solved for
  Columns by_state = {};                        ///< ∂W_by/∂z there; empty where it is not known
  Eigen::PartialPivLU<Columns> factors = {};    ///< of J_kk with rows divided by `sizes`
  Vector sizes = {};                            ///< empty: not factored
};

class LevelledEquations {
 public:
  LevelledEquations(const Scene& scene, const FirstOrderMotions& motions);

  /// The reach of differences for points near this one, and W there in `at`; false as solve().
  bool begin(double t, ConstVectorRef z, ConstVectorRef v, LevelledPoint& at);
  /// The same from a known W in units of a known reach; false also where that is not short enough.
  bool resume(double t, ConstVectorRef z, ConstVectorRef w, double reach, LevelledPoint& at);
  /// W, g, φ and C at (t,z) by Newton's method from at.w; false where it does not converge.
  bool solve(double t, ConstVectorRef z, LevelledPoint& at);
  /// Their derivatives, after solve() at the same place.
  void differentiate(double t, ConstVectorRef z, LevelledPoint& at);

  /// Whether the reach was short enough at the last solve().
  bool smooth() const { return array_.smooth(); }

  // At the point of the last solve():
  const Vector& momentum() const { return array_.momentum(); }  ///< ∂L/∂v, n numbers
  double terms() const { return std::max(array_.terms(), array_.row_terms()); }
  /// Round-off of v_0 and Λ_0 in units of ε times their size, as estimated by begin() or resume(); it grows
  /// with the number of levels.
  double loss() const { return loss_; }
  /// That of C in units of ε.
  double constraint_terms() const { return constraint_terms_; }

  std::string constraint_name(int number) const;
  double reach() const { return array_.reach(); }
  int unknowns() const { return array_.unknowns(); }
  int leading() const { return n_ + m_; }  ///< v_0 and Λ_0
  int states() const { return array_.states(); }
  int constraint_count() const { return holonomic_count_ + static_cast<int>(levels_.left.size()); }
  Vector state(ConstVectorRef q, ConstVectorRef p) const;  ///< z, of all of p

 private:
  void factor(double t, ConstVectorRef z, LevelledPoint& at);
  void estimate_loss(const LevelledPoint& at);
  double part_of_leading(ConstVectorRef change, ConstVectorRef w) const;
  void take_constraints(double t, ConstVectorRef z, LevelledPoint& at);

  Scene scene_;
  std::vector<int> inert_;
  ConstraintLevels levels_;
  ConstraintBlocks holonomic_;
  int n_, m_, holonomic_count_;
  EquationArray array_;
  double loss_ = 1.0, constraint_terms_ = 0.0;
  double rest_speed_ = 0.0;   ///< where `at` was factored last
  ConstraintsAtPoint forms_;  ///< of φ
};

/// "the equation of motion along 'x'", of a row of an array.
std::string name_of_equation(const Scene& scene, const std::vector<int>& inert, int row);

constexpr int most_with_levels = 40;  ///< coordinates and rows
constexpr int most_levels = 5;        ///< time derivatives of equations

/// The levels of a scene whose equations of first order leave velocities or forces of rows open; without
/// levels, and with what is open or contradictory, where none or more than most_levels determine them, and
/// none at all where ranks change near the start.
FirstOrderMotions levelled_motions(const Scene& scene);

/// Unknowns (v, Λ) at given t, q, p: less those by the equations of all levels.
class LevelledVelocityProblem final : public MomentumVelocityProblem {
 public:
  LevelledVelocityProblem(const Scene& scene, const FirstOrderMotions& motions);

  void residual(ConstVectorRef x, VectorRef f) override;
  void jacobian(ConstVectorRef x, VectorRef values) override;
  void start_from_last() override { from_last_ = true; }

 private:
  bool solve(const Vector& z, ConstVectorRef v);

  LevelledEquations equations_;
  bool from_last_ = false;
  double solved_t_ = 0.0;
  Vector solved_z_;
  LevelledPoint at_;
};

/// The start moved onto the constraints of all levels, as moved_onto_hidden() does for those of one.
Start moved_onto_levels(const Scene& scene, const FirstOrderMotions& motions, Start start,
                        const std::vector<bool>& may_move);

/// Throws InconsistentStart where a start violates a constraint of a level by more than 1e-9 of its terms.
void require_on_levels(const Scene& scene, const FirstOrderMotions& motions);

}  // namespace diracstep
