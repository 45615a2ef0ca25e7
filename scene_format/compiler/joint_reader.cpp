#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <diracstep/scene_format/bodies/shapes.hpp>
#include <diracstep/scene_format/compiler/body_reader.hpp>

/// The tables of BodyReader that hold bodies together, and those of contacts.
namespace diracstep::scene_compiler {

using namespace bodies;

namespace {

const std::map<std::string, Joint::Kind>& joint_kinds() {
  static const std::map<std::string, Joint::Kind> kinds{
      {"spherical", Joint::Kind::spherical}, {"revolute", Joint::Kind::revolute},
      {"prismatic", Joint::Kind::prismatic}, {"universal", Joint::Kind::universal},
      {"fixed", Joint::Kind::fixed},         {"distance", Joint::Kind::distance}};
  return kinds;
}

const std::map<std::string, Contact::Kind>& contact_kinds() {
  static const std::map<std::string, Contact::Kind> kinds{{"ball", Contact::Kind::ball},
                                                          {"disc", Contact::Kind::disc},
                                                          {"knife edge", Contact::Kind::knife_edge}};
  return kinds;
}

}  // namespace

bool BodyReader::is_plane(int body) const {
  return body != ground && mechanism_.bodies[static_cast<std::size_t>(body)].plane;
}

std::array<Vec, 2> BodyReader::two(const toml::table& table, const char* key, const std::string& what,
                                   bool plane, bool directions) {
  const toml::node& node = *table.get(key);
  const toml::array* list = node.as_array();
  const std::string of = fmt::format("'{}' of {}", key, what);
  if (list == nullptr || list->size() != 2 || !(*list)[0].is_array())
    tables_.fail(place_of(node.source()), of + ": expected two lists, one in the axes of each body");
  const auto one = [&](std::size_t k) {
    return directions ? direction((*list)[k], of, plane) : vector((*list)[k], of, plane);
  };
  return {one(0), one(1)};
}

/// Unless the file's own Lagrangian or rows may give or hold what is missing.
void BodyReader::require_momenta(const toml::table& root) const {
  if (root.contains("lagrangian") || root.contains("rows")) return;
  if (const Body* rod = rod_that_turns_freely(mechanism_))
    tables_.fail(
        parts_.place(rod->source),
        fmt::format("body '{}' is a thin rod, which has no moment of inertia about itself, and no joint "
                    "holds its turn about itself: give it an 'inertia' or the shape \"cylinder\", or join "
                    "it otherwise",
                    rod->name));
}

int BodyReader::body_number(const toml::node& node, const std::string& what, bool or_ground) const {
  const Place place = place_of(node.source());
  if (!node.is_string()) tables_.fail(place, what + ": expected the name of a body in quotes");
  const std::string name = node.as_string()->get();
  if (or_ground && name == "ground") return ground;
  if (const auto found = numbers_.find(name); found != numbers_.end()) return found->second;
  std::vector<std::string> known;
  if (or_ground) known.emplace_back("ground");
  for (const Body& body : mechanism_.bodies) known.push_back(body.name);
  tables_.fail(place, fmt::format("{}: there is no body '{}'{}", what, name, suggestion(name, known)));
}

bool BodyReader::read_between(const toml::table& table, const std::string& what, int& first, int& second) {
  const toml::node* node = table.get("between");
  const toml::array* list = node == nullptr ? nullptr : node->as_array();
  if (list == nullptr || list->size() != 2)
    tables_.fail(
        node == nullptr ? place_of(table.source()) : place_of(node->source()),
        fmt::format("{} needs 'between', a list of two names of bodies, one of which may be \"ground\"",
                    what));
  first = body_number((*list)[0], "'between' of " + what, true);
  second = body_number((*list)[1], "'between' of " + what, true);
  const auto stands = [&](int body) {
    return body == ground || mechanism_.bodies[static_cast<std::size_t>(body)].fixed;
  };
  if (first == second || (stands(first) && stands(second)))
    tables_.fail(place_of(node->source()),
                 fmt::format("'between' of {}: expected two different bodies, at least one of "
                             "which moves",
                             what));
  if (first != ground && second != ground && is_plane(first) != is_plane(second))
    tables_.fail(
        place_of(node->source()),
        fmt::format("'between' of {}: one of the bodies is in the plane and the other is not", what));
  return is_plane(first) || is_plane(second);
}

/// Where the two ends are: `ends` in space at the start, or `points` in the bodies.
void BodyReader::read_ends(const toml::table& table, const std::string& what, bool plane, SharedVector& point,
                           std::optional<std::array<Vec, 2>>& in_space) {
  if (table.contains("ends") == table.contains("points"))
    tables_.fail(place_of(table.source()),
                 fmt::format("{} needs one of 'ends', two points in space at the start, and "
                             "'points', one in the axes of each body",
                             what));
  if (table.contains("ends"))
    in_space = two(table, "ends", what, plane, false);
  else
    point.in_bodies = two(table, "points", what, plane, false);
}

void BodyReader::read_joint(const toml::table& table) {
  Joint joint;
  joint.source = source(table);
  joint.name = name(table, "[[joint]]");
  const std::string what = fmt::format("joint '{}'", joint.name);
  joint.kind = choice(table, "kind", what, joint_kinds());
  const bool plane = read_between(table, what, joint.first, joint.second);
  using Kind = Joint::Kind;
  std::vector<std::string> keys{"name", "kind", "between", "points"};
  if (joint.kind == Kind::distance) keys.insert(keys.end(), {"ends", "length"});
  if (joint.kind != Kind::distance) keys.emplace_back("point");
  if (joint.kind == Kind::prismatic ||
      (!plane && (joint.kind == Kind::revolute || joint.kind == Kind::universal)))
    keys.insert(keys.end(), {"axis", "axes"});
  if (joint.kind == Kind::universal) keys.emplace_back("second_axis");
  if (joint.kind == Kind::revolute) keys.emplace_back("torque");
  if (joint.kind == Kind::prismatic) keys.emplace_back("force");
  tables_.check_keys(table, what, keys);
  if (plane && (joint.kind == Kind::universal || joint.kind == Kind::spherical))
    tables_.fail(
        place_of(table.get("kind")->source()),
        fmt::format(
            "'kind' of {}: in the plane expected \"revolute\", \"prismatic\", \"fixed\" or \"distance\"",
            what));
  if (joint.kind == Kind::distance) {
    read_ends(table, what, plane, joint.point, joint.in_space_ends);
    if (table.contains("length")) joint.length = positive(table, "length", what);
  } else {
    if (table.contains("point") == table.contains("points"))
      tables_.fail(place_of(table.source()),
                   fmt::format("{} needs one of 'point', in space at the start, and 'points', "
                               "one in the axes of each body",
                               what));
    if (table.contains("point"))
      joint.point.in_space = vector(*table.get("point"), fmt::format("'point' of {}", what), plane);
    else
      joint.point.in_bodies = two(table, "points", what, plane, false);
  }
  read_joint_axis(table, joint, what, plane);
  for (const char* drive : {"torque", "force"})
    if (const auto text = tables_.optional_formula(table, drive)) {
      joint.drive = text->text;
      parts_.formulas[joint.name + "_drive"] = text->start;
    }
  mechanism_.joints.push_back(std::move(joint));
}

void BodyReader::read_joint_axis(const toml::table& table, Joint& joint, const std::string& what,
                                 bool plane) {
  using Kind = Joint::Kind;
  const bool turns = joint.kind == Kind::revolute || joint.kind == Kind::universal;
  if (joint.kind != Kind::prismatic && (plane || !turns)) return;
  if (table.contains("axis") == table.contains("axes"))
    tables_.fail(place_of(table.source()),
                 fmt::format("{} needs one of 'axis', a direction in space at the start, and "
                             "'axes', one in the axes of each body",
                             what));
  if (table.contains("axis"))
    joint.axis.in_space = direction(*table.get("axis"), fmt::format("'axis' of {}", what), plane);
  else
    joint.axis.in_bodies = two(table, "axes", what, plane, true);
  if (joint.kind != Kind::universal || table.contains("axes")) return;
  if (!table.contains("second_axis"))
    tables_.fail(place_of(table.source()),
                 fmt::format("{} needs 'second_axis', that of the second body", what));
  joint.second_axis = direction(*table.get("second_axis"), fmt::format("'second_axis' of {}", what), false);
  const double cosine = dot(*joint.axis.in_space, *joint.second_axis).value();
  if (std::abs(cosine) > 1e-9)
    tables_.fail(
        place_of(table.get("second_axis")->source()),
        fmt::format("'second_axis' of {} makes an angle with 'axis' whose cosine is {:.6g}; they must be "
                    "perpendicular",
                    what, cosine));
}

void BodyReader::read_spring(const toml::table& table) {
  Spring spring;
  spring.source = source(table);
  spring.name = name(table, "[[spring]]");
  const std::string what = fmt::format("spring '{}'", spring.name);
  tables_.check_keys(table, what, {"name", "between", "ends", "points", "stiffness", "damping", "length"});
  const bool plane = read_between(table, what, spring.first, spring.second);
  read_ends(table, what, plane, spring.point, spring.in_space_ends);
  spring.stiffness = positive(table, "stiffness", what, true);
  if (table.contains("damping")) spring.damping = positive(table, "damping", what, true);
  if (table.contains("length")) spring.length = positive(table, "length", what, true);
  mechanism_.springs.push_back(std::move(spring));
}

void BodyReader::read_contact(const toml::table& table) {
  Contact contact;
  contact.source = source(table);
  if (!table.contains("body"))
    tables_.fail(place_of(table.source()), "[[rolling]] needs 'body', the name of what rolls");
  contact.body = body_number(*table.get("body"), "'body' of [[rolling]]", false);
  const Body& of = mechanism_.bodies[static_cast<std::size_t>(contact.body)];
  contact.name = table.contains("name") ? name(table, "[[rolling]]") : of.name + "_contact";
  const std::string what = fmt::format("rolling '{}'", contact.name);
  contact.kind = choice(table, "kind", what, contact_kinds());
  const bool knife = contact.kind == Contact::Kind::knife_edge;
  std::vector<std::string> keys{"name", "body", "kind"};
  if (!of.plane) keys.insert(keys.end(), {"surface", "contact"});
  if (knife) keys.insert(keys.end(), {"point", "direction"});
  if (!knife) keys.insert(keys.end(), {"radius", "centre"});
  if (contact.kind == Contact::Kind::disc) keys.emplace_back("axis");
  if (of.plane && !knife)
    tables_.fail(
        place_of(table.get("kind")->source()),
        fmt::format("'kind' of {}: in the plane expected \"knife edge\"; a wheel is a [[wheel]]", what));
  tables_.check_keys(table, what, keys);
  if (of.fixed)
    tables_.fail(place_of(table.get("body")->source()), fmt::format("{}: the body is fixed", what));
  if (!knife) contact.radius = positive(table, "radius", what);
  for (const char* key : {"centre", "point"})
    if (const toml::node* node = table.get(key))
      contact.centre = vector(*node, fmt::format("'{}' of {}", key, what), of.plane);
  if (knife) contact.axis = {1.0, 0.0, 0.0};
  for (const char* key : {"axis", "direction"})
    if (const toml::node* node = table.get(key))
      contact.axis = direction(*node, fmt::format("'{}' of {}", key, what), of.plane);
  if (const auto surface = tables_.optional_formula(table, "surface")) {
    contact.surface = surface->text;
    parts_.formulas[contact.name + "_h"] = surface->start;
    symbols_.definitions["x"] = symbols_.definitions["y"] = {"0.1"};  // to be read once where it stands
    value_of(*surface, fmt::format("'surface' of {}", what));
    symbols_.definitions.erase("x");
    symbols_.definitions.erase("y");
  }
  if (const toml::node* node = table.get("contact")) {
    if (of.position_given)
      tables_.fail(
          place_of(node->source()),
          fmt::format("'contact' of {}: the body has a 'position' already; expected one of them", what));
    const Vec point = vector(*node, fmt::format("'contact' of {}", what), true);
    contact.start = {point[0], point[1]};
  }
  mechanism_.contacts.push_back(std::move(contact));
}

/// In space a body, a hinge and a contact; in the plane two rows and an angle.
void BodyReader::read_wheel(const toml::table& table) {
  const int number = source(table);
  const std::string wheel = name(table, "[[wheel]]"), what = fmt::format("wheel '{}'", wheel);
  if (!table.contains("on"))
    tables_.fail(place_of(table.source()), fmt::format("{} needs 'on', the name of a body", what));
  const int on = body_number(*table.get("on"), fmt::format("'on' of {}", what), false);
  const auto torque = tables_.optional_formula(table, "torque");
  if (is_plane(on)) return read_plane_wheel(table, on, wheel, number);
  tables_.check_keys(
      table, what,
      {"name", "on", "centre", "axle", "radius", "mass", "inertia", "torque", "rate", "surface"});
  for (const char* key : {"centre", "axle"})
    if (!table.contains(key)) tables_.fail(place_of(table.source()), fmt::format("{} needs '{}'", what, key));
  Body body;
  body.name = wheel;
  body.source = number;
  body.mass = positive(table, "mass", what);
  body.shape = Body::Shape::disc;
  body.size[0] = positive(table, "radius", what);
  const Formula side = 0.25 * body.mass * square(body.size[0]);
  body.inertia = {{{side, 0.0, 0.0}, {0.0, side, 0.0}, {0.0, 0.0, 2.0 * side}}};
  if (const toml::node* node = table.get("inertia")) {
    const Vec moments = vector(*node, fmt::format("'inertia' of {}, about its axle and across", what), true);
    if (!(moments[0].value() > 0.0 && moments[1].value() > 0.0 &&
          moments[0].value() <= 2.0 * moments[1].value()))
      tables_.fail(
          place_of(node->source()),
          fmt::format(
              "'inertia' of {}, about its axle and across: {:g} and {:g}; they must be above 0, and the "
              "first at most twice the second",
              what, moments[0].value(), moments[1].value()));
    body.inertia = {{{moments[1], 0.0, 0.0}, {0.0, moments[1], 0.0}, {0.0, 0.0, moments[0]}}};
  }
  const Vec axle = direction(*table.get("axle"), fmt::format("'axle' of {}", what), false);
  body.position = vector(*table.get("centre"), fmt::format("'centre' of {}", what), false);
  body.position_given = true;
  body.orientation = from_z_to(axle);
  const Body& carrier = mechanism_.bodies[static_cast<std::size_t>(on)];
  const Formula spin = formula(table, "rate", 0.0, what);  // beside the rate of what carries it
  body.rate_given = carrier.rate_given && table.contains("rate");
  body.rate = transposed(matrix_of(body.orientation)) * (matrix_of(carrier.orientation) * carrier.rate) +
              Vec{0.0, 0.0, spin};
  Joint joint;
  joint.name = wheel + "_axle";
  joint.kind = Joint::Kind::revolute;
  joint.first = on;
  joint.second = static_cast<int>(mechanism_.bodies.size());
  joint.point.in_space = body.position;
  joint.axis.in_space = axle;
  joint.source = number;
  if (torque) {
    joint.drive = torque->text;
    parts_.formulas[joint.name + "_drive"] = torque->start;
  }
  Contact contact;
  contact.name = wheel + "_contact";
  contact.kind = Contact::Kind::disc;
  contact.body = joint.second;
  contact.radius = body.size[0];
  contact.source = number;
  if (const auto surface = tables_.optional_formula(table, "surface")) {
    contact.surface = surface->text;
    parts_.formulas[contact.name + "_h"] = surface->start;
  }
  add(std::move(body));
  mechanism_.joints.push_back(std::move(joint));
  mechanism_.contacts.push_back(std::move(contact));
}

void BodyReader::read_plane_wheel(const toml::table& table, int body, const std::string& name, int number) {
  const std::string what = fmt::format("wheel '{}'", name);
  tables_.check_keys(table, what, {"name", "on", "centre", "heading", "radius", "mass", "inertia", "torque"});
  PlaneWheel wheel;
  wheel.name = name;
  wheel.body = body;
  wheel.source = number;
  if (!table.contains("centre"))
    tables_.fail(place_of(table.source()), fmt::format("{} needs 'centre'", what));
  wheel.centre = vector(*table.get("centre"), fmt::format("'centre' of {}", what), true);
  if (const toml::node* node = table.get("heading"))
    wheel.heading = direction(*node, fmt::format("'heading' of {}", what), true);
  wheel.radius = positive(table, "radius", what);
  wheel.inertia = positive(table, "inertia", what);
  if (table.contains("mass")) wheel.mass = positive(table, "mass", what, true);
  if (const auto torque = tables_.optional_formula(table, "torque")) {
    wheel.drive = torque->text;
    parts_.formulas[name + "_drive"] = torque->start;
  }
  mechanism_.wheels.push_back(std::move(wheel));
}

}  // namespace diracstep::scene_compiler
