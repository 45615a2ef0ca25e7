#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <diracstep/core/integrator/integrator.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/scene_format/scene_file.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>

#include "generated_scene.hpp"

/// libFuzzer's entry: bytes as choices in the grammar of scene files.  The scene is compiled, loaded and
/// stepped ten times with interpreted kernels; each stage succeeds or says why not.  A step that succeeds is
/// finite.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace diracstep;
  setenv("DIRACSTEP_CC", "none", 1);
  const std::string text = GeneratedScene(data, size).text();
  try {
    const CatalogueScene entry = scene_from_text("generated.toml", text);
    static const Registry registry = Registry::with_built_ins();
    Integrator integrator(entry.scene, registry, kinsol(), {.method = "type1/midpoint", .step = 0.01});
    for (int k = 0; k < 10; ++k) {
      const StepReport report = integrator.step();
      if (!report.ok() && report.failure.empty()) std::abort();
      if (!report.ok()) break;
      if (!integrator.position().allFinite() || !integrator.momentum().allFinite()) std::abort();
    }
  } catch (const Misuse& refused) {
    if (*refused.what() == '\0') std::abort();
  }
  return 0;
}
