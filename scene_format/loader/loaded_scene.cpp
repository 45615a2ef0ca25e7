#include <diracstep/scene_format/loader/loaded_scene.hpp>

namespace diracstep {

using namespace scene_compiler;

LoadedScene::LoadedScene(std::unique_ptr<const SceneProgram> compiled, ParameterValues values)
    : program(std::move(compiled)),
      parameters(std::move(values)),
      layout(*program, parameters),
      library(kernel_library(*program)) {
  Evaluator evaluator(*program, parameters, program->known.nodes());
  evaluator.evaluate();
  for (std::size_t i = 0; i < program->known.nodes().size(); ++i)
    known.push_back(static_cast<double>(evaluator.value(i)));
}

}  // namespace diracstep
