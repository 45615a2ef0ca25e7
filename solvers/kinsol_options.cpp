#include <array>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/solvers/kinsol_options.hpp>
#include <utility>

namespace diracstep {

namespace {

template <class Enum, std::size_t N>
Enum find_name(const char* what, const std::array<std::pair<const char*, Enum>, N>& names,
               const std::string& name) {
  std::string allowed;
  for (const auto& [text, value] : names) {
    if (name == text) return value;
    allowed += (allowed.empty() ? "" : ", ") + std::string(text);
  }
  throw Misuse(std::string(what) + " '" + name + "'; there are " + allowed);
}

constexpr std::array<std::pair<const char*, JacobianPolicy>, 4> policy_names{
    {{"automatic", JacobianPolicy::automatic},
     {"fresh", JacobianPolicy::fresh},
     {"per-step", JacobianPolicy::per_step},
     {"kept", JacobianPolicy::kept}}};
constexpr std::array<std::pair<const char*, Iteration>, 3> iteration_names{
    {{"newton", Iteration::newton},
     {"fixed-point", Iteration::fixed_point},
     {"automatic", Iteration::automatic}}};

}  // namespace

const char* name(JacobianPolicy policy) { return policy_names.at(static_cast<std::size_t>(policy)).first; }
const char* name(Iteration iteration) {
  return iteration_names.at(static_cast<std::size_t>(iteration)).first;
}

JacobianPolicy jacobian_policy(const std::string& name) {
  return find_name("Jacobian policy", policy_names, name);
}
Iteration iteration(const std::string& name) { return find_name("iteration", iteration_names, name); }

}  // namespace diracstep
