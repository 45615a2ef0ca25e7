#include <algorithm>
#include <diracstep/c_interface/handles.hpp>
#include <diracstep/scene_format/position_names.hpp>

using namespace diracstep;
using namespace diracstep::c_interface;

namespace {

using Cells = std::vector<std::string>;

SymbolNote note_of(const CatalogueScene& entry, const std::string& name) {
  // "x_3" and "link_2" are of "x" and "link"
  for (std::string known = name; !known.empty();
       known.resize(known.find_last_of('_') == std::string::npos ? 0 : known.find_last_of('_'))) {
    const auto found = std::ranges::find(entry.notes, known, &SymbolNote::name);
    if (found != entry.notes.end()) return *found;
  }
  return {name, "", ""};
}

Cells about(const CatalogueScene& entry) {
  Cells cells{"name",   entry.scene->name, "kind",     entry.kind, "description", entry.description,
              "source", entry.source,      "formulas", entry.code};
  const auto add = [&cells](const std::string& what, const std::string& text) {
    if (!text.empty()) cells.insert(cells.end(), {what, text});
  };
  add("needs", entry.needs);
  for (const std::string& change : entry.changes) add("changed", change);
  if (entry.recommended.stated) {
    add("recommended method", entry.recommended.method);
    if (entry.recommended.order > 0) add("recommended order", std::to_string(entry.recommended.order));
    add("recommended step", to_text(entry.recommended.step, 17));
  }
  for (const auto& [what, text] : entry.definition) add(what, text);
  return cells;
}

Cells coordinates(const CatalogueScene& entry) {
  Cells cells;
  for (const std::string& name : entry.scene->coordinates) {
    const SymbolNote note = note_of(entry, name);
    cells.insert(cells.end(), {name, note.unit, note.meaning});
  }
  return cells;
}

Cells parameters(const CatalogueScene& entry) {
  Cells cells;
  for (const auto& [name, value] : entry.parameters) {
    const SymbolNote note = note_of(entry, name);
    cells.insert(cells.end(), {name, to_text(value, 17), note.unit, note.meaning});
  }
  return cells;
}

Cells invariants(const CatalogueScene& entry) {
  Cells cells;
  for (const Invariant& invariant : entry.invariants)
    cells.insert(cells.end(), {invariant.name, invariant.value ? to_text(*invariant.value, 17) : ""});
  return cells;
}

Cells methods(const Registry& registry) {
  Cells cells;
  for (const std::string& name : registry.names()) {
    const MethodInfo info = registry.method(name).info;
    cells.insert(cells.end(),
                 {name, std::to_string(info.order), info.self_adjoint ? "self-adjoint" : "", info.summary});
  }
  return cells;
}

Cells rules(const Registry& registry) {
  Cells cells;
  for (const StepRule& rule : registry.rules()) cells.emplace_back(rule.name());
  return cells;
}

Cells scenes(const diracstep_model& model) {
  Cells cells = scene_names();
  for (const Plugin& plugin : model.plugins)
    cells.insert(cells.end(), plugin.scenes().begin(), plugin.scenes().end());
  return cells;
}

Cells plugins(const diracstep_model& model) {
  Cells cells;
  for (const Plugin& plugin : model.plugins)
    cells.insert(cells.end(), {plugin.name(), plugin.path(), plugin.description()});
  return cells;
}

Cells outputs(const CatalogueScene& entry) {
  Cells cells;
  for (const Output& output : entry.outputs) cells.push_back(output.name);
  return cells;
}

Cells inputs(const CatalogueScene& entry) {
  Cells cells;
  for (const InputRange& input : entry.input_ranges)
    cells.insert(cells.end(), {input.name, to_text(input.first, 17), to_text(input.last, 17)});
  return cells;
}

Cells events(const CatalogueScene& entry) {
  Cells cells;
  for (const Event& event : entry.events)
    cells.insert(cells.end(), {event.name, event.acts() ? "act" : event.stop ? "stop" : "record"});
  return cells;
}

diracstep_table list(const diracstep_model& model, int what) {
  switch (what) {
    case DIRACSTEP_METHODS:
      return keep(4, methods(model.registry));
    case DIRACSTEP_RULES:
      return keep(1, rules(model.registry));
    case DIRACSTEP_SCENES:
      return keep(1, scenes(model));
    case DIRACSTEP_PLUGINS:
      return keep(3, plugins(model));
    case DIRACSTEP_ABOUT:
      return keep(2, about(entry_of(model)));
    case DIRACSTEP_COORDINATES:
      return keep(3, coordinates(entry_of(model)));
    case DIRACSTEP_ROWS:
      return keep(1, entry_of(model).shown().row_names());
    case DIRACSTEP_INVARIANTS:
      return keep(2, invariants(entry_of(model)));
    case DIRACSTEP_OUTPUTS:
      return keep(1, outputs(entry_of(model)));
    case DIRACSTEP_INPUTS:
      return keep(3, inputs(entry_of(model)));
    case DIRACSTEP_EVENTS:
      return keep(2, events(entry_of(model)));
    case DIRACSTEP_POSITIONS:
      return keep(1, position_names(*entry_of(model).scene));
    case DIRACSTEP_PARAMETERS:
      return keep(4, parameters(entry_of(model)));
    default:
      throw Misuse("there is no list " + std::to_string(what));
  }
}

}  // namespace

int diracstep_list(const diracstep_model* model, int what, diracstep_table* table) {
  return guarded([&] { given(table, "where the table goes") = list(given(model, "the model"), what); });
}
