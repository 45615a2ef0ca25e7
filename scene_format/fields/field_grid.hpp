#pragma once

#include <diracstep/scene_format/fields/field_elements.hpp>
#include <diracstep/scene_format/fields/field_texts.hpp>
#include <string>
#include <vector>

namespace diracstep::scene_compiler {

/// What holds at an end of the line for a field: nothing (free, the natural boundary condition ∂ℒ/∂u_x = 0),
/// or a value as a formula in t.
struct FieldEnd {
  bool given = false;
  std::string value;
};

struct Field {
  std::string name;
  FieldEnd left, right;
  std::string jump;  ///< u(x + length) = u(x) + jump of a periodic field; empty: none
};

/// Cells of equal lengths on a line, numbered from 1 to `cells`, as texts of formulas.
struct FieldGrid {
  FieldElement element;
  bool periodic = false;
  std::string from, length;
  std::vector<Field> fields;

  /// A field's coordinates are families: the values at the left ends of cells, and those at each inner node.
  struct Family {
    std::string name;
    std::string loops;     ///< "cell = 1..cells"
    std::string position;  ///< of its element `cell`, for x
  };
  std::vector<Family> families(const Field& field) const;
  std::string end(bool right) const;  ///< x there

  /// Σ over cells and points of the quadrature of a formula in fields, their derivatives and x.
  std::string integral(const std::string& formula) const;

 private:
  /// All cells, or those that have neighbours; and the ones at the ends.
  std::string cell_integral(const std::string& formula, const std::string& cell) const;
  NameTexts at_point(const std::string& cell, Eigen::Index point) const;
  std::string node(const Field& field, const std::string& cell, int number, bool velocity) const;
  bool alike() const;  ///< no cell differs from others
};

}  // namespace diracstep::scene_compiler
