#include <gtest/gtest.h>

#include <diracstep/core/integrator/integrator.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/scene_format/loader/scene_template.hpp>
#include <diracstep/scene_format/scene_file.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>
#include <string>
#include <vector>

#include "misuse.hpp"

/// What a mistake in a scene file is told as: where it is, what is wrong, what was expected.
namespace diracstep {
namespace {

const std::string good = R"toml(name = "bad"
lagrangian = "m*(v_x^2 + v_y^2)/2 - m*g*y"
[coordinates]
x = { unit = "m", meaning = "sideways" }
y = { unit = "m", meaning = "upwards" }
[parameters]
m = { value = 2, above = 0 }
g = 9.81
[sizes]
N = { value = 3, min = 1, max = 1000 }
[[rows]]
name = "rod"
equation = "x^2 + y^2 - 1 = 0"
[start]
x = 1
[span]
end = 1
step = 0.1
)toml";

std::string changed(const std::string& from, const std::string& to) {
  std::string text = good;
  const std::size_t at = text.find(from);
  if (at == std::string::npos) throw std::logic_error("'" + from + "' is not in the file");
  return text.replace(at, from.size(), to);
}

std::string message_of(const std::string& text, const Parameters& changes = {}) {
  try {
    (void)scene_from_text("bad.toml", text, changes);
  } catch (const Misuse& misuse) {
    return misuse.what();
  }
  return "";
}

void expect_told(const std::string& text, const std::vector<std::string>& words,
                 const Parameters& changes = {}) {
  const std::string message = message_of(text, changes);
  for (const auto& word : words)
    EXPECT_NE(message.find(word), std::string::npos) << "'" << word << "' not in: " << message;
}

TEST(BadFiles, TheFileTheyAreMadeFromIsGood) { EXPECT_EQ(message_of(good), ""); }

TEST(BadFiles, TheTemplateIsGood) {
  const CatalogueScene entry = scene_from_text("t.toml", scene_template("t"));
  EXPECT_NO_THROW(require_consistent(*entry.scene, entry.scene->start));
  EXPECT_THROW((void)scene_template("no name"), Misuse);
}

TEST(BadFiles, TomlMistakesHaveLineAndColumn) {
  expect_told(changed("[sizes]", "[sizes"), {"bad.toml:9:"});
  expect_told(changed("g = 9.81", "g = 9.81 m"), {"bad.toml:8:"});
}

TEST(BadFiles, UnknownKeysNameTheNearest) {
  expect_told(changed("lagrangian", "lagrangean"),
              {"bad.toml:2:1", "lagrangean", "did you mean 'lagrangian'?"});
  expect_told(changed("meaning = \"up", "meening = \"up"), {"bad.toml:5:19", "meening", "'meaning'"});
  expect_told(changed("equation", "eqation"), {"bad.toml:13:1", "'equation'"});
}

TEST(BadFiles, OneLetterIsNoMisspellingOfAnother) {
  const std::string message = message_of(changed("m*g*y\"", "m*g*k\""));
  EXPECT_NE(message.find("unknown name 'k'"), std::string::npos) << message;
  EXPECT_EQ(message.find("did you mean"), std::string::npos) << message;
}

TEST(BadFiles, FormulasAreToldByLineAndColumn) {
  expect_told(changed("m*g*y\"", "m*gg*y\""), {"bad.toml:2:39", "unknown name 'gg'", "'g'"});
  expect_told(changed("m*g*y\"", "m*g*\""), {"bad.toml:2:41", "expected a number, a name or '('", "the end"});
  expect_told(changed("v_y^2)/2", "v_y^2/2"), {"bad.toml:2:41", "expected ')'"});
  expect_told(changed("m*g*y\"", "2m*g*y\""), {"bad.toml:2:37", "'*'"});
  expect_told(changed("m*g*y\"", "m*g*y)\""), {"bad.toml:2:42", "')'"});
  expect_told(changed("m*g*y\"", "m*g*sine(y)\""), {"bad.toml:2:41", "unknown function 'sine'", "'sin'"});
  expect_told(changed("- m*g*y\"", "; system(1)\""), {"bad.toml:2:35", "';'"});
  expect_told(changed("x^2 + y^2 - 1 = 0", "x^2 + y^2 - 1"), {"bad.toml:13:26", "'='"});
  expect_told(changed("v_x^2 + v_y^2", "v_x^2 + p_y^2"), {"bad.toml:2:26", "'p_y'", "expected v_y"});
  expect_told(changed("\"m*(v_x^2 + v_y^2)/2 - m*g*y\"", "'''\n  m*(v_x^2 + v_y^2)/2\n  - m*gg*y'''"),
              {"bad.toml:4:7", "'gg'"});
  expect_told(changed("\"m*(", "\"kepler_E(x, 0)*("), {"bad.toml:2:15", "references only"});
  expect_told(changed("\"m*(", "\"µ*("), {"bad.toml:2:15", "'µ'"});
}

TEST(BadFiles, RowsMustBeLinearInTheVelocities) {
  expect_told(changed("x^2 + y^2 - 1 = 0", "v_x^2 + y = 0"),
              {"bad.toml:13:13", "row 'rod'", "not linear in v_x"});
  expect_told(changed("x^2 + y^2 - 1 = 0", "v_x*v_y = 1"), {"bad.toml:13:13", "not linear"});
  expect_told(changed("x^2 + y^2 - 1 = 0", "m = 2"), {"bad.toml:13:13", "no coordinate"});
}

TEST(BadFiles, SomethingMustMove) {
  expect_told(changed("lagrangian", "hamiltonian"), {"bad.toml:2:", "v_x", "p_x"});
  // Without velocities in L the rows have to determine the motion, which is seen when the scene is stepped.
  for (const std::string& text : {changed("m*(v_x^2 + v_y^2)/2", "m*(x^2 + y^2)/2"),
                                  changed("lagrangian = \"m*(v_x^2 + v_y^2)/2 - m*g*y\"", "")}) {
    const CatalogueScene entry = scene_from_text("bad.toml", text);
    testing::expect_misuse(
        [&] {
          const Integrator integrator(entry.scene, Registry::with_built_ins(), kinsol(), {.step = 0.1});
        },
        {"carries no momentum"});
  }
}

TEST(BadFiles, WhatIsNotDefinedAtTheStartIsNamed) {
  expect_told(changed("- m*g*y\"", "- m*g/y\""), {"bad.toml:2:40", "division by zero"});
  expect_told(changed("- m*g*y\"", "- log(x - 1)\""), {"bad.toml:2:37", "logarithm", "of 0"});
  expect_told(changed("- m*g*y\"", "- sqrt(y - 1)*v_x\""), {"bad.toml:2:37", "square root", "-1"});
  expect_told(changed("- m*g*y\"", "- sqrt(y)^3\""), {"bad.toml:2", "derivative"});
  expect_told(changed("- m*g*y\"", "- m/(g - 9.81)*y\""), {"bad.toml:2", "division by zero"});
  expect_told(changed("x = 1\n", "x = \"1/(m - 2)\"\n"), {"bad.toml:15:1", "'x'", "finite"});
  expect_told(changed("x^2 + y^2 - 1 = 0", "x^2 + y^2/y - 1 = 0"), {"bad.toml:13", "the rows"});
}

TEST(BadFiles, SizesHaveLimits) {
  expect_told(good, {"N = 1001", "in [1, 1000]"}, {{"N", 1001}});
  expect_told(good, {"N = 2.5", "whole number"}, {{"N", 2.5}});
  expect_told(good, {"no parameter 'n'", "N", "m"}, {{"n", 3}});
  expect_told(good, {"m = 0", "above 0"}, {{"m", 0.0}});
  const std::string chain = changed("x = { unit", "x = { for = \"i = 1..3000*N\", unit");
  expect_told(chain + "[definitions]\n", {"'v_x' is repeated"});
  std::string large = chain;
  for (const char* from : {"m*(v_x^2 + v_y^2)/2 - m*g*y", "x^2 + y^2 - 1 = 0", "x = 1\n"}) {
    const std::string to = std::string(from)[0] == 'm' ? "v_y^2" : std::string(from)[1] == '^' ? "y = 0" : "";
    large.replace(large.find(from), std::string(from).size(), to);
  }
  EXPECT_EQ(message_of(large), "");
  expect_told(large, {"2000000 coordinates, the limit"}, {{"N", 1000}});
}

TEST(BadFiles, DeepAndLongFormulasAreRefused) {
  expect_told(changed("m*g*y", std::string(5000, '(') + "y" + std::string(5000, ')')),
              {"nested deeper than 150"});
  expect_told(changed("m*g*y", std::string(5000, '-') + "y"), {"nested deeper than 150"});
  std::string sum = "y";
  while (sum.size() < 200'000) sum += " + y";
  expect_told(changed("m*g*y", sum), {"the limit is 100000"});
  std::string text = changed("m*g*y", "d0");
  text += "[definitions]\n";
  for (int i = 0; i < 30; ++i)
    text +=
        "d" + std::to_string(i) + " = \"d" + std::to_string(i + 1) + " + d" + std::to_string(i + 1) + "\"\n";
  EXPECT_EQ(message_of(text + "d30 = \"y\"\n"), "");  // each definition is read once
  expect_told(changed("m*g*y", "a") + "[definitions]\na = \"b\"\nb = \"a + 1\"\n", {"uses itself"});
}

TEST(BadFiles, NamesAreUniqueAndNotTaken) {
  expect_told(changed("g = 9.81", "g = 9.81\nx = 1"), {"'x' is used twice"});
  expect_told(changed("g = 9.81", "g = 9.81\nsin = 1"), {"'sin' is taken"});
  expect_told(changed("g = 9.81", "g = 9.81\nv_x = 1"), {"v_x"});
  expect_told(changed("g = 9.81", "g = 9.81\n\"a-b\" = 1"), {"'a-b' is no name"});
}

TEST(BadFiles, IndicesStayInRange) {
  std::string text = changed("y = { unit", "z = { for = \"i = 1..N\" }\ny = { unit");
  text.replace(text.find("m*g*y"), 5, "sum(i = 1..N, z[i+1]^2)");
  expect_told(text, {"bad.toml:2:", "there is no z_4", "i = 3"});
  expect_told(changed("m*g*y", "exp(sum(i = 1..N, x))"), {"bad.toml:2:", "a sum may be added"});
  expect_told(changed("m*g*y", "sum(i = 1..x, y)"), {"bad.toml:2:", "numbers, sizes and loop variables"});
}

TEST(BadFiles, StartsOffTheRowsAreMovedThereWhereTheFileAsks) {
  const CatalogueScene moved =
      scene_from_text("bad.toml", changed("x = 1\n", "x = 1.5\nproject = true\n"), {});
  EXPECT_NO_THROW(require_consistent(*moved.scene, moved.scene->start));
  EXPECT_EQ(message_of(changed("x = 1\n", "x = 1\nproject = true\n")), "");
  const CatalogueScene given = scene_from_text("bad.toml", changed("x = 1\n", "x = 1.5\n"), {});
  EXPECT_THROW(require_consistent(*given.scene, given.scene->start), Misuse);
}

TEST(BadFiles, ReferencesAndForcesNameCoordinates) {
  expect_told(good + "[force]\nxx = 1\n", {"bad.toml:20:1", "no coordinate 'xx'", "'x'"});
  expect_told(good + "[[reference]]\nkind = \"exact\"\ndigits = 3\nxx = 1\n", {"bad.toml:22:1", "'xx'"});
  expect_told(good + "[[reference]]\nkind = \"guess\"\ndigits = 3\nx = 1\n",
              {"bad.toml:20:8", "\"published\""});
  expect_told(good + "[[reference]]\nkind = \"own\"\ndigits = 3\nt = 1\nx = [1, 2]\n",
              {"one value, not an array"});
  expect_told(good + "[[reference]]\nkind = \"own\"\ndigits = 3\nt = 1\nx = 1\nwith = { q = 1 }\n", {"'q'"});
}

TEST(BadFiles, UnreadableFiles) {
  EXPECT_THROW((void)scene_from_file("/nonexistent/scene.toml"), Misuse);
  expect_told("", {"name"});
  expect_told(std::string("name = \"\0\"", 10), {"bad.toml"});
}

}  // namespace
}  // namespace diracstep
