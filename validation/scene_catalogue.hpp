#pragma once

#include <diracstep/core/scene.hpp>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace diracstep {

using Parameters = std::map<std::string, double>;

/// A point of the true motion.
struct ReferencePoint {
  Vector q;
  Vector v;
};

/// What the errors of a study are taken against.
struct Reference {
  std::string kind;         ///< "exact": a closed form; "published": digits from a source
  std::string how;          ///< the closed form or the source in a line
  double self_error = 0.0;  ///< relative error of the reference itself
  /// The true motion at time t; empty where the reference does not reach t.
  std::function<std::optional<ReferencePoint>(double t)> at;
};

/// A scene as the command and the studies know it.
struct CatalogueScene {
  std::shared_ptr<const Scene> scene;
  std::string kind;         ///< "unconstrained", "holonomic", "nonholonomic"
  std::string description;
  std::string source;       ///< where the data come from
  Parameters parameters;    ///< as used, after changes
  double t_end = 0.0;       ///< where studies end
  double natural_step = 0.0;  ///< a coarse but sensible step: the start of a study's ladder
  Reference reference;
};

/// Names of the scenes that come with the library, sorted.
std::vector<std::string> scene_names();

/// A scene by name, some of its parameters changed.  Throws Misuse for an unknown scene or parameter, listing the
/// known ones, and for a value the scene cannot have.
CatalogueScene make_scene(const std::string& name, const Parameters& changes = {});

}  // namespace diracstep
