#pragma once

#include <diracstep/core/system/scene.hpp>
#include <string>
#include <vector>

namespace diracstep {

enum class StartOrigin;

/// Names of the Scene::storage_size() numbers of a configuration: the coordinates in R^n.  On groups and
/// spheres those of a scene file, R_w, R_x, R_y, R_z for the components R_1, R_2, R_3; where components are
/// not so named or a factor is a user's own, q_1, q_2, …
std::vector<std::string> position_names(const Scene& scene);

/// "given", "left out", …: where a value of a start is from.
const char* describe(StartOrigin origin);

/// Throws Misuse where the scene is on groups or spheres; `what` is what knows R^n only: "a sweep".
void require_flat(const Scene& scene, const std::string& what);

}  // namespace diracstep
