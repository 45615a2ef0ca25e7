#include <fmt/format.h>

#include <algorithm>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/system/row_subset.hpp>
#include <diracstep/files/input_file.hpp>
#include <diracstep/scene_format/compiler/size_limits.hpp>
#include <diracstep/scene_format/detail/references_of_file.hpp>
#include <diracstep/scene_format/detail/scene_of_file.hpp>
#include <diracstep/scene_format/detail/start_of_file.hpp>
#include <diracstep/scene_format/drawn_bodies.hpp>
#include <diracstep/scene_format/loader/defined_start.hpp>
#include <diracstep/scene_format/loader/named_values.hpp>
#include <diracstep/scene_format/loader/parameter_values.hpp>
#include <diracstep/scene_format/loader/scene_definition.hpp>
#include <diracstep/scene_format/loader/scene_functions.hpp>
#include <diracstep/scene_format/scene_file.hpp>
#include <mutex>

namespace diracstep {

using namespace scene_compiler;

namespace {

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

/// Throws SceneError where the function of an event is no number at the start, forces of rows taken as 0, or
/// the start lies behind a contact.
void require_start_of_event(const Scene& scene, const Event& event, const SceneDocument& document,
                            Place place) {
  if (!event.at) return;
  Start start = scene.start;
  if (start.v.size() == 0) start.v = Vector::Zero(scene.dimension());
  if (start.p.size() == 0) start.p = Vector::Zero(scene.dimension());
  const double value = event.at({start.time, start.q, start.v, start.p, {}});
  if (std::isnan(value))
    throw SceneError(document.file, place,
                     fmt::format("the function of event '{}' is not a number at the start", event.name));
  if (event.restitution && event.direction == Event::Direction::falling && value < 0.0)
    throw SceneError(document.file, place,
                     fmt::format("event '{}': its function is {:g} at the start, behind the contact; it is "
                                 "positive where there is none (direction)",
                                 event.name, value));
}

void add_events(CatalogueScene& entry, const LoadedScenePtr& loaded) {
  const SceneProgram& program = *loaded->program;
  for (std::size_t i = 0; i < program.events.size(); ++i) {
    const SceneDocument::Event& stated = program.document.events[i];
    entry.events.push_back(event_of(entry, loaded, stated, program.events[i]));
    if (stated.when)
      require_start_of_event(*entry.scene, entry.events.back(), program.document, stated.when->start);
  }
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
  return switched ? all : nullptr;
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
  const std::string normalised = put_on_space(*loaded, stated.start);
  Scene scene = scene_of(loaded, stated.start);
  scene.refuse_redundant_rows = !document.drop_redundant_rows;
  CatalogueScene entry;
  entry.changes = document.notes;
  if (!normalised.empty()) entry.changes.push_back(normalised);
  entry.all_rows = take_off_rows(document, scene);
  require_defined_start(*loaded, scene);
  start_at_operating_point(*loaded, scene, stated);
  entry.scene = std::make_shared<const Scene>(std::move(scene));
  project(*loaded, entry, stated);
  entry.stated_start = std::move(stated);
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
  if (document.drop_redundant_rows) drop_redundant_rows(entry);
  entry.bodies = drawn_bodies(*loaded);
  for (const auto& input : document.inputs)
    if (!input.hold && loaded->program->symbols.inputs_of_time.contains(input.name))
      entry.input_ranges.push_back({input.name, input.times.front(), input.times.back()});
  return entry;
}

}  // namespace

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
