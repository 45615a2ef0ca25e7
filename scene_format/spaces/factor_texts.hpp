#pragma once

#include <array>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace diracstep::spaces {

/// A coordinate that is a group or a sphere, written in the numbers that it is stored in.
///
/// Increments multiply from the right, velocities are in the body (core/spaces/groups.hpp).  Of R = "SO3":
///
///   stored      R_w, R_x, R_y, R_z, the unit quaternion
///   components  R_1, R_2, R_3, so that v_R_1 … are the components of the velocity
///   entries     "R[1,2]" → "2*(R_x*R_y - R_w*R_z)", …, "w_R[1]" → "v_R_1", …
///   rates       of the stored numbers: "0.5*(-R_x*v_R_1 - R_y*v_R_2 - R_z*v_R_3)", …
///   definitions of S1 and SE2 the angle in (−π, π]: "a_angle" → "atan2(a_sin, a_cos)"
struct FactorTexts {
  std::vector<std::string> stored, components, rates;
  std::map<std::string, std::string> entries, definitions;
};

/// "SO3", "SE3", "SE2", "S2", "S1", "R1" … "R9".
bool is_factor(const std::string& kind);
std::string factor_kinds();

/// How many numbers a configuration is stored in and a velocity has.
std::array<std::size_t, 2> factor_sizes(const std::string& kind);

/// Of the coordinate `name`; `kind` is a factor.
FactorTexts factor_texts(const std::string& kind, const std::string& name);

// Starts, as formulas for the stored numbers.  The arguments are formulas.

/// The quaternion of a turn about an axis of any length.
std::vector<std::string> turn_about(const std::array<std::string, 3>& axis, const std::string& angle);
/// The quaternion of a frame whose third axis is the unit vector along `q`.
std::vector<std::string> frame_of(const std::array<std::string, 3>& q);
/// The unit quaternion of a rotation matrix, rows first; nothing where it is off one by more than 1e-6.
std::optional<std::array<double, 4>> quaternion_of(const std::array<std::array<double, 3>, 3>& matrix);

}  // namespace diracstep::spaces
