#include <nlohmann/json.hpp>

#include "run_command.hpp"

namespace diracstep::testing {
namespace {

using Json = nlohmann::json;

class StabilityCommand : public Command {
 protected:
  void write(const std::string& name, const std::string& text) const { std::ofstream(path(name)) << text; }

  const std::string marks = "<!-- tables of diracstep stability -->\nold\n<!-- end of the tables -->\n";
};

TEST_F(StabilityCommand, JsonHasEveryCaseMethodAndNumber) {
  const Outcome outcome = run("stability kepler_e099 --methods type1/midpoint,type1/gl:4 --json");
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  const Json json = Json::parse(outcome.out);
  ASSERT_EQ(json["linear"].size(), 2u);
  EXPECT_EQ(json["linear"][1]["order"], 8);
  EXPECT_EQ(json["linear"][0]["oscillator_limit"], 1e6);
  EXPECT_EQ(json["linear"][0]["growth"].size(), 161u);
  ASSERT_FALSE(json["cases"].empty());
  for (const Json& that : json["cases"]) {
    EXPECT_EQ(that["scene"], "kepler_e099");
    EXPECT_TRUE(that["reference"].is_string());
    ASSERT_EQ(that["rows"].size(), 2u);
    EXPECT_FALSE(that["ida"].empty());
    for (const Json& row : that["rows"]) {
      for (const char* key : {"outcome", "message", "steps", "t_reached", "watches", "constraint", "error",
                              "failed_solves", "newton_iterations", "cpu_seconds", "ida"})
        EXPECT_TRUE(row.contains(key)) << key;
      EXPECT_EQ(row["watches"][0]["name"], "energy");
      EXPECT_GT(row["cpu_seconds"].get<double>(), 0.0);
    }
  }
}

TEST_F(StabilityCommand, ASceneWithParametersIsOneCase) {
  const Outcome outcome =
      run("stability stiff_spring_pendulum --set k=1e6 --methods type1/midpoint --orders 2,4 --without-ida "
          "--json");
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  const Json json = Json::parse(outcome.out);
  ASSERT_EQ(json["cases"].size(), 1u);
  EXPECT_EQ(json["cases"][0]["parameters"]["k"], 1e6);
  ASSERT_EQ(json["cases"][0]["rows"].size(), 2u);
  EXPECT_TRUE(json["cases"][0]["rows"][0]["ida"].is_null());
}

TEST_F(StabilityCommand, ReplacesTheTablesBetweenTheMarks) {
  write("page.md", "before\n" + marks + "after\n");
  const std::string arguments =
      "stability fput --set om=50 --methods type1/gl:3 --without-ida --write \"" + path("page.md") + "\"";
  ASSERT_EQ(run(arguments).status, 0);
  const std::string once = contents(path("page.md"));
  EXPECT_EQ(once.rfind("before\n<!-- tables of diracstep stability -->\n", 0), 0u);
  EXPECT_EQ(once.find("\nold\n"), std::string::npos);
  EXPECT_NE(once.find("| type1/gl:3 | 6 | none |"), std::string::npos);
  EXPECT_NE(once.find("<!-- end of the tables -->\nafter\n"), std::string::npos);
}

TEST_F(StabilityCommand, WritesADirectory) {
  const Outcome outcome =
      run("stability stiff_spring_pendulum --methods type1/gl:3,type1/trapezoidal --without-ida --out \"" +
          path("a b") + '"');
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_EQ(Json::parse(contents(path("a b/stability.json")))["linear"].size(), 2u);
  EXPECT_NE(contents(path("a b/stability.md")).find("### Outcomes"), std::string::npos);
  if (outcome.err.find("gnuplot was not found") != std::string::npos) GTEST_SKIP() << "no gnuplot here";
  EXPECT_EQ(outcome.err, "");
  for (const char* picture : {"growth_oscillator", "growth_damping", "stiff_spring_pendulum__k"})
    EXPECT_NE(contents(path("a b/" + std::string(picture) + ".svg")).find("<svg"), std::string::npos)
        << picture;
}

TEST_F(StabilityCommand, Misuse) {
  write("unmarked.md", "no marks\n");
  expect_misuse("stability no_such_scene", {"no_such_scene"});
  expect_misuse("stability --methods type1/none", {"type1/none", "type1/midpoint"});
  expect_misuse("stability --methods type1/gl:2 --orders 6", {"--orders", "6"});
  expect_misuse("stability --set k=1", {"--set"});
  expect_misuse("stability --write \"" + path("unmarked.md") + '"', {"--write", "unmarked.md"});
  expect_misuse("stability --out /dev/null/x", {"--out", "/dev/null/x"});
}

TEST_F(StabilityCommand, RunSaysWhenTheEnergyIsLost) {
  const Outcome lost =
      run("run stiff_spring_pendulum --set k=1e6 --method type1/trapezoidal --end 0.06 --json");
  ASSERT_EQ(lost.status, 3) << lost.err;
  EXPECT_NE(lost.err.find("the energy, which this scene keeps"), std::string::npos) << lost.err;
  EXPECT_TRUE(Json::parse(lost.out)["doubt"].is_string());
  const Outcome kept = run("run stiff_spring_pendulum --set k=1e6 --method type1/gl:3 --json");
  EXPECT_EQ(kept.err, "");
  EXPECT_TRUE(Json::parse(kept.out)["doubt"].is_null());
}

}  // namespace
}  // namespace diracstep::testing
