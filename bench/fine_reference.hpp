#pragma once

#include <diracstep/core/adaptive/error_control.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>
#include <diracstep/validation/studies/study_run.hpp>

namespace diracstep {

/// The scene's reference, or a run of GL(8) refined until round-off stops it.
inline ReferenceEnd fine_reference(const CatalogueScene& scene, const Registry& registry) {
  if (scene.reference.at && scene.reference.at(scene.t_end)) return reference_end(scene, scene.t_end);
  const ErrorControlReport fine = solve_to_error(
      scene.scene, registry, kinsol(), scene.t_end,
      {.error = 1e-16, .method = "type1/gl:8", .adaptive = false, .first_step = scene.natural_step});
  return {.kind = "GL(8)",
          .how = fine.refusal,
          .self_error = fine.runs.back().difference,
          .missing = {},
          .q = fine.end.q,
          .p = fine.end.p};
}

}  // namespace diracstep
