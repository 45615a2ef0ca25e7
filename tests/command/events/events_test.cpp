#include <cmath>
#include <nlohmann/json.hpp>

#include "../run_command.hpp"

/// Events of a scene, [[events]]: zero crossings of its formulas.
namespace diracstep::testing {
namespace {

using Json = nlohmann::json;

class Events : public Command {
 protected:
  std::string ball(const std::string& events) const {
    std::ofstream(path("ball.toml")) << R"(name = "ball"
lagrangian = "(v_x^2 + v_y^2)/2 - 9.81*y"
[coordinates]
x = {}
y = {}
[start]
y = 2
v_x = 1
v_y = 3
[span]
end = 3
step = 0.1
)" + events;
    return "'" + path("ball.toml") + "'";
  }
  std::string oscillator() const {
    std::ofstream(path("osc.toml")) << R"(name = "osc"
lagrangian = "(v_x^2 - x^2)/2"
[coordinates]
x = {}
[start]
x = 1
[span]
end = 20
step = 0.5
[[events]]
name = "up"
when = "x"
direction = "rising"
[[events]]
name = "turn"
when = "v_x"
direction = "falling"
)";
    return "'" + path("osc.toml") + "'";
  }
};

TEST_F(Events, AZeroAtANodeIsMetOnce) {
  std::ofstream(path("node.toml"))
      << "name = \"node\"\nlagrangian = \"v_x^2/2\"\n[coordinates]\nx = {}\n[start]\n"
         "v_x = 1\n[span]\nend = 2\nstep = 0.25\n[[events]]\nname = \"one\"\n"
         "when = \"x - 1\"\n[[events]]\nname = \"touched\"\nwhen = \"(t - 1)*(t - 1)\"\n";
  const Outcome outcome = run("run '" + path("node.toml") + "' --json");
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_EQ(outcome.out.find("\"one\""), outcome.out.rfind("\"one\"")) << outcome.out;
}

const double lands = (3.0 + std::sqrt(9.0 + 4.0 * 9.81)) / 9.81;

TEST_F(Events, StopEndsTheRunWhereTheBallLands) {
  const std::string scene =
      ball("[[events]]\nname = \"floor\"\nwhen = \"y\"\ndirection = \"falling\"\naction = \"stop\"\n");
  for (const char* steps : {"--step 0.1", "--adaptive"}) {
    const Outcome outcome = run("run " + scene + " " + steps + " --json --out '" + path("ball.csv") + "'");
    ASSERT_EQ(outcome.status, 0) << outcome.err;
    const Json json = Json::parse(outcome.out);
    EXPECT_TRUE(json["stopped"].get<bool>());
    ASSERT_EQ(json["events"].size(), 1U);
    EXPECT_NEAR(json["events"][0]["t"].get<double>(), lands, 1e-13);
    EXPECT_NEAR(json["end"]["t"].get<double>(), lands, 1e-13);
    EXPECT_NEAR(json["end"]["q"]["x"].get<double>(), lands, 1e-13);
    EXPECT_EQ(std::stod(fields(lines(contents(path("ball.csv"))).back())[0]), json["end"]["t"].get<double>());
  }
}

TEST_F(Events, AreFoundAtTheOrderOfTheMethodAndTheMotionKeepsItsBits) {
  for (const auto& [method, order] :
       {std::pair{"type1/gl:1", 2.0}, {"type1/gl:2", 4.0}, {"type1/gl:3", 6.0}}) {
    const auto error = [&, name = std::string(method)](const char* step) {
      const Json json =
          Json::parse(run("run " + oscillator() + " --method " + name + " --step " + step + " --json").out);
      EXPECT_EQ(json["events"].size(), 6U);
      double largest = 0.0;
      for (const Json& event : json["events"]) {
        const double t = event["t"];
        const double from = event["name"] == "up" ? 1.5 * M_PI : 2.0 * M_PI;  // later by whole turns
        largest = std::max(largest, std::abs(std::remainder(t - from, 2.0 * M_PI)));
      }
      return largest;
    };
    EXPECT_NEAR(std::log2(error("0.5") / error("0.25")), order, 0.3) << method;
  }
  const std::string with = oscillator();
  const std::string nodes = run("run " + with + " --out -").out;
  std::string text = contents(path("osc.toml"));
  std::ofstream(path("osc.toml")) << text.substr(0, text.find("[[events]]"));
  EXPECT_EQ(run("run '" + path("osc.toml") + "' --out -").out, nodes);
}

TEST_F(Events, WhatVanishesAtTheStartIsMetLater) {
  const Outcome outcome = run("run " + ball("[[events]]\nname = \"back\"\nwhen = \"y - 2\"\n") + " --json");
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  const Json events = Json::parse(outcome.out)["events"];
  ASSERT_EQ(events.size(), 1U);
  EXPECT_NEAR(events[0]["t"].get<double>(), 6.0 / 9.81, 1e-13);
}

TEST_F(Events, TheFirstOfTwoInAStepStops) {
  const std::string scene = ball(
      "[[events]]\nname = \"late\"\nwhen = \"t - 0.56\"\naction = \"stop\"\n"
      "[[events]]\nname = \"early\"\nwhen = \"0.53 - t\"\naction = \"stop\"\n");
  const Json json = Json::parse(run("run " + scene + " --json").out);
  ASSERT_EQ(json["events"].size(), 1U);
  EXPECT_EQ(json["events"][0]["name"], "early");
  EXPECT_NE(run("run " + scene).out.find("event early: t = 0.53"), std::string::npos);
}

TEST_F(Events, BadOnesAreToldWithTheirPlace) {
  expect_misuse("run " + ball("[[events]]\nname = \"a\"\nwhen = \"z\"\n"), {"ball.toml:15:9", "'z'"});
  expect_misuse("run " + ball("[[events]]\nname = \"a\"\n"), {"ball.toml:13", "'when'"});
  expect_misuse("run " + ball("[[events]]\nname = \"a\"\nwhen = \"y\"\naction = \"jump\"\n"),
                {"ball.toml:16", "stop"});
  expect_misuse("run " + ball("[[events]]\nname = \"a\"\nwhen = \"y\"\ndirection = \"up\"\n"),
                {"ball.toml:16", "rising"});
  const std::string one = ball("[[events]]\nname = \"a\"\nwhen = \"y\"\n");
  expect_misuse("run " + one + " --error 1e-6 --adaptive", {"--error", "events"});
}

}  // namespace
}  // namespace diracstep::testing
