#include <algorithm>
#include <diracstep/scene_format/bodies/shapes.hpp>

namespace diracstep::bodies {

const std::map<std::string, ShapeKeys>& shapes() {
  static const std::map<std::string, ShapeKeys> all{
      {"box", {Body::Shape::box, {"size"}}},
      {"sphere", {Body::Shape::ball, {"radius"}}},
      {"cylinder", {Body::Shape::cylinder, {"radius", "length"}}},
      {"disc", {Body::Shape::disc, {"radius"}}},
      {"rod", {Body::Shape::rod, {"length"}}}};
  return all;
}

const char* shape_name(Body::Shape shape) {
  for (const auto& [name, keys] : shapes())
    if (keys.shape == shape) return name.c_str();
  return "ellipsoid";
}

Matrix diagonal(const Formula& a, const Formula& b, const Formula& c) {
  return {{{a, 0.0, 0.0}, {0.0, b, 0.0}, {0.0, 0.0, c}}};
}

Matrix inertia_of(Body::Shape shape, const Formula& mass, const Vec& size) {
  const Formula a = square(size[0]), b = square(size[1]), c = square(size[2]);
  switch (shape) {
    case Body::Shape::box:
      return diagonal(mass * (b + c) / 12.0, mass * (a + c) / 12.0, mass * (a + b) / 12.0);
    case Body::Shape::ball:
      return diagonal(0.4 * mass * a, 0.4 * mass * a, 0.4 * mass * a);
    case Body::Shape::cylinder: {
      const Formula side = mass * (3.0 * a + b) / 12.0;
      return diagonal(side, side, 0.5 * mass * a);
    }
    case Body::Shape::disc:
      return diagonal(0.25 * mass * a, 0.25 * mass * a, 0.5 * mass * a);
    case Body::Shape::rod:
      return diagonal(mass * a / 12.0, mass * a / 12.0, 0.0);
    case Body::Shape::none:
      break;
  }
  return diagonal(0.0, 0.0, 0.0);
}

bool is_inertia(const Matrix& inertia) {
  // ∫ρ x xᵀ = tr/2 − J is not negative for any density, and J is above 0 where it is not 0.
  const auto at = [&](std::size_t i, std::size_t k) { return inertia[i][k].value(); };
  const double half_trace = 0.5 * (at(0, 0) + at(1, 1) + at(2, 2));
  const auto spread = [&](std::size_t i, std::size_t k) { return (i == k ? half_trace : 0.0) - at(i, k); };
  const auto least_minor = [](const auto& matrix) {
    const auto minor = [&](std::size_t i, std::size_t k) {
      return matrix(i, i) * matrix(k, k) - matrix(i, k) * matrix(i, k);
    };
    const double determinant = matrix(0, 0) * minor(1, 2) +
                               matrix(0, 1) * (matrix(0, 2) * matrix(1, 2) - matrix(0, 1) * matrix(2, 2)) +
                               matrix(0, 2) * (matrix(0, 1) * matrix(1, 2) - matrix(1, 1) * matrix(0, 2));
    const double size = matrix(0, 0) + matrix(1, 1) + matrix(2, 2);
    return std::min({minor(0, 1) / (size * size), minor(0, 2) / (size * size), minor(1, 2) / (size * size),
                     determinant / (size * size * size)});
  };
  return least_minor(at) > 0.0 && least_minor(spread) > -1e-12;
}

const Body* rod_that_turns_freely(const Mechanism& mechanism) {
  for (std::size_t number = 0; number < mechanism.bodies.size(); ++number) {
    const Body& body = mechanism.bodies[number];
    if (body.plane || body.fixed || body.shape != Body::Shape::rod || body.inertia[2][2].value() != 0.0)
      continue;
    const int own = static_cast<int>(number);
    const bool held = std::ranges::any_of(mechanism.joints, [&](const Joint& joint) {
      return (joint.first == own || joint.second == own) && joint.kind != Joint::Kind::spherical &&
             joint.kind != Joint::Kind::distance;
    });
    const bool touches =
        std::ranges::any_of(mechanism.contacts, [&](const auto& one) { return one.body == own; });
    if (!held && !touches) return &body;
  }
  return nullptr;
}

Vec ellipsoid_of(const Body& body) {
  const auto half = [&](std::size_t i, std::size_t j, std::size_t k) {
    const Formula rest = body.inertia[j][j] + body.inertia[k][k] - body.inertia[i][i];
    return root(2.5 * rest / body.mass);
  };
  return {half(0, 1, 2), half(1, 2, 0), half(2, 0, 1)};
}

}  // namespace diracstep::bodies
