#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <diracstep/scene_format/bodies/shapes.hpp>
#include <diracstep/scene_format/compiler/body_reader.hpp>

namespace diracstep::scene_compiler {

using namespace bodies;

namespace {

constexpr double of_length_one = 1e-9;  // how far a quaternion or a matrix of numbers may be from a rotation

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
  const Formula value = formula(*node, fmt::format("'{}' of {}", key, what));
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

void BodyReader::read_shape(const toml::table& table, Body& body, const std::string& what) {
  if (!table.contains("shape")) {
    for (const char* key : {"size", "radius", "length"})
      if (table.contains(key))
        tables_.fail(place_of(table.get(key)->source()),
                     fmt::format("'{}' of {} needs a 'shape'", key, what));
    return;
  }
  const ShapeKeys& keys = choice(table, "shape", what, shapes());
  body.shape = keys.shape;
  body.laid_between = table.contains("from");
  std::size_t k = 0;
  for (const char* key : keys.sizes) {
    if (body.laid_between && std::string_view(key) == "length") {
      body.size[k++] = norm(end_to_end(table, body, what));
      continue;
    }
    if (std::string_view(key) != "size") {
      body.size[k++] = positive(table, key, what);
      continue;
    }
    if (!table.contains(key))
      tables_.fail(place_of(table.source()), fmt::format("{} needs 'size', its edges", what));
    body.size = vector(*table.get(key), fmt::format("'size' of {}", what), false);
    for (const Formula& edge : body.size)
      if (!(edge.value() > 0.0))
        tables_.fail(place_of(table.get(key)->source()),
                     fmt::format("'size' of {}: edges must be above 0", what));
  }
  body.inertia = inertia_of(body.shape, body.mass, body.size);
  if (body.plane && (body.shape == Body::Shape::rod || body.laid_between))
    body.inertia[2][2] = body.inertia[0][0];  // it lies along x
}

Vec BodyReader::end_to_end(const toml::table& table, const Body& body, const std::string& what) {
  for (const char* key : {"from", "to"})
    if (!table.contains(key))
      tables_.fail(place_of(table.source()), fmt::format("{} needs both 'from' and 'to'", what));
  const Vec along = vector(*table.get("to"), fmt::format("'to' of {}", what), body.plane) -
                    vector(*table.get("from"), fmt::format("'from' of {}", what), body.plane);
  if (!(norm(along).value() > 0.0))
    tables_.fail(place_of(table.get("to")->source()), fmt::format("'to' of {} is its 'from'", what));
  return along;
}

/// A rod or cylinder from one point to another.
void BodyReader::lay_between(const toml::table& table, Body& body, const std::string& what) {
  const Vec along = end_to_end(table, body, what);
  if (body.shape != Body::Shape::rod && body.shape != Body::Shape::cylinder)
    tables_.fail(place_of(table.source()),
                 fmt::format("'from' and 'to' of {} are for the shapes \"rod\" and \"cylinder\"", what));
  for (const char* key : {"position", "orientation", "length"})
    if (const toml::node* node = table.get(key))
      tables_.fail(place_of(node->source()),
                   fmt::format("'{}' of {} follows from 'from' and 'to'", key, what));
  body.position = vector(*table.get("from"), what, body.plane) + 0.5 * along;
  body.position_given = true;
  if (body.plane)
    body.angle = {fmt::format("atan2({}, {})", along[1].text(), along[0].text()),
                  std::atan2(along[1].value(), along[0].value()), bodies::Formula::Level::atom};
  else
    body.orientation = from_z_to(unit(along));
}

/// Three principal moments, or six: xx, yy, zz, xy, xz, yz.  Those of a body of positive density are
/// positive, and each is at most the sum of the others.
void BodyReader::read_inertia(const toml::table& table, Body& body, const std::string& what) {
  const toml::node* node = table.get("inertia");
  if (node == nullptr && body.shape != Body::Shape::none) return;
  if (body.plane) {
    body.inertia[2][2] = positive(table, "inertia", what);
    return;
  }
  const toml::array* list = node == nullptr ? nullptr : node->as_array();
  if (list == nullptr || (list->size() != 3 && list->size() != 6))
    tables_.fail(
        node == nullptr ? place_of(table.source()) : place_of(node->source()),
        fmt::format("{} needs 'inertia', a list of three principal moments or of six entries xx, yy, zz, xy, "
                    "xz, yz, or a 'shape': {}",
                    what, words_of(shapes())));
  const auto entry = [&](std::size_t k) { return formula((*list)[k], fmt::format("'inertia' of {}", what)); };
  body.inertia = diagonal(entry(0), entry(1), entry(2));
  if (list->size() == 6) {
    body.inertia[0][1] = body.inertia[1][0] = entry(3);
    body.inertia[0][2] = body.inertia[2][0] = entry(4);
    body.inertia[1][2] = body.inertia[2][1] = entry(5);
  }
  const auto moment = [&](std::size_t k) { return body.inertia[k][k].value(); };
  for (std::size_t k = 0; k < 3; ++k) {
    if (!(moment(k) > 0.0))
      tables_.fail(place_of((*list)[k].source()),
                   fmt::format("'inertia' of {}: {:g}; moments must be above 0", what, moment(k)));
    const double others = moment((k + 1) % 3) + moment((k + 2) % 3);
    if (moment(k) > others * (1.0 + 1e-12))
      tables_.fail(
          place_of((*list)[k].source()),
          fmt::format("'inertia' of {}: {:g} is more than the sum of the others, {:g}, which no body has",
                      what, moment(k), others));
  }
  if (!is_inertia(body.inertia))
    tables_.fail(place_of(node->source()),
                 fmt::format("'inertia' of {}: the principal moments of these six are not above 0, or one is "
                             "more than the sum of the others, which no body has",
                             what));
}

void BodyReader::read_orientation(const toml::node& node, Body& body, const std::string& what) {
  const std::string of = fmt::format("'orientation' of {}", what);
  const toml::array* list = node.as_array();
  if (body.plane) {
    body.angle = formula(node, of);
  } else if (node.is_table()) {
    body.orientation = axis_and_angle(*node.as_table(), of);
  } else if (list != nullptr && list->size() == 4) {
    double squares = 0.0;
    for (std::size_t k = 0; k < 4; ++k) {
      body.orientation[k] = formula((*list)[k], of);
      squares += body.orientation[k].value() * body.orientation[k].value();
    }
    if (!(std::abs(squares - 1.0) <= of_length_one))
      tables_.fail(
          place_of(node.source()),
          fmt::format("{}: a quaternion w, x, y, z of length {:g}; it must be 1", of, std::sqrt(squares)));
    const Formula length = root(square(body.orientation[0]) + square(body.orientation[1]) +
                                square(body.orientation[2]) + square(body.orientation[3]));
    if (squares != 1.0)
      for (Formula& part : body.orientation) part = part / length;
  } else if (list != nullptr && list->size() == 3 && (*list)[0].is_array()) {
    body.orientation = of_matrix(*list, of);
  } else {
    tables_.fail(place_of(node.source()), of + ": expected a quaternion [w, x, y, z], { axis = [x, y, z], "
                                               "angle = … } or three rows of a matrix");
  }
}

Rotation::Quaternion BodyReader::axis_and_angle(const toml::table& table, const std::string& what) {
  tables_.check_keys(table, what, {"axis", "angle"});
  for (const char* key : {"axis", "angle"})
    if (!table.contains(key)) tables_.fail(place_of(table.source()), fmt::format("{} needs '{}'", what, key));
  const Vec axis = direction(*table.get("axis"), "'axis' of " + what, false);
  const Formula half = formula(*table.get("angle"), "'angle' of " + what) / 2.0;
  const Formula sine = Formula::call("sin", half, std::sin(half.value()));
  const Vec part = (half.is_number() ? Formula(std::sin(half.value())) : sine) * axis;
  const Formula cosine =
      half.is_number() ? Formula(std::cos(half.value())) : Formula::call("cos", half, std::cos(half.value()));
  return {cosine, part[0], part[1], part[2]};
}

Rotation::Quaternion BodyReader::of_matrix(const toml::array& rows, const std::string& what) {
  std::array<std::array<double, 3>, 3> r{};
  for (std::size_t i = 0; i < 3; ++i) {
    const Vec row = vector(rows[i], what, false);
    for (std::size_t j = 0; j < 3; ++j) r[i][j] = row[j].value();
  }
  if (const double off = distance_from_rotations(r); !(off <= of_length_one))
    tables_.fail(
        place_of(rows.source()),
        fmt::format("{}: its rows are no rotation, perpendicular unit vectors of determinant 1; they are off "
                    "by {:.2g}",
                    what, off));
  return quaternion_of(r);
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
