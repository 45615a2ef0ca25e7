#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <diracstep/scene_format/bodies/shapes.hpp>
#include <diracstep/scene_format/compiler/body_reader.hpp>

namespace diracstep::scene_compiler {

using namespace bodies;

namespace {

/// A text that stands in formulas: numbers and names as they are.
bodies::Formula as_formula(const FormulaText& text, double value) {
  return {text.text, value, is_name(text.text) ? bodies::Formula::Level::atom : bodies::Formula::Level::sum};
}

}  // namespace

BodyReader::BodyReader(const TableReader& tables, const std::string& file, const SceneDocument& document)
    : tables_(tables), file_(file), document_(document), parser_(file_, graph_, symbols_) {}

BodyParts BodyReader::read(const toml::table& root) {
  const auto stated =
      std::ranges::find_if(body_tables(), [&](const std::string& key) { return root.contains(key); });
  if (stated == body_tables().end()) return {};
  if (!root.contains("body"))
    tables_.fail(place_of(root.get(*stated)->source()),
                 fmt::format("'{}' belongs to bodies, and there is no [[body]]", *stated));
  know_values(root);
  read_gravity(root);
  for (const toml::table* table : tables_.tables(root, "body")) read_body(*table);
  for (const toml::table* table : tables_.tables(root, "wheel")) read_wheel(*table);
  for (const toml::table* table : tables_.tables(root, "joint")) read_joint(*table);
  for (const toml::table* table : tables_.tables(root, "rolling")) read_contact(*table);
  for (const toml::table* table : tables_.tables(root, "spring")) read_spring(*table);
  require_momenta(root);
  parts_.expansion = expand(mechanism_);
  for (const Body& body : mechanism_.bodies) draw(body);
  join_formulas(root);
  return std::move(parts_);
}

/// "own + name", with what is added under a name of its own, so that the file's formula keeps its place.
std::optional<FormulaText> BodyReader::joined(std::optional<FormulaText> own, const std::string& added,
                                              const std::string& name, int source) {
  if (added.empty()) return own;
  if (!own) return FormulaText{added, parts_.place(source)};
  parts_.expansion.definitions.push_back({name, added, source});
  own->text += " + " + name;
  return own;
}

void BodyReader::join_formulas(const toml::table& root) {
  Expansion& made = parts_.expansion;
  if (const toml::node* node = root.get("hamiltonian"))
    tables_.fail(place_of(node->source()),
                 "bodies make a Lagrangian; beside them there can be no 'hamiltonian'");
  const int first = mechanism_.bodies.front().source;
  parts_.lagrangian =
      joined(tables_.optional_formula(root, "lagrangian"), made.lagrangian, "bodies_lagrangian", first);
  parts_.dissipation =
      joined(tables_.optional_formula(root, "dissipation"), made.dissipation, "bodies_dissipation", first);
  for (const Item& item : tables_.items(root, "force")) {
    const auto own = std::ranges::find(made.force, item.key, &Expansion::Named::name);
    if (own == made.force.end()) continue;
    parts_.force[item.key] =
        *joined(tables_.formula(*item.node, item.key), own->text, "bodies_force_" + item.key, own->source);
    made.force.erase(own);
  }
  for (const Item& item : tables_.items(root, "start"))
    std::erase_if(made.start, [&](const Expansion::Named& named) { return named.name == item.key; });
}

void BodyReader::know_values(const toml::table& root) {
  for (const Item& item : tables_.items(root, "definitions"))
    symbols_.definitions.emplace(item.key, tables_.formula(*item.node, item.key));
  for (const auto& parameter : document_.parameters)
    if (!parameter.array)
      symbols_.definitions[parameter.name] = {fmt::format("{:.17g}", parameter.values[0])};
}

double BodyReader::value_of(const FormulaText& text, const std::string& what) {
  NodeData data;
  try {
    data = graph_[parser_.formula(text, {.what = what})];
  } catch (const FormulaGraph::TooLarge&) {
    tables_.fail(text.start, fmt::format("{}: the formulas of bodies have too many parts", what));
  }
  if (data.op != Op::number || !std::isfinite(data.value))
    tables_.fail(text.start,
                 fmt::format("{}: expected a finite number or a formula in the parameters", what));
  return data.value;
}

bodies::Formula BodyReader::formula(const toml::node& node, const std::string& what) {
  if (node.is_integer() || node.is_floating_point()) return tables_.number(node, what);
  const FormulaText text = tables_.formula(node, what);
  return as_formula(text, value_of(text, what));
}

bodies::Formula BodyReader::formula(const toml::table& table, const char* key, const Formula& absent,
                                    const std::string& what) {
  const toml::node* node = table.get(key);
  return node == nullptr ? absent : formula(*node, fmt::format("'{}' of {}", key, what));
}

bodies::Formula BodyReader::positive(const toml::table& table, const char* key, const std::string& what,
                                     bool zero) {
  const toml::node* node = table.get(key);
  if (node == nullptr) tables_.fail(place_of(table.source()), fmt::format("{} needs '{}'", what, key));
  Formula value = formula(*node, fmt::format("'{}' of {}", key, what));
  if (!(zero ? value.value() >= 0.0 : value.value() > 0.0))
    tables_.fail(place_of(node->source()), fmt::format("'{}' of {} is {:g}; it must be {}", key, what,
                                                       value.value(), zero ? "at least 0" : "above 0"));
  return value;
}

Vec BodyReader::vector(const toml::node& node, const std::string& what, bool plane) {
  const toml::array* list = node.as_array();
  const std::size_t size = list == nullptr ? 0 : list->size();
  if (size != (plane ? 2U : 3U))
    tables_.fail(place_of(node.source()),
                 fmt::format("{}: expected a list of {} numbers or formulas, {}", what,
                             plane ? "two" : "three", plane ? "[x, y]" : "[x, y, z]"));
  Vec result = zero_vector();
  for (std::size_t k = 0; k < size; ++k) result[k] = formula((*list)[k], what);
  return result;
}

Vec BodyReader::direction(const toml::node& node, const std::string& what, bool plane) {
  const Vec result = vector(node, what, plane);
  const Formula length = norm(result);
  if (!(length.value() > 0.0))
    tables_.fail(place_of(node.source()), what + " is a vector of length 0, which points nowhere");
  return length.value() == 1.0 ? result : unit(result);
}

std::string BodyReader::name(const toml::table& table, const std::string& what) {
  std::string name = tables_.required_string(table, "name", what);
  const Place place = place_of(table.get("name")->source());
  if (!is_name(name))
    tables_.fail(place, fmt::format("'{}' is no name for {}: expected a letter, then letters, digits and _",
                                    name, what));
  if (name == "ground" || !names_.insert(name).second)
    tables_.fail(place, fmt::format("the name '{}' is {}", name,
                                    name == "ground" ? "that of what stands still" : "used twice"));
  return name;
}

int BodyReader::source(const toml::table& table) {
  parts_.places.push_back(place_of(table.source()));
  return static_cast<int>(parts_.places.size()) - 1;
}

// ------------------------------------------------------------------ bodies

/// A number is the acceleration downwards: along −z, where all bodies are in the plane along −y.
void BodyReader::read_gravity(const toml::table& root) {
  const toml::node* node = root.get("gravity");
  if (node == nullptr) return;
  bool plane = true;
  for (const toml::table* body : tables_.tables(root, "body")) plane = plane && tables_.flag(*body, "plane");
  if (node->is_array()) {
    mechanism_.gravity = vector(*node, "'gravity'", plane);
  } else {
    const Formula down = formula(*node, "'gravity'");
    mechanism_.gravity[plane ? 1 : 2] = -down;
  }
}

void BodyReader::read_body(const toml::table& table) {
  Body body;
  body.source = source(table);
  body.name = name(table, "[[body]]");
  const std::string what = fmt::format("body '{}'", body.name);
  tables_.check_keys(table, what,
                     {"name", "plane", "fixed", "mass", "inertia", "shape", "size", "radius", "length",
                      "position", "orientation", "velocity", "rate", "guess", "from", "to"});
  body.plane = tables_.flag(table, "plane");
  body.fixed = tables_.flag(table, "fixed");
  body.guess = tables_.flag(table, "guess");
  if (!body.fixed || table.contains("mass")) body.mass = positive(table, "mass", what);
  read_shape(table, body, what);
  if (!body.fixed) read_inertia(table, body, what);
  if (const toml::node* node = table.get("position")) {
    body.position = vector(*node, fmt::format("'position' of {}", what), body.plane);
    body.position_given = true;
  }
  if (table.contains("from") || table.contains("to")) lay_between(table, body, what);
  if (const toml::node* node = table.get("orientation")) read_orientation(*node, body, what);
  for (const char* key : {"velocity", "rate"})
    if (table.contains(key) && body.fixed)
      tables_.fail(place_of(table.get(key)->source()), fmt::format("{} is fixed and has no '{}'", what, key));
  body.velocity_given = table.contains("velocity");
  body.rate_given = table.contains("rate");
  if (body.velocity_given)
    body.velocity = vector(*table.get("velocity"), fmt::format("'velocity' of {}", what), body.plane);
  if (body.rate_given && body.plane)
    body.rate[2] = formula(*table.get("rate"), fmt::format("'rate' of {}", what));
  else if (body.rate_given)
    body.rate = vector(*table.get("rate"), fmt::format("'rate' of {}", what), false);
  add(std::move(body));
}

void BodyReader::add(Body body) {
  numbers_.emplace(body.name, static_cast<int>(mechanism_.bodies.size()));
  mechanism_.bodies.push_back(std::move(body));
}

void BodyReader::draw(const Body& body) {
  SceneDocument::DrawnBody drawn{body.name, shape_name(body.shape), {}, {}, {}, parts_.place(body.source)};
  const auto text = [&](const Formula& formula) { return FormulaText{formula.text(), drawn.place}; };
  Vec size = body.size;
  if (body.shape == Body::Shape::none && !body.plane && body.mass.value() > 0.0 && !body.fixed)
    size = ellipsoid_of(body);
  if (body.plane && body.shape == Body::Shape::cylinder && body.laid_between) {
    drawn.shape = shape_name(Body::Shape::box);  // as the plane sees it; a cylinder is drawn along z
    size = {body.size[1], 2.0 * body.size[0], 2.0 * body.size[0]};
  }
  for (const Formula& one : size) drawn.size.push_back(text(one));
  if (body.plane) {
    for (const char* last : {"_x", "_y", "_th"}) drawn.coordinates.push_back(body.name + last);
  } else {
    for (const char* last : {"_x", "_y", "_z"}) drawn.coordinates.push_back(body.name + last);
    for (int i = 0; i < Rotation::coordinates; ++i)
      drawn.coordinates.push_back(Rotation(body.name).coordinate(i));
  }
  if (body.fixed) {
    drawn.coordinates.clear();
    for (const Formula& one : body.position) drawn.fixed.push_back(text(one));
    for (const Formula& one : body.orientation) drawn.fixed.push_back(text(one));
  }
  parts_.drawn.push_back(std::move(drawn));
}

}  // namespace diracstep::scene_compiler
