#pragma once

#include <fmt/format.h>

#include <array>
#include <diracstep/scene_format/compiler/evaluator.hpp>
#include <diracstep/scene_format/loader/loaded_scene.hpp>
#include <vector>

namespace diracstep {

/// Calls set(index, value) for each element that `named` gives a value to and whose index is wanted.
template <class Wanted, class Set>
void for_each_wanted_value(const LoadedScene& loaded, const scene_compiler::NamedValue& named, double t,
                           const Wanted& wanted, const Set& set) {
  using scene_compiler::Evaluator, scene_compiler::Node, scene_compiler::none, scene_compiler::Op;
  using scene_compiler::SceneError, scene_compiler::SceneProgram;
  const SceneProgram& program = *loaded.program;
  std::vector<Node> roots = named.values;
  const bool two = named.index != none && program.graph[named.index].op == Op::list;
  if (two)
    roots.insert(roots.end(), {program.graph[named.index].a, program.graph[named.index].b});
  else if (named.index != none)
    roots.push_back(named.index);
  Evaluator evaluator(program, loaded.parameters, roots);
  evaluator.set_time(t);
  if (named.index != none) {
    evaluator.evaluate();
    const std::array<long, 2> index{evaluator.whole(1), two ? evaluator.whole(2) : 0};
    const int position = loaded.layout.position(named.family, index);
    if (position < 0)
      throw SceneError(program.document.file, named.place,
                       "there is no " + loaded.layout.name(named.family, index));
    if (wanted(position)) set(position, static_cast<double>(evaluator.value(0)));
    return;
  }
  const long count = loaded.layout.count(named.family);
  if (named.values.size() > 1 && static_cast<long>(named.values.size()) != count)
    throw SceneError(program.document.file, named.place,
                     fmt::format("{} values; expected {}", named.values.size(), count));
  const auto& loops = program.symbols.families[static_cast<std::size_t>(named.family)].loops;
  for (long i = 0; i < count; ++i) {
    const auto index = loaded.layout.element(named.family, i);
    const int position = loaded.layout.position(named.family, index);
    if (!wanted(position)) continue;
    for (std::size_t k = 0; k < loops.size(); ++k) evaluator.set_loop(loops[k], index[k]);
    evaluator.evaluate();
    const std::size_t which = named.values.size() > 1 ? static_cast<std::size_t>(i) : 0;
    set(position, static_cast<double>(evaluator.value(which)));
  }
}

/// The same for all elements.
template <class Set>
void for_each_value(const LoadedScene& loaded, const scene_compiler::NamedValue& named, double t,
                    const Set& set) {
  for_each_wanted_value(
      loaded, named, t, [](int) { return true; }, set);
}

}  // namespace diracstep
