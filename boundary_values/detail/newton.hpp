#pragma once

#include <diracstep/boundary_values/detail/motion_equations.hpp>
#include <diracstep/sensitivities/detail/linear_factor.hpp>
#include <functional>
#include <memory>
#include <string>

namespace diracstep::boundary {

/// The linear systems of one iterate, factored: all solves for corrections go through these.
class LinearisedEnds {
 public:
  LinearisedEnds() = default;
  LinearisedEnds(const LinearisedEnds&) = delete;
  LinearisedEnds& operator=(const LinearisedEnds&) = delete;
  virtual ~LinearisedEnds() = default;
  /// The u̇ with J u̇ = −r, or nearest to it.
  virtual Vector correction(const MotionEquations::Residual& r) const = 0;
};

/// Conditions that are as many as the motion needs: one sparse matrix of all of J, with a multiplier for each
/// of those that holonomic rows make redundant.  Throws Error where it is singular.
class DeterminedEnds final : public LinearisedEnds {
 public:
  DeterminedEnds(MotionEquations& equations, const Vector& u);
  Vector correction(const MotionEquations::Residual& r) const override;
  /// The derivatives of u by each of the last `count` right sides of the conditions.
  Columns by_conditions(int count) const;

 private:
  Sparse matrix_;
  sensitivity::LinearFactor<Sparse> factor_;
  int unknowns_, motion_rows_, end_rows_;
};

/// Conditions that leave families of solutions, or depend on each other.  With the start held, the equations
/// of the motion are one sparse matrix, solved for the residual and for the derivatives Z by each number of
/// the start; what is then left is min ‖G ė + g‖² + μ ‖ė‖² for the 2n numbers ė of the start, in parts of
/// their size, with G the derivatives of the ends' equations along Z.  With μ = ‖g‖ or ‖g‖² that is Levenberg
/// and Marquardt's method, of second order also where solutions are not isolated (Yamashita, Fukushima,
/// Computing Suppl. 15, 2001).
class FamilyOfEnds final : public LinearisedEnds {
 public:
  /// `sizes` of each kind of unknown; μ = ‖g‖^power.
  FamilyOfEnds(MotionEquations& equations, const Vector& u, const Vector& sizes, double power = 1.0);
  Vector correction(const MotionEquations::Residual& r) const override;
  /// How many directions of the start the equations of the ends leave free.
  int free_directions() const;
  /// The derivative of the end by the start, (q, v) each, in an orthonormal basis of what the rows allow at
  /// the start.
  Columns transition() const;

 private:
  Columns particular(const MotionEquations::Residual& r) const;
  Vector left(const MotionEquations::Residual& r, const Columns& particular) const;

  sensitivity::LinearFactor<Sparse> factor_;
  int unknowns_;
  Columns along_;  ///< Z, in sizes of the start
  Columns ends_;   ///< G
  Sparse ends_by_unknowns_;
  Vector start_sizes_, row_sizes_;
  double damping_;  ///< √μ
  Columns start_rows_, end_by_start_;
};

/// `sizes` of each kind of unknown.
using FactorEnds = std::function<std::unique_ptr<LinearisedEnds>(const Vector& u, const Vector& sizes)>;

struct NewtonReport {
  bool converged = false;
  std::string failure;
  int iterations = 0;
  double correction = 0.0;
};

/// Newton's method from u on; `factor` makes the linear systems at an iterate, and throws Error where it
/// cannot.  `go_on`, where there is one, ends the iteration with false.
NewtonReport newton(MotionEquations& equations, Vector& u, int max_iterations, const FactorEnds& factor,
                    const std::function<bool()>& go_on);

/// The largest number of each Kind of unknown, 1 where all are zero.
Vector sizes_by_kind(const MotionEquations& equations, const Vector& u);

}  // namespace diracstep::boundary
