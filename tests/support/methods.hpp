#pragma once

#include <cctype>
#include <diracstep/core/methods/registry.hpp>
#include <string>
#include <vector>

namespace diracstep::testing {

/// Every method that comes with the library and is the graph of a generating function of the end points,
/// Legendre transforms included: what the law suites run over, so that a new method is covered by being
/// registered.
inline const std::vector<std::string>& every_method() {
  static const std::vector<std::string> names = [] {
    const Registry registry = Registry::with_built_ins();
    std::vector<std::string> graphs = registry.names();
    std::erase_if(graphs, [&](const std::string& name) {
      const Method method = registry.method(name);
      return !method.make || method.rows_inside;
    });
    return graphs;
  }();
  return names;
}

/// A method's name as a test name.
inline std::string test_name(std::string name) {
  for (char& c : name)
    if (!std::isalnum(static_cast<unsigned char>(c))) c = '_';
  return name;
}

}  // namespace diracstep::testing
