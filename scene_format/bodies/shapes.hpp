#pragma once

#include <diracstep/scene_format/bodies/mechanism.hpp>

namespace diracstep::bodies {

Matrix diagonal(const Formula& a, const Formula& b, const Formula& c);

/// The inertia of a uniform body about its centre; cylinders, discs and rods lie along z.
Matrix inertia_of(Body::Shape shape, const Formula& mass, const Vec& size);

/// Half axes of the ellipsoid with the same mass and moments of inertia.
Vec ellipsoid_of(const Body& body);

}  // namespace diracstep::bodies
