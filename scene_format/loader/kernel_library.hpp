#pragma once

#include <array>
#include <atomic>
#include <diracstep/scene_format/compiler/scene_program.hpp>
#include <diracstep/scene_format/compiler/stage_kernel.hpp>
#include <memory>
#include <mutex>
#include <string>

namespace diracstep {

/// The compiled kernels of a scene, and where they came from.
struct KernelLibrary {
  const scene_compiler::CompiledKernel* kernels = nullptr;  ///< null: they are interpreted
  std::shared_ptr<void> handle = {};                        ///< keeps them loaded
  std::string origin = {};  ///< for people; says what is missing where they are interpreted
  const scene_compiler::CompiledStageKernel* stages = nullptr;  ///< of a shipped scene, from s = 1 on
};

/// Kernels that came with the library, or from the cache (KernelCache), or compiled now and put there.  Their
/// key in the cache is the SHA-256 of their source, the compiler's path, size and date, its flags, the C
/// library and the version of this library.  The compiler is $DIRACSTEP_CC, else cc, gcc or clang; it is
/// ended with all that it started after $DIRACSTEP_CC_SECONDS, or 120 s.  Where none works, and for a source
/// above SizeLimits::source_bytes, the kernels are interpreted: the same numbers, more slowly.
KernelLibrary kernel_library(const scene_compiler::SceneProgram& program);

/// The stage kernels of a scene whose kernels are compiled: those that came with the library, or each from
/// the cache or compiled as above.  May be used from several threads at once.
class StageKernelLibrary {
 public:
  /// Both outlive it.
  StageKernelLibrary(const scene_compiler::SceneProgram& program, const KernelLibrary& kernels)
      : program_(program), kernels_(kernels), sources_(program) {}

  /// Null where there is none, or none yet, as StageKernelSource::stage_kernel says.
  scene_compiler::CompiledStageKernel kernel(int stages, long evaluations) const;

 private:
  struct Compiled {
    std::atomic<long> evaluations = 0;       ///< without it, of all steps
    bool looked_for = false, tried = false;  ///< in the cache; and compiled
    scene_compiler::CompiledStageKernel kernel = nullptr;
    std::shared_ptr<void> handle = {};
  };
  const scene_compiler::SceneProgram& program_;
  const KernelLibrary& kernels_;
  scene_compiler::StageKernels sources_;
  mutable std::mutex mutex_;
  mutable std::array<Compiled, scene_compiler::StageKernels::most_stages> compiled_;
};

}  // namespace diracstep
