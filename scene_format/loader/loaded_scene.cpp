#include <cmath>
#include <diracstep/scene_format/loader/loaded_scene.hpp>

namespace diracstep {

using namespace scene_compiler;

double constant(const SceneProgram& program, long double value) {
  const auto rounded = static_cast<double>(value);
  const bool kept = std::isnormal(rounded) || static_cast<long double>(rounded) == value;
  if (!kept && std::isfinite(value) && !program.graph.as_written()) throw ConstantOutOfRange();
  return rounded;
}

LoadedScene::LoadedScene(std::shared_ptr<const CompiledScene> scene, ParameterValues values,
                         bool named_coordinates)
    : compiled(std::move(scene)),
      program(compiled->program.get()),
      library(compiled->library),
      stage_kernels(compiled->stage_kernels),
      parameters(std::move(values)),
      layout(*program, parameters, named_coordinates) {
  Evaluator evaluator(*program, parameters, program->known.nodes());
  evaluator.evaluate();
  for (std::size_t i = 0; i < program->known.nodes().size(); ++i)
    known.push_back(constant(*program, evaluator.value(i)));
}

}  // namespace diracstep
