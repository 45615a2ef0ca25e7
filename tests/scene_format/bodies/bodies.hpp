#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <diracstep/scene_format/scene_file.hpp>
#include <stdexcept>
#include <string>

#include "stepping.hpp"

/// Bodies as text, and what their tests ask of them.
namespace diracstep::body_tests {

using diracstep::testing::end_of;

class Bodies : public ::testing::Test {
 protected:
  void SetUp() override { setenv("DIRACSTEP_CC", "none", 1); }  // each is run a few steps
  void TearDown() override { unsetenv("DIRACSTEP_CC"); }
};

inline CatalogueScene scene(const std::string& text) { return scene_from_text("scene.toml", text); }

inline const std::string span = "[span]\nend = 1\nstep = 0.02\n";

inline std::string with_span(const std::string& bodies) { return "name = \"s\"\n" + bodies + span; }

inline double at(const CatalogueScene& entry, const Vector& values, const std::string& coordinate) {
  const auto& names = entry.scene->coordinates;
  const auto found = std::ranges::find(names, coordinate);
  if (found == names.end()) throw std::logic_error("no coordinate " + coordinate);
  return values[found - names.begin()];
}

inline double output(const CatalogueScene& entry, const Sample& sample, const std::string& name) {
  const auto found = std::ranges::find(entry.outputs, name, &Output::name);
  if (found == entry.outputs.end()) throw std::logic_error("no output " + name);
  return found->at(sample.point());
}

inline double change_of_energy(const CatalogueScene& entry, long steps, double step,
                               const std::string& method) {
  const auto samples = testing::samples_of(entry.scene, {.method = method, .step = step}, steps);
  return std::abs(samples.back().energy - samples.front().energy);
}

inline const std::string pendulum = R"toml(gravity = 9.81
[[body]]
name = "bob"
mass = 2
inertia = [0.1, 0.1, 0.05]
position = [0.6, 0, -0.8]
[[joint]]
name = "pin"
kind = "revolute"
between = ["ground", "bob"]
point = [0, 0, 0]
axis = [0, 1, 0]
)toml";

inline const std::string ball_on = R"toml(gravity = 9.81
body = [{ name = "ball", mass = 1, inertia = [0.02, 0.03, 0.025], orientation = { axis = [1, 1, 0], angle = 0.5 }, rate = [2, -1, 0.5] }]
rolling = [{ body = "ball", kind = "ball", radius = 0.25, centre = [0.01, 0.02, 0], contact = [0.1, 0.2]SURFACE }]
)toml";
inline const std::string disc_on = R"toml(gravity = 9.81
body = [{ name = "disc", mass = 1, shape = "disc", radius = 0.4, orientation = { axis = [0, 1, 0], angle = 1.3 }, rate = [-0.6, 0, 4] }]
rolling = [{ body = "disc", kind = "disc", radius = 0.4, contact = [0, 0]SURFACE }]
)toml";
inline const std::string skate_on = R"toml(gravity = 9.81
body = [{ name = "skate", mass = 1, inertia = [0.05, 0.06, 0.04], orientation = { axis = [0, 1, 0], angle = 0.2 }, rate = [0.3, 0, 1] }]
rolling = [{ body = "skate", kind = "knife edge", point = [0.1, 0, -0.3], direction = [1, 0, 0], contact = [0, 0]SURFACE }]
)toml";

inline std::string on_surface(std::string text, const std::string& surface) {
  return text.replace(text.find("SURFACE"), 7, surface);
}

}  // namespace diracstep::body_tests
