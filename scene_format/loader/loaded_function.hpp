#pragma once

#include <diracstep/core/numerics/sparsity_pattern.hpp>
#include <diracstep/scene_format/loader/loaded_scene.hpp>
#include <diracstep/scene_format/loader/turns.hpp>
#include <functional>
#include <span>
#include <string>
#include <utility>
#include <vector>

namespace diracstep {

/// A function of a loaded scene, ready to be called kernel by kernel: every instance of its repeated pieces
/// has its coordinates, its rows and its constants.
class LoadedFunction {
 public:
  /// Of the coordinates of one turn of a repeated piece: whether the turn is kept; they may be renumbered.
  using KeepTurn = std::function<bool(std::span<int> coordinates)>;

  /// With `keep`, a function of those turns alone, of coordinates as they are numbered there.
  LoadedFunction(LoadedScenePtr scene, const scene_compiler::SceneFunction& function,
                 const KeepTurn& keep = nullptr);
  LoadedFunction(LoadedFunction&&) = default;  // its jobs point into its pieces

  const scene_compiler::SceneFunction& function() const { return *function_; }
  const LoadedScene& scene() const { return *scene_; }
  const std::vector<std::string>& row_names() const { return row_names_; }
  /// Where a row comes from that the file does not hold; empty for others.
  const std::string& row_origin(int row) const;
  int dimension() const { return scene_->layout.dimension(); }

  /// (i, j) of all derivatives: rows and coordinates for rows, else coordinates twice.
  std::vector<std::pair<int, int>> entries(bool curvature) const;

  /// Finds where each instance's derivatives go in the values of `pattern`.
  void find_positions(const SparsityPattern& pattern, bool curvature);

  /// Adds kernel `number` of every piece to call.out; the rest of the call, but in, t, s and multipliers, is
  /// filled in here.
  void run(std::size_t number, scene_compiler::KernelCall& call) const { run(number, call, 1); }

  /// The same at several points, at most `points` of them: columns in, in column by column.
  void run(std::size_t number, scene_compiler::KernelCall& call, int count) const;

  /// So many points are evaluated in one call, for functions of few coordinates: more than the nodes of
  /// GL(6). Others are evaluated point by point.
  static constexpr int points = 8;
  int points_at_once() const { return copies_; }

 private:
  /// A piece with all its instances laid out.
  struct LoadedPiece {
    const scene_compiler::Piece* piece;
    long count = 0;
    std::vector<int> slots = {};
    std::vector<double> instance = {};
    std::vector<int> positions = {}, curvature_positions = {};
  };
  /// One kernel of one piece with all that it is called with but the arguments.
  struct Job {
    scene_compiler::CompiledKernel compiled;  ///< null where it is interpreted
    const scene_compiler::Kernel* kernel;
    const LoadedPiece* loaded;
    long count;
    const int *slots, *positions;
    const double* instance;
  };
  void plan_jobs();
  void copy_slots();
  template <class Visit>
  void for_each_entry(const LoadedPiece& loaded, bool curvature, const Visit& visit) const;
  void place_rows();
  void load(const scene_compiler::Piece& piece, const KeepTurn& keep);
  int coordinate(const scene_compiler::Evaluator& body, std::size_t root, scene_compiler::Node leaf,
                 const Turns& turns) const;

  LoadedScenePtr scene_;
  const scene_compiler::SceneFunction* function_;
  const scene_compiler::CompiledKernel* table_;  ///< null where kernels are interpreted
  std::vector<LoadedPiece> pieces_;
  std::vector<std::vector<Job>> jobs_;  ///< by the number of the kernel
  int copies_ = 1;                      ///< of the tables of a piece, one for each point
  std::vector<int> first_rows_;
  std::vector<std::string> row_names_;
};

}  // namespace diracstep
