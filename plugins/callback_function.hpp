#pragma once

#include <diracstep/plugins/diracstep_plugin.h>

#include <diracstep/core/dirac/generating_function.hpp>
#include <diracstep/core/system/scene.hpp>
#include <memory>
#include <string>

namespace diracstep {

/// The generating function that C callbacks describe, on one scene; what they leave out is taken by
/// differences.  `owner` stands in messages: "plugin 'x', method 'y'".  `library` is kept as long as the
/// object.  Throws Misuse where create refuses the scene, or the scene lacks a Hamiltonian that is needed.
/// A callback that fails later throws CallbackError, and an error of the scene's own functions passes
/// through.
std::unique_ptr<GeneratingFunction> callback_function(const diracstep_method& method, const Scene& scene,
                                                      const std::string& owner,
                                                      std::shared_ptr<const void> library);

/// Shows a C++ function of the library as a C one.  `function` must outlive the view.  `failure` receives an
/// exception, which must not cross the C code in between; the status is then 1.
struct FunctionView {
  const PhaseFunction* function = nullptr;
  std::exception_ptr* failure = nullptr;
};
diracstep_function view_of(const FunctionView& view);

}  // namespace diracstep
