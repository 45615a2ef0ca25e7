#pragma once

#include <diracstep/core/system/constraint_rows.hpp>
#include <diracstep/core/system/motion_point.hpp>
#include <memory>
#include <string>
#include <vector>

namespace diracstep {

/// Something that happens where a function of the motion changes its sign, or at times of a clock.
///
/// What it does, in this order, each formula read at the point just before:
///
///   set           coordinates, velocities (momenta where there is no Lagrangian) and states take new values
///   on, off       rows are switched
///   restitution   the momentum jumps by impulses in the annihilator of the contact's row A_c = ∂g/∂q, g
///                 being `contact`, and of the rows that are on:
///
///       p⁺ = p⁻ + A_cᵀ Λ_c + Aᵀ Λ,   A_c v⁺ + b_c = −e (A_c v⁻ + b_c),   A v⁺ + b = 0,   p = ∂L/∂v(q, v)
///
/// Without `restitution` there is no Λ_c: what was set off the distribution, or off a row that was switched
/// on, is moved onto it by impulses of the rows, as a plastic impact does.
struct Event {
  enum class Direction { both, rising, falling };
  struct Setting {
    int index;    ///< of the coordinate
    bool second;  ///< its velocity or momentum
    PointFunction value;
  };

  std::string name;
  PointFunction at = {};  ///< empty for an event of a clock
  Direction direction = Direction::both;
  bool stop = false;             ///< the run ends there
  double every = 0.0;            ///< in place of `at`: at the start and each so much time later
  PointFunction condition = {};  ///< happens only where this is above 0; empty: always
  std::vector<Setting> set = {};
  std::vector<std::string> on = {}, off = {};               ///< names of rows
  std::shared_ptr<const ConstraintRows> contact = nullptr;  ///< `at` as a holonomic row, where it is g(t, q)
  PointFunction restitution = {};                           ///< e; needs a contact

  bool acts() const { return !set.empty() || !on.empty() || !off.empty() || restitution; }
};

}  // namespace diracstep
