#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <diracstep/core/equilibrium/operating_point.hpp>
#include <diracstep/scene_format/detail/start_of_file.hpp>
#include <diracstep/scene_format/loader/named_values.hpp>
#include <diracstep/scene_format/loader/scene_functions.hpp>
#include <diracstep/scene_format/spaces/named_space.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>

namespace diracstep {

using namespace scene_compiler;

StatedStart start_of(const LoadedScene& loaded) {
  const SceneProgram& program = *loaded.program;
  const auto n = static_cast<std::size_t>(loaded.layout.dimension());
  const std::size_t components = loaded.components().size();
  StatedStart stated{
      {}, std::vector(n, StartOrigin::left_out), std::vector(components, StartOrigin::left_out)};
  Evaluator time(program, loaded.parameters, {program.start_time});
  time.evaluate();
  Start start{static_cast<double>(time.value(0)), Vector::Zero(loaded.layout.dimension()), {}, {}};
  if (!program.document.spaces.kinds.empty())
    start.q = named_space(program.document.spaces.kinds)->identity();
  Vector second = Vector::Zero(static_cast<Eigen::Index>(components));
  for (const NamedValue& named : program.start)
    for_each_value(loaded, named, start.time, [&](int index, double value) {
      const bool position = named.role == Role::position;
      const auto& names = position ? loaded.layout.names() : loaded.components();
      if (!std::isfinite(value))
        throw SceneError(program.document.file, named.place,
                         fmt::format("the start of '{}' is {}; expected a finite number{}",
                                     names[static_cast<std::size_t>(index)], value,
                                     program.document.spaces.kinds.empty() || !position
                                         ? ""
                                         : ": an axis, or a vector of a sphere, needs a length above 0"));
      (position ? start.q : second)[index] = value;
      (position ? stated.q : stated.v)[static_cast<std::size_t>(index)] = StartOrigin::given;
    });
  const bool by_momentum = program.start_by_momentum || !program.lagrangian;
  (by_momentum ? start.p : start.v) = second;
  stated.start = std::move(start);
  return stated;
}

std::string put_on_space(const LoadedScene& loaded, Start& start) {
  constexpr double most = 1e-3, told = 1e-8;
  const SceneDocument& document = loaded.program->document;
  if (document.spaces.kinds.empty()) return {};
  const Vector on = named_space(document.spaces.kinds)->normalised(start.q);
  for (Eigen::Index i = 0; i < on.size(); ++i)
    if (!(std::abs(on[i] - start.q[i]) < most)) {
      const auto& coordinate = document.coordinates[static_cast<std::size_t>(i)];
      throw SceneError(
          document.file, coordinate.place,
          fmt::format("the start has {} = {:g} where a unit quaternion, or a cosine and its sine, "
                      "has {:g}",
                      coordinate.name, start.q[i], on[i]));
    }
  const double moved = (on - start.q).lpNorm<Eigen::Infinity>();
  start.q = on;
  return moved < told ? "" : fmt::format("start put onto its groups and spheres, by {:.2g}", moved);
}

void set_rates_of_states(const LoadedScenePtr& loaded, StatedStart& stated) {
  for (const StateProgram& state : loaded->program->states) {
    const int index = loaded->layout.position(state.family, {0, 0});
    const Start& start = stated.start;
    const double rate = file_value(loaded, state.rate)(start.time, start.q, start.v);
    stated.start.v[index] = rate;
    stated.v[static_cast<std::size_t>(index)] = StartOrigin::rate;
  }
}

Guesses guesses_of(const LoadedScene& loaded) {
  Guesses guesses;
  if (loaded.program->guesses.empty()) return guesses;
  const auto n = static_cast<std::size_t>(loaded.layout.dimension());
  guesses = {std::vector<bool>(n, false), std::vector<bool>(n, false)};
  for (const NamedValue& named : loaded.program->guesses)
    for_each_value(loaded, named, 0.0, [&](int index, double) {
      (named.role == Role::position ? guesses.q : guesses.v)[static_cast<std::size_t>(index)] = true;
    });
  for (const StateProgram& state : loaded.program->states)
    guesses.v[static_cast<std::size_t>(loaded.layout.position(state.family, {0, 0}))] = true;
  return guesses;
}

std::vector<bool> resting_coordinates(const LoadedScene& loaded) {
  const SceneProgram& program = *loaded.program;
  std::vector<bool> rests(static_cast<std::size_t>(loaded.layout.dimension()), true);
  for (const auto& branch : program.document.branches)
    for (const std::string& name : {"q" + branch.name, "f" + branch.name}) {
      const int family = program.symbols.family(name);
      if (family < 0 || (branch.kind == "capacitor" && name[0] == 'q')) continue;
      for (long i = 0; i < loaded.layout.count(family); ++i)
        rests[static_cast<std::size_t>(loaded.layout.position(family, loaded.layout.element(family, i)))] =
            false;
    }
  return rests;
}

void start_at_operating_point(const LoadedScene& loaded, Scene& scene, StatedStart& stated) {
  if (!loaded.program->document.operating_point) return;
  scene.start = operating_point(scene, scene.start, resting_coordinates(loaded));
  stated.start = scene.start;
}

void project(const LoadedScene& loaded, CatalogueScene& entry, StatedStart& stated) {
  const Scene& scene = *entry.scene;
  const Guesses guesses = guesses_of(loaded);
  if ((!loaded.program->document.project && guesses.q.empty()) || scene.start.v.size() == 0) return;
  const auto mark = [](std::vector<StartOrigin>& origins, const std::vector<bool>& guessed) {
    for (std::size_t i = 0; i < origins.size(); ++i)
      if (guessed.empty() || guessed[i]) origins[i] = StartOrigin::guess;
  };
  mark(stated.q, guesses.q);
  mark(stated.v, guesses.v);
  auto moved = std::make_shared<Scene>(scene);
  moved->start = project_start(scene, scene.start, kinsol(), guesses).start;
  const std::string moves = describe_moves(scene, scene.start, moved->start);
  if (!moves.empty()) entry.changes.push_back("start moved onto the rows: " + moves);
  entry.scene = std::move(moved);
}

}  // namespace diracstep
