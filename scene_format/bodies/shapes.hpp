#pragma once

#include <diracstep/scene_format/bodies/mechanism.hpp>
#include <map>
#include <string>
#include <vector>

namespace diracstep::bodies {

struct ShapeKeys {
  Body::Shape shape;
  std::vector<const char*> sizes;  ///< keys; "size" is a list of three
};
/// Shapes by their names in a scene file, and the name of one.
const std::map<std::string, ShapeKeys>& shapes();
const char* shape_name(Body::Shape shape);

Matrix diagonal(const Formula& a, const Formula& b, const Formula& c);

/// The inertia of a uniform body about its centre; cylinders, discs and rods lie along z.
Matrix inertia_of(Body::Shape shape, const Formula& mass, const Vec& size);

/// Whether a body of positive density has this inertia, by its value.
bool is_inertia(const Matrix& inertia);

/// A thin rod in space, without a moment of inertia about itself, whose turn about itself no joint or contact
/// holds, so that it is a motion without momentum; null where there is none.
const Body* rod_that_turns_freely(const Mechanism& mechanism);

/// Half axes of the ellipsoid with the same mass and moments of inertia.
Vec ellipsoid_of(const Body& body);

}  // namespace diracstep::bodies
