#include <diracstep/version.h>

#include <diracstep/solvers/sundials_build.hpp>
#include <diracstep/validation/build_facts.hpp>
#include <fstream>

namespace diracstep {

namespace {

std::string processor() {
  std::ifstream file("/proc/cpuinfo");
  for (std::string line; std::getline(file, line);)
    if (line.rfind("model name", 0) == 0 && line.find(": ") != std::string::npos)
      return line.substr(line.find(": ") + 2);
  return "unknown";
}

std::string compiler() {
#if defined(__clang__)
  return "Clang " __clang_version__;
#elif defined(__GNUC__)
  return "GCC " __VERSION__;
#else
  return "unknown";
#endif
}

}  // namespace

std::vector<std::pair<std::string, std::string>> build_facts() {
  return {{"diracstep", DIRACSTEP_VERSION},
          {"sundials", sundials_build()},
          {"compiler", compiler()},
          {"processor", processor()}};
}

}  // namespace diracstep
