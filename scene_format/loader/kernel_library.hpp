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

/// Kernels that came with the library, or from the cache (KernelCache), or compiled now and put there.  Their
/// key in the cache is the SHA-256 of their source, the compiler's path, size and date, its flags, the C
/// library and the version of this library.  The compiler is $DIRACSTEP_CC, else cc, gcc or clang; it is
/// ended with all that it started after $DIRACSTEP_CC_SECONDS, or 120 s.  Where none works, and for a source
/// above SizeLimits::source_bytes, the kernels are interpreted: the same numbers, more slowly.
KernelLibrary kernel_library(const scene_compiler::SceneProgram& program);

}  // namespace diracstep
