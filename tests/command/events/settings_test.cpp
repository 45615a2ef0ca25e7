#include <nlohmann/json.hpp>

#include "../run_command.hpp"

/// Events on what other events set.
namespace diracstep::testing {
namespace {

using Json = nlohmann::json;

class SettingEvents : public Command {};

const std::string passing = R"toml(
lagrangian = "(v_x^2 + v_y^2)/2"
[coordinates]
x = {}
y = {}
[states]
gear = {}
shifts = {}
lamp = {}
[start]
v_x = 1
y = 1
[span]
end = 3
step = 0.07
)toml";

std::string event(const std::string& name, const std::string& rest) {
  return "[[events]]\nname = \"" + name + "\"\n" + rest + "\n";
}

/// At x = 1 the gear goes from 0 to 2, over the 1 of the second event, which lights the lamp of the third; at
/// x = 2 it goes back.
TEST_F(SettingEvents, HappenWhereAnotherEventSetsAcrossTheirZero) {
  const std::string file =
      scene("gears", passing + event("up", "when = \"x - 1\"\nset = { gear = \"2\" }") +
                         event("down", "when = \"x - 2\"\nset = { gear = \"0\" }") +
                         event("shift", "when = \"gear - 1\"\nset = { shifts = \"shifts + 1\" }") +
                         event("first",
                               "when = \"gear - 1\"\ndirection = \"rising\"\nif = \"t < 1.5\"\n"
                               "set = { lamp = \"lamp + 1\" }") +
                         event("lit", "when = \"lamp - 0.5\"") +
                         event("never", "when = \"lamp - 0.5\"\ndirection = \"falling\""));
  const Outcome outcome = run("run " + file + " --json");
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  const Json json = Json::parse(outcome.out);
  EXPECT_EQ(json["end"]["q"]["shifts"], 2.0);
  EXPECT_EQ(json["end"]["q"]["lamp"], 1.0);
  std::vector<std::string> names;
  for (const Json& met : json["events"]) names.push_back(met["name"]);
  EXPECT_EQ(names, (std::vector<std::string>{"up", "shift", "first", "lit", "down", "shift"}));
  EXPECT_NEAR(json["events"][3]["t"].get<double>(), 1.0, 1e-12);
}

TEST_F(SettingEvents, EndTheRunWhereOneThatStopsIsSetOff) {
  const std::string file = scene("stop", passing + event("up", "when = \"x - 1\"\nset = { gear = \"2\" }") +
                                             event("end", "when = \"gear - 1\"\naction = \"stop\""));
  const Outcome outcome = run("run " + file + " --json");
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_NEAR(Json::parse(outcome.out)["end"]["t"].get<double>(), 1.0, 1e-12);
}

TEST_F(SettingEvents, BehindAContactAreTold) {
  const std::string file = scene("floor", passing + event("drop", "when = \"x - 1\"\nset = { y = \"-1\" }") +
                                              event("floor", "when = \"y\"\nrestitution = 1"));
  const Outcome outcome = run("run " + file);
  EXPECT_EQ(outcome.status, 1) << outcome.out;
  EXPECT_NE(outcome.err.find("'floor': its function was set to -1 at t = 1, behind the contact"),
            std::string::npos)
      << outcome.err;
}

/// Two that set each other off are told, as no time passes.
TEST_F(SettingEvents, ThatCallEachOtherAreTold) {
  const std::string file =
      scene("loop", passing + event("up", "when = \"x - 1\"\nset = { gear = \"2\" }") +
                        event("on", "when = \"gear - 1\"\ndirection = \"rising\"\nset = { gear = \"0\" }") +
                        event("off", "when = \"gear - 1\"\ndirection = \"falling\"\nset = { gear = \"2\" }"));
  const Outcome outcome = run("run " + file);
  EXPECT_EQ(outcome.status, 1) << outcome.out;
  EXPECT_NE(outcome.err.find("no time passes"), std::string::npos) << outcome.err;
}

/// mod(x, 0.01) jumps back between its rising zeros, several of them in a step: x = t²/2 up to the switch at
/// t = 0.3, then 0.045 + 0.3 (t - 0.3).
TEST_F(SettingEvents, AFunctionThatJumpsBackIsMetOnceForEachZero) {
  const std::string file = path("marks.toml");
  std::ofstream(file)
      << "name = \"marks\"\nlagrangian = \"v_x^2/2\"\n[coordinates]\nx = {}\n[states]\nu = {}\nn = {}\n"
         "[force]\nx = \"u\"\n[[events]]\nname = \"clock\"\nevery = 0.3\nset = { u = \"1 - u\" }\n"
         "[[events]]\nname = \"mark\"\nwhen = \"mod(x, 0.01) - 0.0051\"\ndirection = \"rising\"\n"
         "set = { n = \"n + 1\" }\n[span]\nend = 0.55\nstep = 0.0625\n";
  for (const char* step : {"--step 0.0625", "--step 0.01"}) {
    const Outcome outcome = run("run '" + file + "' --json " + step);
    ASSERT_EQ(outcome.status, 0) << outcome.err;
    const auto json = nlohmann::json::parse(outcome.out);
    EXPECT_EQ(json["end"]["q"]["n"].get<double>(), 12.0) << step;  // x = 0.12
  }
}

}  // namespace
}  // namespace diracstep::testing
