#pragma once

#include <cctype>
#include <diracstep/core/methods/registry.hpp>
#include <string>
#include <vector>

namespace diracstep::testing {

/// Every method that comes with the library, Legendre transforms and GL(s) included: what the law suites run
/// over, so that a new method is covered by being registered.
inline const std::vector<std::string>& every_method() {
  static const std::vector<std::string> names = Registry::with_built_ins().names();
  return names;
}

/// The method of s Gauss-Lobatto stages.
inline std::string gl(int s) { return "type1/gl:" + std::to_string(s); }

/// A method's name as a test name.
inline std::string test_name(std::string name) {
  for (char& c : name)
    if (!std::isalnum(static_cast<unsigned char>(c))) c = '_';
  return name;
}

}  // namespace diracstep::testing
