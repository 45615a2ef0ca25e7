#include <diracstep/scene_format/bodies/shapes.hpp>

namespace diracstep::bodies {

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

Vec ellipsoid_of(const Body& body) {
  const auto half = [&](std::size_t i, std::size_t j, std::size_t k) {
    const Formula rest = body.inertia[j][j] + body.inertia[k][k] - body.inertia[i][i];
    return root(2.5 * rest / body.mass);
  };
  return {half(0, 1, 2), half(1, 2, 0), half(2, 0, 1)};
}

}  // namespace diracstep::bodies
