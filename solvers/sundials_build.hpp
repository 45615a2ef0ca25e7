#pragma once

#include <string>

namespace diracstep {

/// The SUNDIALS that is linked, for reports of run times: "SUNDIALS 6.4.1 built with -O3 -DNDEBUG", or
/// "SUNDIALS 6.4.1 of the system, which may lack optimisation".  Debian compiles it without, which costs a
/// factor of 2 to 4.
std::string sundials_build();

/// Whether that one is known to be optimised: built with the project, at -O2 or -O3.
bool sundials_is_optimised();

}  // namespace diracstep
