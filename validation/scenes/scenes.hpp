#pragma once

#include <diracstep/validation/scene_catalogue.hpp>

/// The scenes of the catalogue, one file each; parameters not given are not defaulted here.
namespace diracstep::scenes {

CatalogueScene kepler(const Parameters& parameters);
CatalogueScene knife_edge(const Parameters& parameters);
CatalogueScene nonholonomic_particle_free(const Parameters& parameters);
CatalogueScene pendulum_cartesian(const Parameters& parameters);

}  // namespace diracstep::scenes
