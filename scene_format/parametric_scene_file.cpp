#include <algorithm>
#include <diracstep/core/equilibrium/operating_point.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/scene_format/detail/scene_of_file.hpp>
#include <diracstep/scene_format/detail/start_of_file.hpp>
#include <diracstep/scene_format/loader/named_values.hpp>
#include <diracstep/scene_format/loader/parameter_values.hpp>
#include <diracstep/scene_format/loader/scene_functions.hpp>
#include <diracstep/scene_format/loader/scene_kinks.hpp>
#include <diracstep/scene_format/parametric_scene_file.hpp>
#include <diracstep/sensitivities/moved_start.hpp>
#include <limits>

namespace diracstep {

using namespace scene_compiler;

namespace {

/// ∂q0/∂θ and ∂v0/∂θ by the formulas of the start, and where it is given by momenta through ∂H/∂p.
void differentiate_start(const LoadedScene& loaded, const Start& start, ParametricScene& result) {
  const SceneProgram& program = *loaded.program;
  const int n = result.scene->dimension();
  const auto count = static_cast<Eigen::Index>(program.differentiated.size());
  result.start_q = result.start_v = Columns::Zero(n, count);
  for (Eigen::Index k = 0; k < count; ++k)
    for (const NamedValue& named : program.start_derivatives[static_cast<std::size_t>(k)])
      for_each_value(loaded, named, start.time, [&](int index, double value) {
        (named.role == Role::position ? result.start_q : result.start_v)(index, k) = value;
      });
  if (start.p.size() == 0) return;
  const Hamiltonian& h = *result.extended->hamiltonian;
  Vector xx(h.pattern().nonzeros()), xp = xx, pp = xx, x(n + count), p = Vector::Zero(n + count);
  x << start.q, result.parameters;
  p.head(n) = start.p;
  h.hessian(start.time, x, p, xx, xp, pp);
  Columns dx(n + count, count);
  dx << result.start_q, Columns::Identity(count, count);
  result.start_v = h.pattern().full(xp).leftCols(n).transpose() * dx +
                   h.pattern().full(pp).topLeftCorner(n, n) * result.start_v;
}

/// Where the file, or the rate of a state, moves the start.
void move_start(const LoadedScene& loaded, const CatalogueScene& entry, ParametricScene& result) {
  const Start& stated = entry.stated_start->start;
  Guesses guesses = guesses_of(loaded);
  const bool moves = loaded.program->document.project || !guesses.q.empty();
  if (stated.v.size() == 0 || (!moves && loaded.program->states.empty())) return;
  const auto n = static_cast<std::size_t>(result.scene->dimension());
  if (!moves) guesses = {std::vector<bool>(n, false), std::vector<bool>(n, false)};
  for (const StateProgram& state : loaded.program->states)
    if (!guesses.v.empty())
      guesses.v[static_cast<std::size_t>(loaded.layout.position(state.family, {0, 0}))] = true;
  guesses.q.resize(std::min(n, guesses.q.size()));  // without the parameters
  guesses.v.resize(std::min(n, guesses.v.size()));
  move_start_derivatives(result.extended, result.parameters, stated, entry.scene->start, guesses,
                         result.start_q, result.start_v);
}

/// Where formulas jump or have kinks at places or times that depend on the parameters; the derivative of a
/// motion is that of its formulas, without what a moving jump adds.
std::string doubt_of_switches(const SceneProgram& program) {
  std::string names;
  for (const std::string& name : program.differentiated) {
    const auto& parameter =
        program.symbols.parameters[static_cast<std::size_t>(program.symbols.parameter(name))];
    const auto reads = [&](const Piece& piece) {
      return std::ranges::any_of(piece.slots,
                                 [&](Node leaf) { return program.graph[leaf].a == parameter.family; });
    };
    if (std::ranges::any_of(program.kinks.kinks.pieces, reads) ||
        std::ranges::any_of(program.kinks.events.pieces, reads))
      names += (names.empty() ? "'" : ", '") + name + "'";
  }
  if (names.empty()) return {};
  return "where the formulas switch depends on " + names +
         ": if they jump there, the derivatives lack what the moving jump adds";
}

ParametricScene load_parametric(const std::string& file, const std::string& text, const CatalogueScene& entry,
                                const std::vector<std::string>& parameters, const Parameters& changes,
                                bool as_written, SceneControl* control = nullptr) {
  const auto compiled =
      std::make_shared<const CompiledScene>(compile_scene(file, text, as_written, parameters));
  ParameterValues values = parameter_values(compiled->program->document, changes);
  const LoadedScenePtr loaded = std::make_shared<const LoadedScene>(compiled, std::move(values));
  ParametricScene result{entry.scene, nullptr};
  result.parameters.resize(static_cast<Eigen::Index>(parameters.size()));
  for (std::size_t k = 0; k < parameters.size(); ++k)
    result.parameters[static_cast<Eigen::Index>(k)] =
        loaded->parameters[static_cast<std::size_t>(loaded->program->symbols.parameter(parameters[k]))][0];
  Start start = entry.scene->start;
  const auto extend = [&](Vector& column, const Vector& by) {
    if (column.size() == 0) return;
    const Vector own = column;
    column.resize(own.size() + by.size());
    column << own, by;
  };
  extend(start.q, result.parameters);
  extend(start.v, Vector::Zero(result.parameters.size()));
  extend(start.p, Vector::Zero(result.parameters.size()));
  auto extended = std::make_shared<Scene>(scene_of(loaded, start));
  extended->kinks = nullptr;
  result.extended = std::move(extended);
  result.doubt = doubt_of_switches(*loaded->program);
  differentiate_start(*loaded, entry.scene->start, result);
  if (loaded->program->document.operating_point) {
    std::vector<bool> rests = resting_coordinates(*loaded);
    rests.resize(static_cast<std::size_t>(entry.scene->dimension()));  // without the parameters
    operating_point_derivatives(*result.extended, result.parameters, entry.stated_start->start, rests,
                                result.start_q, result.start_v);
  }
  move_start(*loaded, entry, result);
  if (control != nullptr) {
    control->cost = file_cost(loaded);
    control->end_cost = file_end_cost(loaded);
    control->kinks = file_kinks(loaded);
  }
  return result;
}

void require_in_force_alone(const ParametricScene& scene) {
  const int n = scene.scene->dimension();
  const auto require = [&](const SparsityPattern& pattern, const std::string& where) {
    pattern.for_each([&](Eigen::Index, int i, int j) {
      if (i < n && j >= n)
        throw Misuse("control '" + scene.names()[static_cast<std::size_t>(j - n)] + "' stands in " + where +
                     "; controls stand in forces and in the cost");
    });
  };
  if (scene.extended->lagrangian) require(scene.extended->lagrangian->pattern(), "the Lagrangian");
  for (const auto& rows : scene.extended->constraints) require(rows->pattern(), "a row");
  if (!scene.extended->force) throw Misuse("the controls stand in no force");
}

}  // namespace

ParametricScene parametric_scene_from_text(const std::string& file, const std::string& text,
                                           const CatalogueScene& entry,
                                           const std::vector<std::string>& parameters,
                                           const Parameters& changes) {
  if (!entry.stated_start)
    throw Misuse("scene '" + file + "' is not from a file: it has no parameters to be differentiated by");
  try {
    return load_parametric(file, text, entry, parameters, changes, false);
  } catch (const ConstantOutOfRange&) {
    return load_parametric(file, text, entry, parameters, changes, true);
  }
}

SceneControl scene_control_from_text(const std::string& file, const std::string& text,
                                     const CatalogueScene& entry, const Parameters& changes) {
  const SceneDocument document = read_document(file, text);
  if (!document.control)
    throw Misuse("scene '" + entry.scene->name +
                 "' has no table [control], which names the parameters that are chosen and their cost");
  SceneControl control{document.control->names, nullptr, nullptr, nullptr, {}, {}, {}};
  const auto load = [&](bool as_written) {
    return load_parametric(file, text, entry, control.names, changes, as_written, &control);
  };
  const ParametricScene scene = [&] {
    try {
      return load(false);
    } catch (const ConstantOutOfRange&) {
      return load(true);
    }
  }();
  require_in_force_alone(scene);
  control.force = scene.extended->force;
  control.values = scene.parameters;
  control.lower = Vector::Constant(control.values.size(), -std::numeric_limits<double>::infinity());
  control.upper = -control.lower;
  for (std::size_t k = 0; k < control.names.size(); ++k) {
    const Limits& limits =
        std::ranges::find(document.parameters, control.names[k], &SceneDocument::Parameter::name)->limits;
    const auto i = static_cast<Eigen::Index>(k);
    control.lower[i] = limits.min.value_or(limits.above.value_or(control.lower[i]));
    control.upper[i] = limits.max.value_or(limits.below.value_or(control.upper[i]));
  }
  return control;
}

}  // namespace diracstep
