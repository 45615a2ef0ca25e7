#pragma once

#include <string>

namespace diracstep {

/// The SUNDIALS that is linked, for reports of run times: "SUNDIALS 6.4.1 of the system" or
/// "SUNDIALS 6.4.1 built with -O3 -DNDEBUG".  Distributions may compile it without optimisation, which costs
/// a factor of 2 to 4.
std::string sundials_build();

}  // namespace diracstep
