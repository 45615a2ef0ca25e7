#pragma once

#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/system/constraint_rows.hpp>
#include <diracstep/core/system/force.hpp>
#include <diracstep/core/system/kinks.hpp>
#include <diracstep/core/system/phase_function.hpp>
#include <functional>
#include <memory>
#include <string>
#include <vector>

namespace diracstep {

/// Where a motion starts: a configuration, and a velocity in the distribution or a momentum whose velocity
/// ∂H/∂p lies in it, with the scene's Hamiltonian or that of a regular Lagrangian.
struct Start {
  double time = 0.0;
  Vector q;       ///< Scene::storage_size() numbers
  Vector v;       ///< Scene::dimension() numbers, like p
  Vector p = {};  ///< used where v is empty
};

/// A continuous system: (L, Δ_Q) or (H, Δ_Q), or both, and a start.
///
///   q̇ = v ∈ Δ_Q(q),   p = ∂L/∂v,   ṗ − ∂L/∂q − f ∈ Δ°_Q(q)      Leok and Ohsawa (4.7)
///   q̇ = ∂H/∂p ∈ Δ_Q(q),            ṗ + ∂H/∂q − f ∈ Δ°_Q(q)      Leok and Ohsawa (4.11)
///
/// with an external force f beyond the paper.
struct Scene {
  std::string name;
  std::vector<std::string> coordinates;
  std::shared_ptr<const Lagrangian> lagrangian;
  std::shared_ptr<const Hamiltonian> hamiltonian;
  ConstraintBlocks constraints;
  std::shared_ptr<const Force> force;  ///< null where there is none
  Start start;
  std::shared_ptr<const Kinks> kinks = {};  ///< null where nothing is known of any
  /// Empty, or says after use why the functions above are not to be believed, as derivatives by differences
  /// that two step sizes do not agree on.
  std::function<std::string()> doubt = {};
  /// By coordinate, in its unit: a coordinate whose terms are far smaller than those of others is solved in
  /// each step to this instead of to 1e-15 of the largest coordinate (RowScales).  0 where none is stated;
  /// empty where none is at all.
  Vector tolerances = {};
  /// The scene with all its rows, where some were left out as redundant (with_rows_left_out()); null where
  /// none were.  An Integrator holds every step to them.
  std::shared_ptr<const Scene> whole = {};

  /// Of the tangent spaces: how many numbers a velocity, a momentum, a row and the second derivatives of L
  /// have.
  int dimension() const { return static_cast<int>(coordinates.size()); }
  /// How many numbers a configuration is stored in.  In R^n, the one kind of space so far, the same n; a
  /// rotation would take four for three.
  int storage_size() const { return dimension(); }
  int rows() const { return row_count(constraints); }
  std::vector<std::string> row_names() const;

  /// v·∂L/∂v − L.
  double energy(double t, ConstVectorRef q, ConstVectorRef v) const;
};

/// Throws Misuse where sizes disagree or a part is missing.
void require_well_formed(const Scene& scene);

/// The start with its velocity: itself where v is given; else v = ∂H/∂p with the scene's Hamiltonian or that
/// of its Lagrangian, and v = 0 where the Lagrangian is linear in v, so that the motion has but one velocity
/// at each q.  Everything that takes a Start completes it by this.  Throws Misuse for q or p of the wrong
/// size, and where the Lagrangian is degenerate in another way.
Start completed_start(const Scene& scene, Start start);

/// The scene itself if it has a Lagrangian and a starting velocity; else a copy with both derived from its
/// Hamiltonian.  Throws Misuse where it is not well formed or the Hamiltonian is degenerate.
std::shared_ptr<const Scene> completed(std::shared_ptr<const Scene> scene);

/// The scene's Hamiltonian, or the one derived from its Lagrangian.  Throws Misuse where that is degenerate.
std::shared_ptr<const Hamiltonian> hamiltonian_of(const Scene& scene);

/// A start that violates a row.
class InconsistentStart : public Misuse {
  using Misuse::Misuse;
};

/// Throws Misuse where the start, completed, is of the wrong size or not finite, InconsistentStart where it
/// violates φ(q) = 0 or has a velocity off the distribution; names the coordinate or the row, and the amount.
/// A row counts as violated when its residual exceeds 1e-10 of the terms that cancel in it.
void require_consistent(const Scene& scene, const Start& start);

}  // namespace diracstep
