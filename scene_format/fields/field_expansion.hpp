#pragma once

#include <toml++/toml.h>

#include <cstddef>
#include <functional>
#include <string>
#include <string_view>

namespace diracstep::scene_compiler {

/// Turns the root of a scene file with a table [field] (docs/fields.md) into that of a scene without one. The
/// coordinates that are not repeated are the fields u(t, x); where these may stand, so may u_t, u_x and x.
///
///   u              u[cell], the value at the left end of each cell, and u_i1[cell] … at its inner nodes
///   density        lagrangian += integral(density)
///   integral(f)    Σ over cells and points of the quadrature (field_elements.hpp), in the Lagrangian, the
///                  dissipation, invariants and outputs
///   start, reference   u and u_t = v_u at the places of the coordinates
///
/// Names that the scene then has: the size `cells`, the definition `dx`, the index `cell`.  Entries that are
/// changed keep their places in the file.  `is_reserved` tells names that formulas have for themselves, such
/// as sin.  Throws FieldError.
void expand_field(toml::table& root, const std::function<bool(std::string_view)>& is_reserved);

/// A mistake at a node of the root, and for a text at one of its characters.
struct FieldError {
  const toml::node* node;
  std::string message;
  std::size_t offset = 0;
};

}  // namespace diracstep::scene_compiler
