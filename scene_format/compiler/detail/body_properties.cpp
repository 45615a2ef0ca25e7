#include <fmt/format.h>

#include <cmath>
#include <diracstep/scene_format/bodies/shapes.hpp>
#include <diracstep/scene_format/compiler/body_reader.hpp>

/// How bodies are made of what their tables say: sizes and masses, inertia, orientation.
namespace diracstep::scene_compiler {

using namespace bodies;

namespace {

constexpr double of_length_one = 1e-9;  // how far a quaternion or a matrix of numbers may be from a rotation

}  // namespace

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
  Vec along = vector(*table.get("to"), fmt::format("'to' of {}", what), body.plane) -
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

}  // namespace diracstep::scene_compiler
