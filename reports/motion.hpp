#pragma once

#include <array>
#include <diracstep/scene_format/scene_catalogue.hpp>
#include <string>
#include <vector>

namespace diracstep {

/// What a picture of a motion draws.  But for bodies it is read off the names and the units of the
/// coordinates and off the holonomic rows, so such a scene says nothing about pictures:
///
///   space    the bodies of a scene that has some (docs/bodies.md), with their shapes
///   plane    points (x, y), (x1, y1), (x_7, y_7), … of one unit, else a scene's only two coordinates
///   profile  the elements of one long family q_1, q_2, … over their number
///   curves   the first few coordinates over time, for every other scene
///
/// Of a plane, a row (P − Q)·(P − Q) = const of two points is a bar between them, one of a single point a bar
/// to a pin, and an angle that is called a heading points the way of the only body.
struct DrawnMotion {
  enum class Form { space, plane, profile, curves };
  struct Coordinate {
    int index;  ///< in q
    std::string name, unit;
  };
  struct Body {
    std::string name;
    int x, y;          ///< places in `coordinates`
    int heading = -1;  ///< the same, or −1
  };
  struct Bar {
    int from, to;  ///< bodies; −1 − k is pin k
  };

  /// A body of CatalogueScene::bodies; `places` are its coordinates, in `coordinates`.
  struct Solid {
    std::string name, shape;
    std::array<double, 3> size;
    std::vector<int> places;
    std::array<double, 7> fixed;
  };

  Form form = Form::curves;
  std::vector<Coordinate> coordinates;
  std::vector<Body> bodies;
  std::vector<Bar> bars;
  std::vector<std::array<double, 2>> pins;
  std::vector<Solid> solids;
};

/// At most some hundred coordinates, however large the scene.
DrawnMotion motion_of(const CatalogueScene& entry);

/// "space", "plane", "profile" or "curves".
const char* name(DrawnMotion::Form form);

/// The unit of time that the units of a scene's symbols speak of: "s", "d", "1" where all are without a unit;
/// empty where that is not known.
std::string time_unit(const std::vector<SymbolNote>& notes);

}  // namespace diracstep
