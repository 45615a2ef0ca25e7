#include <sundials/sundials_version.h>

#include <array>
#include <diracstep/solvers/sundials_build.hpp>

namespace diracstep {

std::string sundials_build() {
  std::array<char, 64> version{};
  if (SUNDIALSGetVersion(version.data(), static_cast<int>(version.size())) != 0)
    version = {"of unknown version"};
#ifdef DIRACSTEP_SUNDIALS_FLAGS
  return std::string("SUNDIALS ") + version.data() + " built with " DIRACSTEP_SUNDIALS_FLAGS;
#else
  return std::string("SUNDIALS ") + version.data() + " of the system";
#endif
}

}  // namespace diracstep
