#pragma once

#include <diracstep/core/system/scene.hpp>
#include <string>

namespace diracstep {

/// The rows of coordinates that are multipliers.  Where the columns u of U are directions of which L holds no
/// velocity, and positions only as factors,
///
///   L(t,q + Uδ,v) = L(t,q,v) + δᵀg(q),   g = Uᵀ ∂L/∂q,
///
/// their equations of motion are g(q) = 0, which do not tell Uᵀq: that is the force of these rows.  So g = 0
/// becomes a holonomic row with a force of its own, Uᵀq stays as it is at the start, and what a point of the
/// motion shows is q + U Λ of the former (show_multipliers()).
///
/// Second derivatives of g are differences of ∂²L/∂q² along u, which are exact, L being affine there.
class MultiplierRows final : public ConstraintRows {
 public:
  /// Each row is divided by its `units`.
  MultiplierRows(const Scene& scene, const Columns& directions, const Vector& units);

  /// U Λ in the units of q; `forces` are those of all these rows.
  Vector shown_beside(ConstVectorRef forces) const;

  std::string origin(int row) const override;
  bool workless() const override { return true; }
  void position(double t, ConstVectorRef q, VectorRef phi) const override;
  void coefficients(double t, ConstVectorRef q, VectorRef a, VectorRef b) const override;
  void derivative(double t, ConstVectorRef q, ConstVectorRef w, double s, VectorRef d) const override;
  void time_derivative(double t, ConstVectorRef q, ConstVectorRef v, VectorRef d) const override;
  void annihilator_derivative(double t, ConstVectorRef q, ConstVectorRef lambda, VectorRef d) const override;

 private:
  Vector second_difference(double t, ConstVectorRef q, ConstVectorRef direction) const;

  std::shared_ptr<const Lagrangian> lagrangian_;
  Columns directions_, scaled_;  ///< U, and with each column in the unit of its row
  Vector units_, start_;
  double probe_;  ///< how far along `scaled_` differences go
};

/// Whether the columns of `directions`, which carry no momentum and no force, are as described above, near
/// the start.
bool are_multipliers(const Scene& scene, const Columns& directions);

/// Why directions in which L is affine are no such multipliers, in words with what helps: g depends on the
/// time, or its components on each other.  Empty where it is something else.
std::string fault_of_multipliers(const Scene& scene, const Columns& directions);

/// The rows of the scene that say what these of multipliers say already, near the start, so that only sums of
/// the forces of both are determined: "row 'rod'"; empty where there are none.
std::string rows_said_twice(const Scene& scene, const MultiplierRows& rows);

/// How many of the rows of a block hold at q as shown, where multipliers do not stand still: the first so
/// many.
int rows_at_shown_points(const ConstraintRows& rows);

/// q with the multipliers among the coordinates in place of what stands for them; `lambda` are the forces of
/// all rows of the scene.
void show_multipliers(const Scene& scene, ConstVectorRef lambda, Vector& q);

}  // namespace diracstep
