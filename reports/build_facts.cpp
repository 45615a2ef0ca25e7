#include <diracstep/version.h>
#include <sys/utsname.h>

#include <diracstep/reports/build_facts.hpp>
#include <diracstep/solvers/sundials_build.hpp>
#include <fstream>
#include <string>
#include <thread>

namespace diracstep {

namespace {

std::string processor() {
  std::ifstream file("/proc/cpuinfo");
  for (std::string line; std::getline(file, line);)
    if (line.rfind("model name", 0) == 0 && line.find(": ") != std::string::npos)
      return line.substr(line.find(": ") + 2);
  return unknown_fact;
}

std::string system() {
  utsname names{};
  if (uname(&names) != 0) return unknown_fact;
  return std::string(names.sysname) + ' ' + names.release + ", " + names.machine + ", " +
         std::to_string(std::thread::hardware_concurrency()) + " processors";
}

std::string compiler() {
#if defined(__clang__)
  return "Clang " __clang_version__;
#elif defined(__GNUC__)
  return "GCC " __VERSION__;
#else
  return unknown_fact;
#endif
}

}  // namespace

std::vector<std::pair<std::string, std::string>> build_facts() {
  return {{"diracstep", DIRACSTEP_VERSION},
          {"sundials", sundials_build()},
          {"compiler", compiler()},
          {"processor", processor()},
          {"system", system()}};
}

}  // namespace diracstep
