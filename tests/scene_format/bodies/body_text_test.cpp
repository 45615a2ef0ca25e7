#include <gtest/gtest.h>

#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/scene_format/compiler/plain_scene.hpp>
#include <vector>

#include "bodies.hpp"

/// Bodies as text: what they expand into as a plain scene, and what is refused.
namespace diracstep::body_tests {
namespace {

TEST_F(Bodies, TheFilesOwnFormulasJoinThoseOfTheBodies) {
  const std::string both = R"toml(lagrangian = "v_s^2/2 - s*b_x"
dissipation = "0.1*v_b_x^2"
coordinates = { s = { unit = "m" } }
force = { b_y = "0.5" }
start = { b_y = 0.25, s = 1 }
body = [
  { name = "b", plane = true, mass = 2, inertia = 1, velocity = [0.5, 0] },
  { name = "d", plane = true, mass = 1, inertia = 1, position = [1, 0] },
]
joint = [{ name = "slider", kind = "prismatic", between = ["b", "d"], point = [1, 0], axis = [0, 1], force = "2*cos(t)" }]
spring = [{ name = "k", between = ["b", "d"], points = [[0, 0], [0, 0]], stiffness = 3, damping = 0.2, length = 1 }]
)toml";
  const std::string text = "name = \"both\"\n" + both + span;
  const CatalogueScene entry = scene(text);
  EXPECT_EQ(at(entry, entry.scene->start.q, "b_y"), 0.25);  // the file's own start
  const std::string plain = scene_compiler::plain_scene("scene.toml", text);
  for (const char* part :
       {"+ bodies_lagrangian\"", "+ bodies_dissipation\"", "+ bodies_force_b_y\"", "b_y = 0.25"})
    EXPECT_NE(plain.find(part), std::string::npos) << part << " not in\n" << plain;
}

void expect_same_bits(const std::string& text) {
  const std::string plain = scene_compiler::plain_scene("scene.toml", text);
  EXPECT_EQ(plain.find("[[body]]"), std::string::npos);
  const CatalogueScene with = scene(text), without = scene(plain);
  EXPECT_TRUE(without.bodies.empty());
  ASSERT_EQ(with.scene->coordinates, without.scene->coordinates);
  ASSERT_EQ(with.scene->row_names(), without.scene->row_names());
  EXPECT_EQ(with.scene->start.q, without.scene->start.q);
  const Sample a = end_of(with.scene, 0.1, 0.02, "type1/gl:2"),
               b = end_of(without.scene, 0.1, 0.02, "type1/gl:2");
  EXPECT_EQ(a.q, b.q);
  EXPECT_EQ(a.v, b.v);
  ASSERT_EQ(with.outputs.size(), without.outputs.size());
  for (std::size_t k = 0; k < with.outputs.size(); ++k)
    EXPECT_EQ(with.outputs[k].at(a.point()), without.outputs[k].at(b.point()));
}

TEST_F(Bodies, TheExpandedSceneRunsToTheSameBits) {
  expect_same_bits(with_span(pendulum));
  for (const std::string& text : {ball_on, disc_on, skate_on})
    expect_same_bits(with_span(on_surface(text, ", surface = \"0.2*x^2\"")));
  expect_same_bits(R"toml(name = "mixed"
lagrangian = "v_s^2/2"
force = { b_y = "0.5*b_x" }
states = { e = { rate = "b_x - e" } }
inputs = { u = { times = [0, 1, 2], values = [0, 1, 0] } }
parameters = { m = { value = 2, unit = "kg", above = 0, meaning = "a \"mass\"" }, list = [1.5, 2] }
body = [{ name = "b", plane = true, mass = "m", inertia = 1, velocity = [0.5, 0] }]
wheel = [{ name = "w", on = "b", centre = [0, 0.2], radius = 0.1, inertia = 0.01, torque = "u*list[2]" }]
outputs = { twice = "2*b_x" }
[coordinates]
s = { unit = "m", meaning = "own" }
[[rows]]
name = "own"
equation = "s - 0.1*b_th = 0"
[start]
guess = ["v_s"]
[span]
end = 1
step = 0.1
)toml");
  const std::string own = "name = \"s\"\nlagrangian = \"v_x^2\"\n[coordinates]\nx = {}\n" + span;
  EXPECT_EQ(scene_compiler::plain_scene("scene.toml", own), own);
}

TEST_F(Bodies, SizesFollowTheParameters) {
  const std::string text = with_span(
      "parameters = { r = 0.5 }\nbody = [{ name = \"b\", mass = 1, shape = \"cylinder\", radius = \"r\", "
      "length = \"2*r\" }]\n");
  const auto bodies = scene_from_text("scene.toml", text, {{"r", 2.0}}).bodies;
  ASSERT_EQ(bodies.size(), 1u);
  EXPECT_EQ(bodies[0].shape, "cylinder");
  EXPECT_EQ(bodies[0].size[0], 2.0);
  EXPECT_EQ(bodies[0].size[1], 4.0);
  EXPECT_EQ(bodies[0].coordinates, (std::vector<int>{0, 1, 2, 3, 4, 5, 6}));
}

std::string message_of(const std::string& text) {
  try {
    (void)scene(text);
  } catch (const Misuse& misuse) {
    return misuse.what();
  }
  return "";
}

struct Mistake {
  std::string from, to;
  std::vector<std::string> words;
};

TEST_F(Bodies, MistakesAreToldWithTheirPlace) {
  const std::string unchanged = with_span(pendulum);
  ASSERT_EQ(message_of(unchanged), "");
  for (const Mistake& mistake : std::vector<Mistake>{
           {"mass = 2", "mass = -2", {"scene.toml:5:8", "'mass' of body 'bob' is -2; it must be above 0"}},
           {"mass = 2", "mass = \"mm\"", {"scene.toml:5:9", "unknown name 'mm'"}},
           {"mass = 2", "mass = \"2*t\"", {"scene.toml:5:11", "'mass' of body 'bob'"}},
           {"mass = 2\n", "", {"scene.toml:3:1", "body 'bob' needs 'mass'"}},
           {"mass = 2", "masse = 2", {"scene.toml:5:1", "did you mean 'mass'"}},
           {"inertia = [0.1, 0.1, 0.05]",
            "inertia = [0.1, 0.1]",
            {"scene.toml:6:11", "three principal moments"}},
           {"inertia = [0.1, 0.1, 0.05]",
            "inertia = [0.1, 0.1, 0.3]",
            {"scene.toml:6:22", "more than the sum"}},
           {"inertia = [0.1, 0.1, 0.05]", "inertia = [0.1, 0, 0.1]", {"scene.toml:6:17", "above 0"}},
           {"inertia = [0.1, 0.1, 0.05]", "shape = \"cube\"", {"scene.toml:6:9", "\"box\", \"cylinder\""}},
           {"inertia = [0.1, 0.1, 0.05]", "radius = 1", {"scene.toml:6:10", "needs a 'shape'"}},
           {"position = [0.6, 0, -0.8]", "position = [0.6, 0]", {"scene.toml:7:12", "list of three"}},
           {"inertia = [0.1, 0.1, 0.05]",
            "inertia = [0.1, 0.1, 0.1, 0.2, 0, 0]",
            {"principal moments", "above 0"}},
           {"position = [0.6, 0, -0.8]",
            "orientation = [1, 1, 0, 0]",
            {"scene.toml:7:15", "of length 1.41421"}},
           {"position = [0.6, 0, -0.8]",
            "orientation = [[1, 0, 0], [0, 1, 0], [0, 0, -1]]",
            {"scene.toml:7:15", "no rotation"}},
           {"kind = \"revolute\"",
            "kind = \"hinge\"",
            {"scene.toml:10:8", "expected \"distance\", \"fixed\""}},
           {"[\"ground\", \"bob\"]", "[\"ground\", \"bop\"]", {"scene.toml:11:22", "did you mean 'bob'"}},
           {"[\"ground\", \"bob\"]", "[\"bob\", \"bob\"]", {"two different bodies"}},
           {"axis = [0, 1, 0]", "axis = [0, 0, 0]", {"scene.toml:13:8", "length 0"}},
           {"axis = [0, 1, 0]\n", "", {"scene.toml:8:1", "needs one of 'axis'"}},
           {"axis = [0, 1, 0]",
            "axis = [0, 1, 0]\nforce = \"1\"",
            {"scene.toml:14:1", "unknown key 'force'"}},
           {"axis = [0, 1, 0]", "axis = [0, 1, 0]\ntorque = \"b\"", {"scene.toml:14:11", "unknown name 'b'"}},
           {"name = \"pin\"", "name = \"bob\"", {"scene.toml:9:8", "used twice"}},
           {"[[body]]", "[[bodies]]", {"scene.toml:3", "unknown key 'bodies'"}},
           {"[[body]]\n", "[[rolling]]\nbody = \"x\"\n[[body]]\n", {"there is no body 'x'", "known are bob"}},
           {"gravity = 9.81", "hamiltonian = \"1\"", {"no 'hamiltonian'"}}}) {
    std::string text = unchanged;
    const std::size_t where = text.find(mistake.from);
    ASSERT_NE(where, std::string::npos) << mistake.from;
    const std::string message = message_of(text.replace(where, mistake.from.size(), mistake.to));
    for (const std::string& word : mistake.words)
      EXPECT_NE(message.find(word), std::string::npos)
          << "'" << word << "' not in: " << message << "\nfor " << mistake.to;
  }
}

/// Nothing gives its turn about itself a momentum; a cylinder, a moment of its own or a hinge does.
TEST_F(Bodies, AThinRodThatMayTurnAboutItselfIsRefusedByName) {
  const auto rod = [](const std::string& more, const std::string& joint) {
    return message_of(with_span(
        "gravity = 9.81\nbody = [{ name = \"bar\", mass = 1, from = [0, 0, 0], to = [1, 0, 0], " + more +
        " }]\njoint = [{ name = \"pin\", between = [\"ground\", \"bar\"], " + joint + " }]\n"));
  };
  const std::string thin = "shape = \"rod\"", pin = "kind = \"spherical\", point = [0, 0, 0]";
  for (const std::string& joint : {pin, std::string("kind = \"distance\", ends = [[0, 0, 1], [0, 0, 0]]")}) {
    const std::string message = rod(thin, joint);
    EXPECT_NE(message.find("body 'bar' is a thin rod"), std::string::npos) << message;
    EXPECT_NE(message.find("\"cylinder\""), std::string::npos) << message;
  }
  EXPECT_EQ(rod("shape = \"cylinder\", radius = 0.01", pin), "");
  EXPECT_EQ(rod(thin + ", inertia = [0.1, 0.1, 0.01]", pin), "");
  EXPECT_EQ(rod(thin, "kind = \"revolute\", point = [0, 0, 0], axis = [0, 1, 0]"), "");
}

}  // namespace
}  // namespace diracstep::body_tests
