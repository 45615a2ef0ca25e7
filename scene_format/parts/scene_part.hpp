#pragma once

#include <diracstep/core/numerics/types.hpp>
#include <diracstep/scene_format/loader/loaded_function.hpp>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <unordered_map>
#include <vector>

namespace diracstep {

/// Another part that shares terms of L with this one.
struct PartNeighbour {
  int part;
  std::vector<int> sent;      ///< places here of what it reads
  std::vector<int> received;  ///< places here of what is read from it; both in the order of the scene
};

/// Part k of K of a scene file: the coordinates from ⌊n k/K⌋ to ⌊n (k+1)/K⌋ of its numbering, in which
/// neighbours of a chain or a lattice follow each other, and behind them those of other parts that share a
/// term of L with them.  It holds the terms with one of its own coordinates, in the order of the scene, so
/// that ∂L/∂q of these has the same bits for every K.
///
/// For L(t,q,v) = Σ m_i v_i²/2 + c_i v_i − V(t,q): explicit steps need no more than the values at the edges.
/// The time to build it grows with the whole scene, its memory with the part alone.
class ScenePart {
 public:
  /// `text` is that of the scene file `file`.  Throws Misuse for a scene with rows, forces, states or events,
  /// without a separable L with constant masses of each coordinate, and unless 0 ≤ part < parts ≤ n.
  static std::unique_ptr<ScenePart> read(const std::string& file, const std::string& text,
                                         const std::map<std::string, double>& changes, int part, int parts);
  ScenePart(const ScenePart&) = delete;
  ScenePart& operator=(const ScenePart&) = delete;

  int part() const { return part_; }
  const std::string& name() const;
  int scene_coordinates() const { return scene_->layout.dimension(); }
  int first() const { return first_; }
  int own() const { return own_; }
  int others() const { return static_cast<int>(others_.size()); }  ///< of other parts that are read
  const std::vector<PartNeighbour>& neighbours() const { return neighbours_; }

  double start_time() const { return start_time_; }
  double natural_step() const;
  double natural_end() const;
  const Vector& start_q() const { return start_q_; }  ///< own ones; those of others 0
  const Vector& start_v() const { return start_v_; }  ///< own ones

  /// m and c of the own coordinates: p = m v + c.
  const Vector& mass() const { return mass_; }
  const Vector& offset() const { return offset_; }

  /// ∂L/∂q of the own coordinates, for q of all that is here.
  void force(double t, const Vector& q, Vector& lq);
  /// Σ m v²/2 + V over terms whose first coordinate is an own one: the sum over all parts is the energy.
  double energy(double t, const Vector& q, const Vector& v) const;
  bool keeps_energy() const;  ///< L does not depend on t

 private:
  /// `as_written`: see FormulaGraph.
  ScenePart(const std::string& file, const std::string& text, const std::map<std::string, double>& changes,
            int part, int parts, bool as_written);
  bool is_own(int index) const { return index >= first_ && index < first_ + own_; }
  bool keep(std::span<int> coordinates);
  void share(std::span<const int> coordinates);
  void read_start();
  void read_masses();
  void run_gradient(double t, const Vector& q, const Vector& v);

  std::shared_ptr<const LoadedScene> scene_;
  int part_, parts_, first_ = 0, own_ = 0;
  std::unordered_map<int, int> others_;  ///< places here of coordinates of other parts
  std::map<int, std::map<int, int>> sent_,
      received_;  ///< while terms are read: by part, by number in the scene
  std::vector<PartNeighbour> neighbours_;
  std::optional<LoadedFunction> terms_, own_terms_;
  double start_time_ = 0.0;
  Vector start_q_, start_v_, mass_, offset_, lq_, lv_, still_;
};

}  // namespace diracstep
