#pragma once

#include <diracstep/core/system/consistent_start.hpp>
#include <diracstep/scene_format/loader/loaded_scene.hpp>
#include <diracstep/scene_format/scene_catalogue.hpp>
#include <string>
#include <vector>

namespace diracstep {

/// What the file states, and 0 or the neutral element for the rest.  Throws SceneError for values that are
/// not finite.
StatedStart start_of(const LoadedScene& loaded);

/// Onto groups and spheres, from the digits that a file states; a note where they were few.  Throws
/// SceneError where it is far from them.
std::string put_on_space(const LoadedScene& loaded, Start& start);

/// Velocities of states are their rates.
void set_rates_of_states(const LoadedScenePtr& loaded, StatedStart& stated);

/// The components that the file calls guesses; none named: all are.
Guesses guesses_of(const LoadedScene& loaded);

/// Which coordinates rest at an operating point: all but the charges through elements other than capacitors,
/// and fluxes.
std::vector<bool> resting_coordinates(const LoadedScene& loaded);

/// Where the file asks for it, of the rows that act there.
void start_at_operating_point(const LoadedScene& loaded, Scene& scene, StatedStart& stated);

/// Moves the start onto the rows where the file asks for it, and notes by how much.
void project(const LoadedScene& loaded, CatalogueScene& entry, StatedStart& stated);

}  // namespace diracstep
