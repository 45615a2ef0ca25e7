#include <gtest/gtest.h>

#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/scene_format/scene_file.hpp>

/// Bad inputs, states, events and outputs, each told with the line and the column where it stands.
namespace diracstep {
namespace {

/// Seven lines of a scene that moves along x until t = 2.
const std::string moves_along_x =
    "name = \"a\"\nlagrangian = \"v_x^2/2\"\n[coordinates]\nx = {}\n[span]\nend = 2\nstep = 0.1\n";

struct Bad {
  const char* rest;   ///< from line 8 on
  const char* place;  ///< line and column
  const char* told;
};

std::string told_of(const std::string& text) {
  try {
    static_cast<void>(scene_from_text("scene.toml", text));
  } catch (const Misuse& misuse) {
    return misuse.what();
  }
  return {};
}

void expect_told(const std::vector<Bad>& all) {
  ASSERT_EQ(told_of(moves_along_x), "");
  for (const Bad& bad : all) {
    const std::string told = told_of(moves_along_x + bad.rest);
    EXPECT_EQ(told.find(std::string("scene.toml:") + bad.place + ": "), 0U) << bad.rest << told;
    EXPECT_NE(told.find(bad.told), std::string::npos) << bad.rest << told;
  }
}

TEST(BadActingScenes, Inputs) {
  expect_told({
      {"[inputs]\nw = { times = [0, 2, 1], values = [0, 1, 2] }\n", "9:22", "1 does not lie behind 2"},
      {"[inputs]\nw = { times = [0, 1, 1], values = [0, 1, 2] }\n", "9:22", "1 does not lie behind 1"},
      {"[inputs]\nw = { times = [0, 1], values = [0, 1] }\n[force]\nx = \"w\"\n", "9:1",
       "at t = 2; add points"},
      {"[inputs]\nw = { times = [1, 3], values = [0, 1] }\n[force]\nx = \"w\"\n", "9:1",
       "at t = 0; add points"},
      {"[inputs]\nw = { times = [0, 1, 3], values = [0, 1] }\n", "9:1", "3 times and 2 values"},
      {"[inputs]\nw = { times = [0], values = [0] }\n", "9:1", "from 2 to 1000"},
      {"[inputs]\nw = { times = [0, 3], values = [0, 1], kind = \"spline\" }\n", "9:47", "\"cubic\""},
      {"[inputs]\nw = { times = [0, 3], values = [0, \"1\"] }\n", "9:36", "finite number"},
      {"[inputs]\nw = { times = [0, 3], values = [0, nan] }\n", "9:36", "finite number"},
      {"[inputs]\nw = { times = [0, inf], values = [0, 1] }\n", "9:19", "finite number"},
      {"[inputs]\nw = { times = [0, 3], values = [0, 1], holds = true }\n", "9:40", "did you mean 'hold'"},
      {"[inputs]\nx = { times = [0, 3], values = [0, 1] }\n", "9:1", "used twice"},
      {"[inputs]\nw = 3\n", "9:5", "expected a table"},
      {"[inputs]\nw = { times = [0, 3], values = [0, 1] }\n[force]\nx = \"w(x, 1)\"\n", "11:9",
       "expected ')'"},
      {"[force]\nx = \"if(x, 1, 2)\"\n", "9:10", "comparison"},
  });
}

TEST(BadActingScenes, StatesThatFeedOnThemselves) {
  expect_told({
      {"[states]\na = { rate = \"v_a\" }\n", "9:15", "write that rate out"},
      {"[states]\na = { rate = \"1 + v_a/2\" }\n", "9:15", "write that rate out"},
      {"[states]\na = { rate = \"v_b\" }\nb = { rate = \"v_a\" }\n", "9:15", "v_b, the rate of a state"},
      {"[states]\na = { rate = \"v_x^2\" }\n", "9:15", "not linear in v_x"},
      {"[states]\na = { rate = \"q\" }\n", "9:15", "unknown name 'q'"},
      {"[states]\nx = { rate = \"1\" }\n", "9:1", "used twice"},
      {"[states]\na = { rate = \"1\" }\n[start]\na = 2\n", "11:1", "its start stands in [states]"},
      {"[definitions]\na = \"b\"\nb = \"a\"\n[force]\nx = \"a\"\n", "10:6", "uses itself"},
      {"[outputs]\na = \"a\"\n", "9:6", "unknown name 'a'"},
  });
}

TEST(BadActingScenes, Events) {
  const std::string row = "[[rows]]\nname = \"r\"\nequation = \"v_x = 0\"\n";
  const std::string twice = row + "[[events]]\nname = \"e\"\nwhen = \"x - 1\"\non = \"r\"\noff = \"r\"\n";
  expect_told({
      {"[start]\nx = -1\n[[events]]\nname = \"e\"\nwhen = \"x\"\nrestitution = 0.5\n", "12:9",
       "is -1 at the start, behind the contact"},
      {"[start]\nx = -1\n[[events]]\nname = \"e\"\nwhen = \"sqrt(x)\"\n", "12:9",
       "not a number at the start"},
      {"[[events]]\nname = \"e\"\nwhen = \"1\"\n", "10:9", "never happens"},
      {"[[events]]\nname = \"e\"\nwhen = \"0*x\"\n", "10:9", "never happens"},
      {"[[events]]\nname = \"e\"\nwhen = \"y - 1\"\n", "10:9", "unknown name 'y'"},
      {"[[events]]\nname = \"e\"\n", "8:1", "one of 'when'"},
      {"[[events]]\nname = \"e\"\nwhen = \"x -* 1\"\n", "10:12", "found '*'"},
      {"[[events]]\nname = \"e\"\nwhen = \"x > 1\"\n", "10:11", "found '>'"},
      {"[[events]]\nname = \"e\"\nevery = -1\n", "10:9", "above 0"},
      {"[[events]]\nname = \"e\"\nwhen = \"x - 1\"\ndirection = \"up\"\n", "11:13", "\"rising\""},
      {"[[events]]\nname = \"e\"\nwhen = \"v_x - 1\"\nrestitution = 1\n", "10:9", "without velocities"},
      {"[[events]]\nname = \"e\"\nwhen = \"x - 1\"\nif = \"x > \"\n", "11:11", "expected a number"},
      {"[[events]]\nname = \"e\"\nwhen = \"x - 1\"\non = 3\n", "11:6", "names of rows"},
      {"[states]\ns = { rate = \"1\" }\n[[events]]\nname = \"e\"\nwhen = \"x - 1\"\nset = { v_s = \"1\" }\n",
       "13:9", "rate of a state"},
      {twice.c_str(), "15:7", "on and off by the same event"},
  });
}

}  // namespace
}  // namespace diracstep
