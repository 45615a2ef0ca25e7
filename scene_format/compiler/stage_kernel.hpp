#pragma once

#include <diracstep/core/numerics/sparsity_pattern.hpp>
#include <diracstep/scene_format/compiler/scene_program.hpp>
#include <string>

namespace diracstep::scene_compiler {

/// The stage kernels of a scene (core/system/stage_kernel.hpp) as C: the residual of a step GL(s) and the
/// iteration around it, with the kernels of L and of the rows inlined and the stages side by side for SIMD.
///
/// There are some for 1 ≤ s ≤ 6 and scenes of few coordinates and rows that are written out: without loops,
/// the time, and rows of more than one kind.
class StageKernels {
 public:
  static constexpr int most_stages = 6;

  explicit StageKernels(const SceneProgram& program);

  bool any() const { return lagrangian_ != nullptr; }
  /// A C source with a table of this name that holds the kernel for so many stages.
  std::string source_file(const std::string& table, int stages) const;
  /// What follows the source of the other kernels of the scene: a table of this name with all of them.
  std::string appendix(const std::string& table) const;

 private:
  std::string source(int stages) const;
  std::string coordinates(const std::string& lines) const;
  std::string rows(const std::string& lines) const;
  std::string entries(const std::string& lines) const;
  std::string momentum() const;
  std::string impulses() const;
  std::string constraint() const;
  std::string norm(const std::string& result, const std::string& value, int count, const std::string& width,
                   const std::string& first) const;
  std::string correction() const;
  std::string correction_of_rows() const;
  std::string rows_at_gauss() const;
  /// Arrays that positions are read from and entries of A added to, and where.
  struct Names {
    const char *position, *entry, *lane;
  };
  std::string derivatives(const SceneFunction& function, std::size_t kernel, const Names& names) const;
  std::string target(const SceneFunction& function, const Piece& piece, const Store& store,
                     const char* entry) const;
  int coordinate(const Piece& piece, int slot) const;

  const SceneFunction *lagrangian_ = nullptr, *rows_ = nullptr;
  const FormulaGraph& graph_;
  int n_, m_ = 0;
  SparsityPattern pattern_;  ///< of the rows
};

}  // namespace diracstep::scene_compiler
