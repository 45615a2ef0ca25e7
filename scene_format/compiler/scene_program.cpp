#include <fmt/format.h>

#include <algorithm>
#include <diracstep/scene_format/compiler/detail/scene_compiler.hpp>
#include <diracstep/scene_format/compiler/input_table.hpp>
#include <diracstep/scene_format/compiler/kink_finder.hpp>
#include <diracstep/scene_format/compiler/scene_program.hpp>
#include <set>

namespace diracstep::scene_compiler {

void SceneCompiler::compile() {
  declare();
  circuit_.declare();
  compile_energies();
  compile_rows();
  compile_force();
  compile_start();
  compile_references();
  compile_invariants();
  for (const auto& output : document_.outputs)
    program_.outputs.push_back(
        {output.name, motion_function(output.formula, "output '" + output.name + "'")});
  if (document_.control && !program_.differentiated.empty()) compile_control(*document_.control);
  for (const auto& event : document_.events) compile_event(event);
  for (const auto& body : document_.bodies) compile_drawn(body);
  write_source();
  program_.kinks = KinkFinder(program_, builder_).find();
}

void SceneCompiler::fail(Place place, const std::string& message) const {
  throw SceneError(document_.file, place, message);
}

Context SceneCompiler::mechanics(const std::string& what, char second, std::vector<int> loops) const {
  return {.what = what,
          .positions = true,
          .second = second,
          .time = true,
          .sums = true,
          .mechanics = true,
          .loops = std::move(loops)};
}

void SceneCompiler::declare() {
  if (document_.coordinates.empty()) fail({}, "the scene has no [coordinates]");
  for (const auto& parameter : document_.parameters)
    symbols_.add(Symbols::Parameter{parameter.name, parameter.array});
  symbols_.definitions = document_.definitions;
  for (const auto& row : document_.rows)
    if (!row.loops) symbols_.rows.push_back(row.name);
  for (const auto& input : document_.inputs)
    symbols_.inputs.emplace(input.name, graph_.add_table(table_of(input)));
  for (const auto& coordinate : document_.coordinates) {
    Symbols::Family family{coordinate.name, {}, coordinate.cyclic};
    if (coordinate.loops)
      family.loops = parser_.loops(*coordinate.loops, {.what = "the range of '" + coordinate.name + "'"});
    if (family.loops.size() > 2)
      fail(coordinate.place, "a coordinate is repeated over one or two loops, no more");
    symbols_.add(std::move(family));
  }
  declare_spaces();
  for (const std::string& name : program_.differentiated) add_as_coordinate(name);
}

void SceneCompiler::declare_spaces() {
  const SceneDocument::Spaces& spaces = document_.spaces;
  if (spaces.kinds.empty()) return;
  if (!program_.differentiated.empty())
    throw Misuse(
        fmt::format("scene '{}' is not in R^n: it is not differentiated by parameters", document_.name));
  for (std::size_t k = 0; k < spaces.components.size(); ++k)
    symbols_.components.emplace(spaces.components[k], static_cast<int>(k));
  symbols_.entries = spaces.entries;
  symbols_.rates = spaces.rates;
  for (const auto& [entry, text] : spaces.entries)
    symbols_.indexed.emplace(entry.substr(0, entry.find('[')),
                             static_cast<int>(1 + std::ranges::count(entry, ',')));
}

void SceneCompiler::add_as_coordinate(const std::string& name) {
  const auto stated = std::ranges::find(document_.parameters, name, &SceneDocument::Parameter::name);
  if (stated == document_.parameters.end() || stated->array || stated->size) {
    std::string known;
    for (const auto& parameter : document_.parameters)
      if (!parameter.array && !parameter.size) known += ' ' + parameter.name;
    throw Misuse(fmt::format("scene '{}' has no parameter '{}' to be differentiated by; there are{}",
                             document_.name, name, known.empty() ? " none" : known));
  }
  Symbols::Parameter& parameter = symbols_.parameters[static_cast<std::size_t>(symbols_.parameter(name))];
  if (parameter.family != none) throw Misuse(fmt::format("the parameter '{}' is named twice", name));
  parameter.family = static_cast<int>(symbols_.families.size());
  symbols_.add(Symbols::Family{name, {}, false});
}

Node SceneCompiler::own_index(const Symbols::Family& family) {
  if (family.loops.empty()) return none;
  const Node first = graph_.loop_index(family.loops[0]);
  return family.loops.size() == 1 ? first : graph_.list(first, graph_.loop_index(family.loops[1]));
}

std::vector<std::string> SceneCompiler::coordinates() const {
  std::vector<std::string> names;
  for (const auto& family : symbols_.families)
    if (symbols_.velocity(family.name) != none) names.push_back(family.name);
  for (const auto& [name, number] : symbols_.components)
    if (symbols_.family(name) == none) names.push_back(name);
  return names;
}

/// Those that kernels read.
std::string SceneCompiler::source_of_tables() const {
  std::set<int> numbers;
  for (const SceneFunction* function : program_.functions())
    for (const Piece& piece : function->pieces)
      for (const Kernel& kernel : piece.kernels) kernel.add_tables(numbers);
  std::string text = numbers.empty() ? "" : LookupTable::source_of_value();
  for (const int number : numbers)
    text += graph_.tables()[static_cast<std::size_t>(number)].source(fmt::format("table{}", number));
  return text;
}

void SceneCompiler::write_source() {
  std::string body = kernel_prelude() + source_of_tables(), table;
  int number = 0;
  for (const SceneFunction* function : program_.functions())
    for (const Piece& piece : function->pieces)
      for (std::size_t k = 0; k < piece.kernels.size(); ++k) {
        const Kernel& kernel = piece.kernels[k];
        if (kernel.empty()) {
          table += "0, ";
          continue;
        }
        const std::string name = fmt::format("k{}", number++);
        body += kernel.source(name, piece.instance_width(), piece.position_width(function->kind, k));
        table += name + ", ";
      }
  program_.name = content_name(body + table);
  // "extern" first: a constant of C++ would otherwise stay inside its file.
  const std::string name = "diracstep_kernels_" + program_.name;
  program_.source = body + fmt::format(
                               "DIRACSTEP_PUBLIC const diracstep_kernel {0}[];\n"
                               "const diracstep_kernel {0}[] = {{{1}0}};\n",
                               name, table);
}

std::vector<const SceneFunction*> SceneProgram::functions() const {
  std::vector<const SceneFunction*> all;
  for (const auto* function : {&lagrangian, &hamiltonian, &force, &cost, &end_cost})
    if (*function) all.push_back(&**function);
  for (const SceneFunction& function : rows) all.push_back(&function);
  return all;
}

std::unique_ptr<SceneProgram> compile_scene(const std::string& file, const std::string& text, bool as_written,
                                            const std::vector<std::string>& differentiated) {
  SizeLimits limits = size_limits();
  limits.graph_nodes += text.size();  // a long file may take its time, a short one of a large system may not
  auto program = std::make_unique<SceneProgram>(read_document(file, text), as_written, limits);
  program->differentiated = differentiated;
  try {
    SceneCompiler(*program).compile();
  } catch (const FormulaGraph::TooLarge&) {
    throw SceneError(
        file, {},
        fmt::format(
            "the formulas and their derivatives have more than {} parts, the limit, or take more than {} "
            "visits of these; write repeated elements with for = \"i = 1..N\" and sum(i = 1..N, …)",
            limits.graph_nodes, limits.graph_visits));
  }
  program->graph.end_counting();
  return program;
}

}  // namespace diracstep::scene_compiler
