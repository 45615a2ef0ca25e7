#pragma once

#include "law_scenes.hpp"

namespace diracstep::testing {
using namespace laws;

/// A separable scene whose force is not a number beyond x = 1.
inline std::shared_ptr<const Scene> edge_of_the_domain() {
  Scene scene;
  scene.name = "edge of the domain";
  scene.coordinates = {"x"};
  scene.lagrangian = lagrangian<1>([](const auto& q, const auto& v) {
    using std::sqrt;
    return 0.5 * v[0] * v[0] + sqrt(1.0 - q[0] * q[0]);
  });
  scene.start = {0.0, Vector::Constant(1, 0.5), Vector::Constant(1, 2.0)};
  return std::make_shared<const Scene>(scene);
}

}  // namespace diracstep::testing
