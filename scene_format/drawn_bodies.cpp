#include <diracstep/scene_format/compiler/evaluator.hpp>
#include <diracstep/scene_format/drawn_bodies.hpp>
#include <unordered_map>

namespace diracstep {

std::vector<DrawnBody> drawn_bodies(const LoadedScene& loaded) {
  using namespace scene_compiler;
  const SceneProgram& program = *loaded.program;
  if (program.drawn.empty()) return {};
  std::unordered_map<std::string, int> numbers;
  for (const std::string& name : loaded.layout.names())
    numbers.emplace(name, static_cast<int>(numbers.size()));
  std::vector<DrawnBody> bodies;
  for (std::size_t b = 0; b < program.drawn.size(); ++b) {
    const SceneDocument::DrawnBody& stated = program.document.bodies[b];
    DrawnBody& body = bodies.emplace_back(DrawnBody{stated.name, stated.shape, {}, {}});
    Evaluator values(program, loaded.parameters, program.drawn[b]);
    values.evaluate();
    for (std::size_t k = 0; k < stated.size.size(); ++k) body.size[k] = static_cast<double>(values.value(k));
    for (std::size_t k = 0; k < stated.fixed.size(); ++k)
      body.fixed[k] = static_cast<double>(values.value(stated.size.size() + k));
    for (const std::string& coordinate : stated.coordinates)
      body.coordinates.push_back(numbers.at(coordinate));
  }
  return bodies;
}

}  // namespace diracstep
