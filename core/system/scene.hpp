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

class Space;

/// Where a motion starts: a configuration, and a velocity in the distribution or a momentum whose velocity
/// ∂H/∂p lies in it, with the scene's Hamiltonian or that of a regular Lagrangian.
struct Start {
  double time = 0.0;
  Vector q;       ///< Scene::storage_size() numbers
  Vector v;       ///< Scene::dimension() numbers, like p
  Vector p = {};  ///< used where v is empty, and always where the scene is given by a Hamiltonian alone
};

/// A continuous system: (L, Δ_Q) or (H, Δ_Q), or both, and a start.
///
///   q̇ = v ∈ Δ_Q(q),   p = ∂L/∂v,   ṗ − ∂L/∂q − f ∈ Δ°_Q(q)      Leok and Ohsawa (4.7)
///   q̇ = ∂H/∂p ∈ Δ_Q(q),            ṗ + ∂H/∂q − f ∈ Δ°_Q(q)      Leok and Ohsawa (4.11)
///
/// with an external force f beyond the paper.
///
/// A Hamiltonian alone needs no Lagrangian: it may be degenerate, as H = p0 q1 − p1 q0 or that of point
/// vortices is, and ∂²H/∂p² need not be invertible; what the rows ask of it is that A ∂²H/∂p² Aᵀ is.
struct Scene {
  std::string name;
  std::vector<std::string> coordinates;
  std::shared_ptr<const Lagrangian> lagrangian;
  std::shared_ptr<const Hamiltonian> hamiltonian;
  /// The Lagrangian is no datum: completed() derived it from the Hamiltonian.
  bool lagrangian_derived = false;
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
  /// Redundant constraints are a mistake and refused by name; else those that stay redundant are left out
  /// (with_independent_rows()).
  bool refuse_redundant_rows = false;
  /// Null in R^n.  Else velocities, momenta, one-forms and forces are left-trivialised: increments multiply
  /// from the right, velocities and momenta are in the body (spaces/space.hpp); L, rows and force are made by
  /// on_space(), `coordinates` name the components of a velocity, and there is no Hamiltonian.
  ///
  ///   q̇ = q v,   p = ∂L/∂v,   ṗ − ad*_v p − ∂L/∂q − f ∈ Δ°_Q(q)
  std::shared_ptr<const Space> space = {};

  /// Of the tangent spaces: how many numbers a velocity, a momentum, a row and the second derivatives of L
  /// have.
  int dimension() const { return static_cast<int>(coordinates.size()); }
  /// How many numbers a configuration is stored in.  In R^n the same n; a rotation takes four for three.
  int storage_size() const;
  int rows() const { return row_count(constraints); }
  std::vector<std::string> row_names() const;

  /// rate += ad*_v p, by which a momentum in the body turns with it: ⟨ad*_v p, w⟩ = ⟨p, [v, w]⟩.  Nothing in
  /// R^n.
  void add_turning(ConstVectorRef v, ConstVectorRef momentum, VectorRef rate) const;

  /// Given by a Hamiltonian alone: steps are taken and points are read by H, and momenta are data.
  bool by_hamiltonian() const { return hamiltonian && (!lagrangian || lagrangian_derived); }
  /// What is stepped: H(t,q,p) of such a scene, L(t,q,v) of others.
  const PhaseFunction& stepped_function() const;

  /// v·∂L/∂v − L.
  double energy(double t, ConstVectorRef q, ConstVectorRef v) const;
  /// The energy at a start that is complete: H(q,p) where the scene is given by a Hamiltonian alone.
  double energy(const Start& at) const;

  /// ∂L/∂q and ∂L/∂v at a point of a motion: −∂H/∂q and p where the scene is given by a Hamiltonian alone.
  void force_and_momentum(double t, ConstVectorRef q, ConstVectorRef v, ConstVectorRef p, VectorRef lq,
                          VectorRef momentum) const;
};

/// Throws Misuse where sizes disagree or a part is missing.
void require_well_formed(const Scene& scene);

/// The start with its velocity: itself where v is given; else v = ∂H/∂p with the scene's Hamiltonian or that
/// of its Lagrangian, and v = 0 where the Lagrangian is linear in v, so that the motion has but one velocity
/// at each q.  Of a scene given by a Hamiltonian alone p and v = ∂H/∂p, with p from v where v alone is given.
/// Everything that takes a Start completes it by this.  Throws Misuse for q, v or p of the wrong size, and
/// where the function that is to be inverted is degenerate.
Start completed_start(const Scene& scene, Start start);

/// The scene itself if it has a Lagrangian and a starting velocity; else a copy with its start complete, and
/// with the Lagrangian of its Hamiltonian where that is regular in p at the start.  Throws Misuse where it is
/// not well formed.
std::shared_ptr<const Scene> completed(std::shared_ptr<const Scene> scene);

/// The Lagrangian of a scene that was completed.  Throws Misuse where there is none, since the Hamiltonian is
/// degenerate, with the momenta along which it is linear.
std::shared_ptr<const Lagrangian> lagrangian_of(const Scene& scene);

/// A completed copy that is stepped and read by its Lagrangian, or by the one of its Hamiltonian.  Throws
/// Misuse as lagrangian_of() does.
std::shared_ptr<const Scene> with_lagrangian(const Scene& scene);

/// The scene's Hamiltonian, or the one derived from its Lagrangian.  Throws Misuse where that is degenerate.
std::shared_ptr<const Hamiltonian> hamiltonian_of(const Scene& scene);

/// A start that violates a row or an equation of motion that the rows hide.
class InconsistentStart : public Misuse {
 public:
  enum class Of { position, velocity };

  /// `reason` goes on behind "the start", `advice` behind that.
  InconsistentStart(const std::string& scene, const std::string& reason, Of of,
                    const std::string& advice = {})
      : Misuse("scene '" + scene + "': the start " + reason + advice), reason_(reason), of_(of) {}

  /// "violates row 'rod': φ(q) = 0.1, allowed 1e-10": what() without the scene and without advice.
  const std::string& reason() const { return reason_; }
  /// What it is that is off.
  Of of() const { return of_; }

 private:
  std::string reason_;
  Of of_;
};

/// Throws Misuse where the start, completed, is of the wrong size or not finite, InconsistentStart where it
/// violates φ(q) = 0 or has a velocity off the distribution; names the coordinate or the row, and the amount.
/// A row counts as violated when its residual exceeds 1e-10 of the terms that cancel in it.
void require_consistent(const Scene& scene, const Start& start);

}  // namespace diracstep
