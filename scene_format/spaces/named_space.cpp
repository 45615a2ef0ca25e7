#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/scene_format/spaces/named_space.hpp>

namespace diracstep {

namespace {

using FactorPointer = std::shared_ptr<const SpaceFactor>;

template <class Factor>
FactorPointer factor() {
  return std::make_shared<const detail::FactorOf<Factor>>();
}

FactorPointer flat_factor(char size) {
  switch (size) {
    case '1':
      return factor<spaces::R<1>>();
    case '2':
      return factor<spaces::R<2>>();
    case '3':
      return factor<spaces::R<3>>();
    default:
      return nullptr;
  }
}

void add_factor(std::vector<FactorPointer>& factors, const std::string& kind) {
  if (kind == "SO3") return factors.push_back(factor<spaces::SO3>());
  if (kind == "SE3") return factors.push_back(factor<spaces::SE3>());
  if (kind == "SE2") return factors.push_back(factor<spaces::SE2>());
  if (kind == "S2") return factors.push_back(factor<spaces::S2>());
  if (kind == "S1") return factors.push_back(factor<spaces::S1>());
  if (const FactorPointer flat = flat_factor(kind.back())) return factors.push_back(flat);
  for (char k = '0'; k < kind.back(); ++k) factors.push_back(factor<spaces::R<1>>());  // R4 … R9
}

}  // namespace

std::shared_ptr<const Space> named_space(const std::vector<std::string>& kinds) {
  std::vector<FactorPointer> factors;
  for (const std::string& kind : kinds) add_factor(factors, kind);
  return std::make_shared<const Space>(std::move(factors));
}

}  // namespace diracstep
