#pragma once

#include <diracstep/scene_format/compiler/scene_program.hpp>
#include <memory>
#include <string>

namespace diracstep {

/// The compiled kernels of a scene, and where they came from.
struct KernelLibrary {
  const scene_compiler::CompiledKernel* kernels = nullptr;  ///< null: they are interpreted
  std::shared_ptr<void> handle = {};                        ///< keeps them loaded
  std::string origin = {};  ///< for people; says what is missing where they are interpreted
};

/// Kernels that came with the library, or from the cache, or compiled now and put there.  The cache is a
/// directory of shared objects named by the content of their source: $DIRACSTEP_CACHE, else
/// $XDG_CACHE_HOME/diracstep, else
/// ~/.cache/diracstep.  The compiler is $DIRACSTEP_CC, else cc, gcc or clang.  Where none works the kernels
/// are interpreted: the same numbers, more slowly.
KernelLibrary kernel_library(const scene_compiler::SceneProgram& program);

}  // namespace diracstep
