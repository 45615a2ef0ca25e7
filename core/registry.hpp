#pragma once

#include <diracstep/core/generating_function.hpp>
#include <diracstep/core/scene.hpp>
#include <diracstep/core/step_nodes.hpp>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

namespace diracstep {

/// What is stated of a method, and what an integrator needs to know to use it.
struct MethodInfo {
  std::string name;          ///< "type1/midpoint"
  GeneratingType type;       ///< the type of its generating function
  int order;                 ///< stated order in q and in projected p
  bool self_adjoint;         ///< Φ_{−h} = Φ_h⁻¹, so that it can be composed
  StepRule constraint_rule;  ///< the rule for Δ^d_Q that keeps its order
  std::string summary;
};

/// Makes the generating function of a method for a scene; throws Misuse where the scene lacks what it needs.
using GeneratingFunctionFactory = std::function<std::unique_ptr<GeneratingFunction>(const Scene&)>;

/// Methods by name.  A registry is a value: nothing is global.
class Registry {
 public:
  /// The methods that come with the library.
  static Registry with_built_ins();

  /// Throws Misuse for a name that is taken or is not of the form typeN/construction.
  void add(MethodInfo info, GeneratingFunctionFactory factory);

  /// Both throw Misuse for an unknown name, listing the known ones.
  const MethodInfo& info(const std::string& name) const;
  std::unique_ptr<GeneratingFunction> make(const std::string& name, const Scene& scene) const;

  std::vector<std::string> names() const;

 private:
  struct Entry {
    MethodInfo info;
    GeneratingFunctionFactory factory;
  };
  const Entry& find(const std::string& name) const;

  std::map<std::string, Entry> entries_;
};

}  // namespace diracstep
