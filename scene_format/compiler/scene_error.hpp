#pragma once

#include <diracstep/core/numerics/errors.hpp>
#include <string>
#include <string_view>
#include <vector>

namespace diracstep::scene_compiler {

/// A point in a scene file, counted from 1; 0 where none is known.
struct Place {
  int line = 0;
  int column = 0;
};

/// A mistake in a scene file: "FILE:LINE:COLUMN: what is wrong and what was expected".
class SceneError : public Misuse {
 public:
  SceneError(const std::string& file, Place place, const std::string& message);
};

/// "; did you mean 'NAME'?" for the known name nearest to `name`, or "; known are …" where none is near.
std::string suggestion(std::string_view name, const std::vector<std::string>& known);

}  // namespace diracstep::scene_compiler
