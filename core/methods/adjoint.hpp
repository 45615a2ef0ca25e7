#pragma once

#include <diracstep/core/dirac/generating_function.hpp>
#include <memory>

namespace diracstep {

/// The generating function of the adjoint step Φ*_h = (Φ_{−h})⁻¹.  With the arguments exchanged and the step
/// run backwards, S*(h; a, b) = −S(−h; b, a); types 1 and 4 stay, types 2 and 3 change places.
std::unique_ptr<GeneratingFunction> adjoint(std::unique_ptr<GeneratingFunction> generating_function);

/// The type of the adjoint.
GeneratingType adjoint_type(GeneratingType type);

}  // namespace diracstep
