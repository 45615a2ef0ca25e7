#pragma once

#include <diracstep/scene_format/loader/coordinate_layout.hpp>
#include <diracstep/scene_format/loader/kernel_library.hpp>
#include <memory>
#include <vector>

namespace diracstep {

/// Thrown where a subexpression of the parameters, gathered to save time, leaves the range of doubles: the
/// formulas must be computed as written (FormulaGraph).
struct ConstantOutOfRange {};

/// The value as a double.  Throws ConstantOutOfRange where it loses its size, unless formulas are as written.
double constant(const scene_compiler::SceneProgram& program, long double value);

/// A scene file with its parameters set: all that its functions share.
struct LoadedScene {
  LoadedScene(std::unique_ptr<const scene_compiler::SceneProgram> compiled,
              scene_compiler::ParameterValues values);

  std::unique_ptr<const scene_compiler::SceneProgram> program;
  scene_compiler::ParameterValues parameters;
  CoordinateLayout layout;
  std::vector<double> known;  ///< subexpressions of the parameters alone
  KernelLibrary library;
  StageKernelLibrary stage_kernels;
};
using LoadedScenePtr = std::shared_ptr<const LoadedScene>;

}  // namespace diracstep
