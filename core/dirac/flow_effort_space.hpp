#pragma once

#include <diracstep/core/numerics/types.hpp>
#include <utility>

namespace diracstep {

/// e·f′ + e′·f, the symmetric pairing of flows and efforts.
double pairing(const Vector& f, const Vector& e, const Vector& f_other, const Vector& e_other);

/// A linear subspace D of V × V*: flows f ∈ V and efforts e ∈ V*, n numbers each, in two forms,
///
///   kernel   D = {(f,e) : F f + E e = 0},   2n − dim D rows, orthonormal rows of (F E)
///   image    D = {(X z, Y z)},              dim D columns, orthonormal columns of (X; Y)
///
/// D is a Dirac structure on V where it equals its orthogonal D^⊥ under pairing(); it then has dimension n
/// (Courant, Trans. AMS 319, 1990; Dalsmo, van der Schaft, SIAM J. Control Optim. 37, 1998).  Of any other
/// subspace the two defects say how far it is from one.
class FlowEffortSpace {
 public:
  /// From F and E, of as many rows as one likes; rows and rank are those that exceed 1e-10 of the others.
  /// Throws Misuse unless both have the same size.
  static FlowEffortSpace kernel_of(const Columns& flows, const Columns& efforts);
  /// From X and Y.  Throws Misuse unless both have the same size.
  static FlowEffortSpace image_of(const Columns& flows, const Columns& efforts);

  int size() const { return static_cast<int>(image_.rows() / 2); }  ///< n
  int dimension() const { return static_cast<int>(image_.cols()); }

  Columns kernel_flows() const { return kernel_.leftCols(size()); }     ///< F
  Columns kernel_efforts() const { return kernel_.rightCols(size()); }  ///< E
  Columns image_flows() const { return image_.topRows(size()); }        ///< X
  Columns image_efforts() const { return image_.bottomRows(size()); }   ///< Y

  /// Maximum norm of F f + E e, zero for members.  Throws Misuse for a wrong size.
  double outside(const Vector& f, const Vector& e) const;
  /// Largest of these over a basis of `other`: zero where `other` is part of this space.
  double outside(const FlowEffortSpace& other) const;

  /// D^⊥ = {(f,e) : Xᵀe + Yᵀf = 0}.
  FlowEffortSpace orthogonal() const;
  /// Largest entry of Xᵀ Y + Yᵀ X: zero where D ⊂ D^⊥.
  double isotropy_defect() const;
  /// Largest entry of E Fᵀ + F Eᵀ: zero where D^⊥ ⊂ D, so that nothing can be added to an isotropic D.
  double maximality_defect() const;

 private:
  FlowEffortSpace(Columns kernel, Columns image) : kernel_(std::move(kernel)), image_(std::move(image)) {}

  Columns kernel_, image_;
};

/// Δ ⊕ Δ° = {A f = 0, e ∈ range Aᵀ}, the Dirac structure of a constraint on flows alone: Kirchhoff's laws, a
/// joint.
FlowEffortSpace distribution_structure(const Columns& one_forms);

/// Flows and efforts of `a` in front of those of `b`.
FlowEffortSpace direct_sum(const FlowEffortSpace& a, const FlowEffortSpace& b);

/// D_A ∘ D_B over the last `ports` flows of A and the first of B,
///
///   {(f_A,e_A,f_B,e_B) : (f_A,e_A,f,e) ∈ D_A and (−f,e,f_B,e_B) ∈ D_B for some (f,e)},
///
/// a Dirac structure where both are (Cervera, van der Schaft, Baños, Automatica 43, 2007).  Throws Misuse
/// where one has fewer flows than that.
FlowEffortSpace composition(const FlowEffortSpace& a, const FlowEffortSpace& b, int ports);

}  // namespace diracstep
