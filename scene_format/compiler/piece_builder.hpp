#pragma once

#include <diracstep/scene_format/compiler/scene_program.hpp>

namespace diracstep::scene_compiler {

/// Differentiates pieces whose loops and outputs are set, and plans their kernels.
class PieceBuilder {
 public:
  PieceBuilder(FormulaGraph& graph, Constants& known) : graph_(graph), known_(known) {}

  /// Adds the piece of f(t, x, y), its derivatives and what they show of the structure.
  void add_phase(SceneFunction& function, Piece piece);
  /// `offsets` are the outputs without their terms in v; not used for holonomic rows.
  void add_rows(SceneFunction& function, Piece piece, const std::vector<Node>& offsets);
  void add_force(SceneFunction& function, Piece piece);
  /// f alone, without derivatives.
  void add_value(SceneFunction& function, Piece piece);
  /// The outputs alone, each in the place of its row.
  void add_outputs(SceneFunction& function, Piece piece);

 private:
  using Matrix = std::vector<std::vector<Node>>;

  void find_slots(Piece& piece);
  Node leaf(const Piece& piece, std::size_t slot, Role role);
  /// ∂root/∂(coordinate of this role) for each root and slot.
  Matrix gradients(const Piece& piece, const std::vector<Node>& roots, Role role);
  bool zero(Node node) const { return graph_.is_number(node, 0.0); }
  bool varies(Node node) const { return graph_.known(node) == Known::each_call; }
  bool has_kink(const Piece& piece) const;
  void add_kernel(Piece& piece, const std::vector<Store>& stores);

  FormulaGraph& graph_;
  Constants& known_;
};

}  // namespace diracstep::scene_compiler
