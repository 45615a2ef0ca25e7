#pragma once

#include <cstddef>
#include <diracstep/scene_format/compiler/kernel.hpp>
#include <span>

namespace diracstep {

/// A scene that comes with the library: its text, and its kernels as they were compiled with the library.
struct ShippedScene {
  const char* name;
  const unsigned char* text;
  std::size_t size;
  const char* program;  ///< the content name of the kernels' source
  const scene_compiler::CompiledKernel* kernels;
  const scene_compiler::CompiledStageKernel* stages;  ///< from s = 1 on; null where there are none
};

/// Sorted by name.
std::span<const ShippedScene> shipped_scenes();

}  // namespace diracstep
