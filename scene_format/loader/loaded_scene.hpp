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

/// A scene file compiled: what does not depend on the values of its parameters.
struct CompiledScene {
  explicit CompiledScene(std::unique_ptr<const scene_compiler::SceneProgram> scene)
      : program(std::move(scene)), library(kernel_library(*program)), stage_kernels(*program, library) {}

  std::unique_ptr<const scene_compiler::SceneProgram> program;
  KernelLibrary library;
  StageKernelLibrary stage_kernels;
};

/// A scene file with its parameters set: all that its functions share.
struct LoadedScene {
  /// Without `named_coordinates` the layout has no names.
  LoadedScene(std::shared_ptr<const CompiledScene> scene, scene_compiler::ParameterValues values,
              bool named_coordinates = true);

  std::shared_ptr<const CompiledScene> compiled;
  const scene_compiler::SceneProgram* program;  ///< that of `compiled`, as the two below
  const KernelLibrary& library;
  const StageKernelLibrary& stage_kernels;
  scene_compiler::ParameterValues parameters;
  CoordinateLayout layout;
  std::vector<double> known;  ///< subexpressions of the parameters alone

  /// Names of the components of a velocity: the coordinates in R^n, fewer than these on groups and spheres.
  const std::vector<std::string>& components() const {
    const auto& on_space = program->document.spaces.components;
    return on_space.empty() ? layout.names() : on_space;
  }
};
using LoadedScenePtr = std::shared_ptr<const LoadedScene>;

}  // namespace diracstep
