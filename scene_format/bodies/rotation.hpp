#pragma once

#include <array>
#include <diracstep/scene_format/bodies/formula.hpp>
#include <string>
#include <utility>
#include <vector>

namespace diracstep::bodies {

/// The coordinates of a body's rotation R, body to space: the unit quaternion NAME_q0 … NAME_q3 (w, x, y, z).
/// That they are these is known here and nowhere else.  Rates and torques are in the body.
class Rotation {
 public:
  explicit Rotation(std::string body) : body_(std::move(body)) {}

  static constexpr int coordinates = 4;
  std::string coordinate(int i) const;
  /// What the row named NAME_unit demands: |q| = 1.
  std::string row() const;
  /// R, each entry by the name of its definition.
  Matrix matrix() const;
  /// The rate in the body, by the names of its definitions, and the same in space.
  Vec rate() const;
  Vec rate_in_space() const;
  /// Names and texts of the definitions.
  std::vector<std::pair<std::string, Formula>> definitions() const;

  using Quaternion = std::array<Formula, 4>;
  /// The start of the coordinates and of their velocities, for a rate in the body.
  static Quaternion start(const Quaternion& orientation) { return orientation; }
  static Quaternion start_rate(const Quaternion& orientation, const Vec& rate);
  /// The generalised forces on the coordinates of a torque in the body: the power is their product with v_q.
  Quaternion forces(const Vec& torque) const;

 private:
  std::string body_;
};

/// R of a unit quaternion.
Matrix matrix_of(const Rotation::Quaternion& q);
using Numbers = std::array<std::array<double, 3>, 3>;
/// The largest entry of |R Rᵀ − 1|, infinite where the determinant is not above 0.
double distance_from_rotations(const Numbers& r);
/// Of a rotation, by the largest of its four components.
Rotation::Quaternion quaternion_of(const Numbers& r);
/// The rotation that takes the z axis to a unit vector.
Rotation::Quaternion from_z_to(const Vec& axis);

}  // namespace diracstep::bodies
