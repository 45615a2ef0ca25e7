#include <sundials/sundials_version.h>

#include <array>
#include <diracstep/solvers/sundials_build.hpp>
#include <string_view>

namespace diracstep {

std::string sundials_build() {
  std::array<char, 64> version{};
  if (SUNDIALSGetVersion(version.data(), static_cast<int>(version.size())) != 0)
    version = {"of unknown version"};
#ifdef DIRACSTEP_SUNDIALS_FLAGS
  return std::string("SUNDIALS ") + version.data() + " built with " DIRACSTEP_SUNDIALS_FLAGS;
#else
  return std::string("SUNDIALS ") + version.data() + " of the system, which may lack optimisation";
#endif
}

bool sundials_is_optimised() {
#ifdef DIRACSTEP_SUNDIALS_FLAGS
  const std::string_view flags = DIRACSTEP_SUNDIALS_FLAGS;
  return flags.find("-O2") != flags.npos || flags.find("-O3") != flags.npos;
#else
  return false;
#endif
}

}  // namespace diracstep
