#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <diracstep/core/equilibrium/operating_point.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/system/consistent_start.hpp>
#include <diracstep/core/system/on_space.hpp>
#include <diracstep/core/system/row_subset.hpp>
#include <diracstep/files/input_file.hpp>
#include <diracstep/scene_format/compiler/circuit_reader.hpp>
#include <diracstep/scene_format/compiler/size_limits.hpp>
#include <diracstep/scene_format/drawn_bodies.hpp>
#include <diracstep/scene_format/loader/defined_start.hpp>
#include <diracstep/scene_format/loader/named_values.hpp>
#include <diracstep/scene_format/loader/parameter_values.hpp>
#include <diracstep/scene_format/loader/scene_definition.hpp>
#include <diracstep/scene_format/loader/scene_functions.hpp>
#include <diracstep/scene_format/loader/scene_kinks.hpp>
#include <diracstep/scene_format/parametric_scene_file.hpp>
#include <diracstep/scene_format/scene_file.hpp>
#include <diracstep/scene_format/spaces/named_space.hpp>
#include <diracstep/sensitivities/moved_start.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>
#include <limits>
#include <mutex>

namespace diracstep {

using namespace scene_compiler;

namespace {

constexpr double unknown = std::numeric_limits<double>::quiet_NaN();
constexpr double same_time = 1e-12;  // relative difference of times that are the same

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
                         fmt::format("the start of '{}' is {}; expected a finite number",
                                     names[static_cast<std::size_t>(index)], value));
      (position ? start.q : second)[index] = value;
      (position ? stated.q : stated.v)[static_cast<std::size_t>(index)] = StartOrigin::given;
    });
  const bool by_momentum = program.start_by_momentum || !program.lagrangian;
  (by_momentum ? start.p : start.v) = second;
  stated.start = std::move(start);
  return stated;
}

/// Onto groups and spheres, from the digits that a file states.  Throws SceneError where it is far from them.
void put_on_space(const LoadedScene& loaded, Start& start) {
  constexpr double most = 1e-3;
  const SceneDocument& document = loaded.program->document;
  if (document.spaces.kinds.empty()) return;
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
  start.q = on;
}

/// Velocities of states are their rates.
void set_rates_of_states(const LoadedScenePtr& loaded, StatedStart& stated) {
  for (const StateProgram& state : loaded->program->states) {
    const int index = loaded->layout.position(state.family, {0, 0});
    const Start& start = stated.start;
    const double rate = file_value(loaded, state.rate)(start.time, start.q, start.v);
    stated.start.v[index] = rate;
    stated.v[static_cast<std::size_t>(index)] = StartOrigin::rate;
  }
}

/// References for which the scene has the right parameters.
class References {
 public:
  explicit References(LoadedScenePtr loaded) : loaded_(std::move(loaded)) {
    const auto lagrangian = file_lagrangian(loaded_);
    momentum_of_position_ = lagrangian && lagrangian->structure().y_hessian_zero;
    const SceneDocument& document = loaded_->program->document;
    for (std::size_t i = 0; i < document.references.size(); ++i)
      if (holds(document.references[i])) valid_.push_back(i);
  }

  std::vector<KnownState> at_stated_times() const {
    std::vector<KnownState> states;
    for (const std::size_t i : valid_)
      if (const auto& t = stated(i).t) states.push_back(state(i, *t));
    return states;
  }

  /// The first closed form, else nothing.
  std::optional<KnownState> closed_form(double t) const {
    for (const std::size_t i : valid_)
      if (!stated(i).t) return state(i, t);
    return std::nullopt;
  }

  Reference summary() const {
    const auto complete = std::ranges::find_if(
        valid_, [&](std::size_t i) { return point(i, stated(i).t.value_or(start())).has_value(); });
    if (complete == valid_.end()) return {};
    const SceneDocument::Reference& first = stated(*complete);
    return {first.kind, first.how, std::pow(10.0, -first.digits),
            [references = *this](double t) { return references.at(t); }};
  }

 private:
  const SceneDocument::Reference& stated(std::size_t i) const {
    return loaded_->program->document.references[i];
  }
  double start() const { return loaded_->program->document.t_end; }

  /// A closed form holds for all parameters unless it names some; digits hold for those of the file.
  bool holds(const SceneDocument::Reference& reference) const {
    const auto& parameters = loaded_->program->document.parameters;
    for (const auto& [name, value] : reference.with)
      if (find_parameter(loaded_->program->document, name) == nullptr)
        throw SceneError(loaded_->program->document.file, reference.place,
                         fmt::format("'with' names '{}', which is no parameter", name));
    for (std::size_t i = 0; i < parameters.size(); ++i) {
      const auto given = reference.with.find(parameters[i].name);
      if (given != reference.with.end() ? loaded_->parameters[i] != std::vector{given->second}
                                        : reference.t && loaded_->parameters[i] != parameters[i].values)
        return false;
    }
    return true;
  }

  KnownState state(std::size_t i, double t) const {
    const SceneDocument::Reference& reference = stated(i);
    KnownState state{t, reference.kind, reference.how, reference.digits, {}};
    for (const NamedValue& named : loaded_->program->references[i].values) {
      if (named.momentum) continue;  // not compared
      const bool velocity = named.role == Role::second;
      for_each_value(*loaded_, named, t, [&](int index, double value) {
        const std::string& name =
            (velocity ? loaded_->components() : loaded_->layout.names())[static_cast<std::size_t>(index)];
        state.components.push_back({velocity ? "v_" + name : name, index, velocity, value});
      });
    }
    return state;
  }

  /// The whole state, where the reference gives all of it.  Where L is linear in v the position is the state:
  /// p = ∂L/∂v(q), and v = 0 stands for a velocity that is not stated.
  std::optional<ReferencePoint> point(std::size_t i, double t) const {
    const auto n = loaded_->layout.dimension();
    ReferencePoint point{Vector::Constant(n, unknown),
                         Vector::Constant(static_cast<Eigen::Index>(loaded_->components().size()),
                                          momentum_of_position_ ? 0.0 : unknown)};
    for (const auto& component : state(i, t).components)
      (component.velocity ? point.v : point.q)[component.index] = component.value;
    if (!point.q.allFinite() || !point.v.allFinite()) return std::nullopt;
    return point;
  }

  std::optional<ReferencePoint> at(double t) const {
    for (const std::size_t i : valid_) {
      const auto& time = stated(i).t;
      if (time && std::abs(*time - t) > same_time * std::max(1.0, std::abs(t))) continue;
      if (auto found = point(i, t)) return found;
    }
    return std::nullopt;
  }

  LoadedScenePtr loaded_;
  bool momentum_of_position_ = false;  ///< a Lagrangian linear in v
  std::vector<std::size_t> valid_;
};

/// By coordinate; empty where the file states none.
Vector tolerances_of(const LoadedScene& loaded) {
  const auto& coordinates = loaded.program->document.coordinates;
  const auto stated = [](const auto& coordinate) { return coordinate.tolerance != 0.0; };
  if (std::ranges::none_of(coordinates, stated)) return {};
  Vector tolerances = Vector::Zero(loaded.layout.dimension());
  for (std::size_t f = 0; f < coordinates.size(); ++f) {
    const int family = static_cast<int>(f);
    for (long i = 0; i < loaded.layout.count(family); ++i)
      tolerances[loaded.layout.position(family, loaded.layout.element(family, i))] = coordinates[f].tolerance;
  }
  return tolerances;
}

/// The functions of stored numbers as those on the space.  Kinks are looked for along the straight lines of
/// R^n: of these nothing is known there.
void put_functions_on_space(const LoadedScene& loaded, Scene& scene) {
  scene.space = named_space(loaded.program->document.spaces.kinds);
  scene.coordinates = loaded.components();
  scene.lagrangian = on_space(scene.space, scene.lagrangian);
  for (auto& rows : scene.constraints) rows = on_space(scene.space, rows);
  if (scene.force) scene.force = on_space(scene.space, scene.force);
  scene.kinks = nullptr;
}

Scene scene_of(const LoadedScenePtr& loaded, const Start& start) {
  Scene scene;
  scene.name = loaded->program->document.name;
  scene.coordinates = loaded->layout.names();
  scene.lagrangian = file_lagrangian(loaded);
  scene.hamiltonian = file_hamiltonian(loaded);
  scene.constraints = file_constraints(loaded);
  scene.force = file_force(loaded);
  scene.start = start;
  scene.kinks = file_kinks(loaded);
  scene.tolerances = tolerances_of(*loaded);
  if (!loaded->program->document.spaces.kinds.empty()) put_functions_on_space(*loaded, scene);
  return scene;
}

void require_defined_start(const LoadedScene& loaded, const Scene& scene) {
  Vector p = scene.start.p;
  if (p.size() == 0 && scene.lagrangian && scene.hamiltonian) {
    Vector lq(scene.dimension());
    p.resize(scene.dimension());
    scene.lagrangian->gradient(scene.start.time, scene.start.q, scene.start.v, lq, p);
  }
  const Vector v = scene.start.v.size() > 0 ? scene.start.v : Vector(Vector::Zero(scene.dimension()));
  require_defined(loaded, scene, scene.start.time, scene.start.q, v, p);
}

/// The components that the file calls guesses; none named: all are.
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

/// Which coordinates rest at an operating point: all but the charges through elements other than capacitors,
/// and fluxes.
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

/// Where the file asks for it, of the rows that act there.
void start_at_operating_point(const LoadedScene& loaded, Scene& scene, StatedStart& stated) {
  if (!loaded.program->document.operating_point) return;
  scene.start = operating_point(scene, scene.start, resting_coordinates(loaded));
  stated.start = scene.start;
}

/// Moves the start onto the rows where the file asks for it, and notes by how much.
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

Recommendation recommendation(const SceneDocument& document) {
  const SceneDocument::Recommended& stated = document.recommended;
  return {stated.method,
          stated.order,
          stated.step > 0.0 ? stated.step : document.step,
          stated.end != 0.0 ? stated.end : document.study_end,
          stated.tolerance,
          stated.stated};
}

void describe(CatalogueScene& entry, const LoadedScene& loaded) {
  const SceneDocument& document = loaded.program->document;
  for (const auto& coordinate : document.coordinates)
    entry.notes.push_back({coordinate.name, coordinate.unit, coordinate.meaning});
  for (std::size_t i = 0; i < document.parameters.size(); ++i) {
    const auto& parameter = document.parameters[i];
    entry.notes.push_back({parameter.name, parameter.unit, parameter.meaning});
    if (!parameter.array) entry.parameters[parameter.name] = loaded.parameters[i][0];
  }
}

/// Throws SceneError where an output has the name of an element of a repeated coordinate.
void add_outputs(CatalogueScene& entry, const LoadedScenePtr& loaded) {
  const SceneProgram& program = *loaded->program;
  const std::vector<std::string>& names = loaded->layout.names();
  for (std::size_t i = 0; i < program.outputs.size(); ++i) {
    const auto& [name, function] = program.outputs[i];
    if (std::ranges::find(names, name) != names.end())
      throw SceneError(program.document.file, program.document.outputs[i].place,
                       fmt::format("the output '{}' has the name of a coordinate", name));
    entry.outputs.push_back({name, file_point_value(loaded, function, entry.shown().row_names())});
  }
}

Event event_of(const CatalogueScene& entry, const LoadedScenePtr& loaded, const SceneDocument::Event& stated,
               const EventProgram& program) {
  using Stated = SceneDocument::Event::Direction;
  const std::vector<std::string> rows = entry.shown().row_names();
  const auto function = [&](const std::optional<SceneFunction>& of) {
    return of ? file_point_value(loaded, *of, rows) : PointFunction{};
  };
  Event event;
  event.name = stated.name;
  event.at = function(program.when);
  event.direction = stated.direction == Stated::both     ? Event::Direction::both
                    : stated.direction == Stated::rising ? Event::Direction::rising
                                                         : Event::Direction::falling;
  event.stop = stated.stop;
  event.every = stated.every;
  event.condition = function(program.condition);
  event.on = stated.on;
  event.off = stated.off;
  event.restitution = function(program.restitution);
  if (program.contact) event.contact = file_rows(loaded, *program.contact);
  for (std::size_t k = 0; k < program.set.size(); ++k)
    for_each_value(*loaded, program.set[k], 0.0, [&](int index, double) {
      event.set.push_back(
          {index, program.set[k].role == Role::second, file_point_value(loaded, program.values[k], rows)});
    });
  return event;
}

void add_events(CatalogueScene& entry, const LoadedScenePtr& loaded) {
  const SceneProgram& program = *loaded->program;
  for (std::size_t i = 0; i < program.events.size(); ++i)
    entry.events.push_back(event_of(entry, loaded, program.document.events[i], program.events[i]));
}

/// Leaves out the rows that are off at the start; the scene with all of them where events switch some.
std::shared_ptr<const Scene> take_off_rows(const SceneDocument& document, Scene& scene) {
  const bool switched = std::ranges::any_of(
      document.events, [](const auto& event) { return !event.on.empty() || !event.off.empty(); });
  std::vector<std::string> off;
  for (const auto& row : document.rows)
    if (!row.on) off.push_back(row.name);
  if (!switched && off.empty()) return nullptr;
  auto all = std::make_shared<const Scene>(scene);
  scene = *without_rows(scene, off);
  return all;
}

/// Throws SceneError where an input ends before the span does.
void require_inputs_over_span(const SceneProgram& program, double start) {
  const SceneDocument& document = program.document;
  for (const auto& input : document.inputs)
    for (const double t : {start, document.t_end})
      if (!input.hold && program.symbols.inputs_of_time.contains(input.name) &&
          !(t >= input.times.front() && t <= input.times.back()))
        throw SceneError(
            document.file, input.place,
            fmt::format("the input '{}' is given from t = {:g} to {:g}, and the scene is at t = {:g}; "
                        "add points, or hold = true to keep its end values",
                        input.name, input.times.front(), input.times.back(), t));
}

CatalogueScene load(const std::shared_ptr<const CompiledScene>& compiled, const Parameters& changes) {
  ParameterValues values = parameter_values(compiled->program->document, changes);
  const LoadedScenePtr loaded = std::make_shared<const LoadedScene>(compiled, std::move(values));
  const SceneDocument& document = loaded->program->document;
  StatedStart stated = start_of(*loaded);
  require_inputs_over_span(*loaded->program, stated.start.time);
  set_rates_of_states(loaded, stated);
  put_on_space(*loaded, stated.start);
  Scene scene = scene_of(loaded, stated.start);
  CatalogueScene entry;
  entry.changes = document.notes;
  entry.all_rows = take_off_rows(document, scene);
  require_defined_start(*loaded, scene);
  start_at_operating_point(*loaded, scene, stated);
  entry.scene = std::make_shared<const Scene>(std::move(scene));
  project(*loaded, entry, stated);
  entry.stated_start = std::move(stated);
  if (document.drop_redundant_rows) drop_redundant_rows(entry);
  entry.kind = document.kind;
  entry.description = document.description;
  entry.source = document.source;
  entry.t_end = document.study_end;
  entry.natural_step = document.step;
  entry.needs = document.needs;
  entry.code = loaded->library.origin;
  entry.definition = scene_definition(document);
  entry.recommended = recommendation(document);
  describe(entry, *loaded);
  const References references(loaded);
  entry.reference = references.summary();
  entry.known = references.at_stated_times();
  if (const auto exact = references.closed_form(entry.recommended.end)) entry.known.push_back(*exact);
  for (std::size_t i = 0; i < loaded->program->invariants.size(); ++i)
    entry.invariants.push_back({loaded->program->invariants[i].name,
                                file_value(loaded, loaded->program->invariants[i].function),
                                loaded->program->invariants[i].value});
  add_outputs(entry, loaded);
  add_events(entry, loaded);
  entry.bodies = drawn_bodies(*loaded);
  for (const auto& input : document.inputs)
    if (!input.hold && loaded->program->symbols.inputs_of_time.contains(input.name))
      entry.input_ranges.push_back({input.name, input.times.front(), input.times.back()});
  return entry;
}

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

struct SceneFile::Compiled {
  std::string file, text;
  std::shared_ptr<const CompiledScene> usual, as_written;
  std::mutex writing;  ///< the latter, made where some values need it
};

SceneFile::SceneFile(std::string file, std::string text) : compiled_(std::make_shared<Compiled>()) {
  compiled_->file = std::move(file);
  compiled_->text = std::move(text);
  compiled_->usual = std::make_shared<const CompiledScene>(compile_scene(compiled_->file, compiled_->text));
}

CatalogueScene SceneFile::load(const Parameters& changes) const {
  try {
    return diracstep::load(compiled_->usual, changes);
  } catch (const ConstantOutOfRange&) {
    const std::scoped_lock lock(compiled_->writing);
    if (!compiled_->as_written)
      compiled_->as_written =
          std::make_shared<const CompiledScene>(compile_scene(compiled_->file, compiled_->text, true));
    return diracstep::load(compiled_->as_written, changes);
  }
}

CatalogueScene scene_from_text(const std::string& file, const std::string& text, const Parameters& changes) {
  return SceneFile(file, text).load(changes);
}

CatalogueScene scene_from_file(const std::string& path, const Parameters& changes) {
  return scene_from_text(path, read_file(path, "the scene file", size_limits().file_bytes), changes);
}

}  // namespace diracstep
