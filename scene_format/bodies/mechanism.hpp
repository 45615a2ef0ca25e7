#pragma once

#include <array>
#include <diracstep/scene_format/bodies/rotation.hpp>
#include <optional>
#include <string>
#include <vector>

namespace diracstep::bodies {

/// A rigid body, or in the plane one that moves by x, y and an angle.  Lengths, masses and angles are
/// formulas in the parameters.  Inertia is about the centre of mass, in the axes of the body.
struct Body {
  enum class Shape { none, box, ball, cylinder, disc, rod };

  std::string name;
  bool plane = false;
  bool fixed = false;
  Formula mass = 0.0;
  Matrix inertia = unit_matrix();  ///< in the plane the entry 3, 3 alone
  Vec position = zero_vector();    ///< of the centre of mass, in space
  Rotation::Quaternion orientation = {1.0, 0.0, 0.0, 0.0};
  Formula angle = 0.0;  ///< in the plane
  Vec velocity = zero_vector();
  Vec rate = zero_vector();  ///< in the body; in the plane the third component
  bool velocity_given = false, rate_given = false;
  bool position_given = false;
  bool laid_between = false;  ///< by `from` and `to`: in the plane its axis lies in it
  bool guess = false;         ///< position and orientation are moved onto the rows
  Shape shape = Shape::none;
  Vec size =
      zero_vector();  ///< box: edges; ball: radius; cylinder and disc: radius, length along z; rod: length
  int source = 0;     ///< its number among the tables of the file
};

/// A point or a direction that two bodies share, as it is at the start or as each has it in its own axes.
struct SharedVector {
  std::optional<Vec> in_space = {};
  std::optional<std::array<Vec, 2>> in_bodies = {};
};

constexpr int ground = -1;

struct Joint {
  enum class Kind { spherical, revolute, prismatic, universal, fixed, distance };

  std::string name;
  Kind kind = Kind::spherical;
  int first = ground, second = ground;  ///< numbers of bodies
  SharedVector point;                   ///< of a distance the two ends, by in_space_ends or in_bodies
  std::optional<std::array<Vec, 2>> in_space_ends = {};
  SharedVector axis;                    ///< of unit length; universal: that of the first, and
  std::optional<Vec> second_axis = {};  ///< that of the second body, in space at the start
  std::optional<Formula> length = {};   ///< of a distance; else as at the start
  std::string drive = {};  ///< formula of a torque, or a force, along the axis on the second body
  int source = 0;
};

/// A spring with a damper between two points.
struct Spring {
  std::string name;
  int first = ground, second = ground;
  SharedVector point;  ///< as of a distance
  std::optional<std::array<Vec, 2>> in_space_ends = {};
  Formula stiffness = 0.0, damping = 0.0;
  std::optional<Formula> length = {};  ///< at rest; else as at the start
  int source = 0;
};

/// Contact with the plane z = 0, or with the surface z = h(x, y), without slip; of a knife edge without slip
/// across the blade.
struct Contact {
  enum class Kind { ball, disc, knife_edge };

  std::string name;
  Kind kind = Kind::ball;
  int body = 0;
  Formula radius = 0.0;
  Vec centre = zero_vector();  ///< in the body; of a knife edge the point that touches
  Vec axis = {0.0, 0.0, 1.0};  ///< in the body: of a disc; of a knife edge the direction of the blade
  std::optional<std::string> surface = {};           ///< h, a formula in x and y
  std::optional<std::array<Formula, 2>> start = {};  ///< x and y of the point of contact
  int source = 0;
};

/// A wheel of a body in the plane, seen from above: no slip across it, and along it the speed radius·rate.
struct PlaneWheel {
  std::string name;
  int body = 0;
  Vec centre = zero_vector(), heading = {1.0, 0.0, 0.0};  ///< in space at the start
  Formula radius = 1.0, mass = 0.0, inertia = 0.0;        ///< about its axle
  std::string drive = {};                                 ///< formula of a torque about its axle
  int source = 0;
};

struct Mechanism {
  std::vector<Body> bodies;
  std::vector<Joint> joints;
  std::vector<Contact> contacts;
  std::vector<PlaneWheel> wheels;
  std::vector<Spring> springs;
  Vec gravity = zero_vector();

  bool empty() const { return bodies.empty(); }
};

/// Texts of a plain scene, in order; `source` as in the mechanism.
struct Expansion {
  struct Coordinate {
    std::string name, unit, meaning;
    int source;
  };
  struct Named {
    std::string name, text;
    int source;
  };
  std::vector<Coordinate> coordinates;
  std::vector<Named> definitions, rows, outputs, start, force;
  std::string lagrangian, dissipation;  ///< empty where there is none
  std::vector<std::string> guesses;     ///< components of the start that may be moved
};

/// The mechanism as a plain scene:
///
///   L = Σ m |v|²/2 + w·J w/2 − energies of springs + m g·x
///
/// with v in space and w in the body; the joints and contacts as rows.  Every joint has outputs for the force
/// and torque that it lays on its second body at its point, in space.
Expansion expand(const Mechanism& mechanism);

}  // namespace diracstep::bodies
