#include <cmath>
#include <nlohmann/json.hpp>

#include "run_command.hpp"

namespace diracstep::testing {
namespace {

using Json = nlohmann::json;

class AdaptiveCommand : public Command {};

TEST_F(AdaptiveCommand, RunsAnEccentricOrbitInFewSteps) {
  for (const char* control : {"integrating", "in-step"}) {
    const Outcome outcome =
        run(std::string("run kepler_e099 --method type1/gl:4 --adaptive --json --control ") + control);
    ASSERT_EQ(outcome.status, 0) << outcome.err;
    const Json json = Json::parse(outcome.out);
    EXPECT_LT(json["error_q"].get<double>(), 1e-6);
    EXPECT_LT(json["steps"].get<long>(), 1000);  // the natural fixed step takes 20000
    EXPECT_TRUE(json["step"].is_null());
    EXPECT_EQ(json["adaptive"]["control"], control);
    EXPECT_EQ(json["adaptive"]["resets"], 0);
    EXPECT_GT(json["adaptive"]["rate_ratio"].get<double>(), 100.0);
    EXPECT_EQ(json["end"]["t"], 20.0);
  }
}

TEST_F(AdaptiveCommand, ShowsTheMotionAtGivenTimes) {
  const Outcome outcome =
      run("run pendulum_cartesian --method type1/gl:3 --adaptive --at 0.5,1,1.25 --out " + path("p.csv"));
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  std::vector<double> times;
  for (const auto& line : lines(contents(path("p.csv"))))
    if (line[0] != 't') times.push_back(std::stod(fields(line)[0]));
  EXPECT_EQ(times, (std::vector<double>{0.5, 1.0, 1.25}));
}

TEST_F(AdaptiveCommand, AnEndBesideGivenTimesIsTheEnd) {
  expect_misuse("run kepler_e06 --adaptive --at 0.2 --end 0.1", {"--at", "t = 0.2", "t = 0.1, the end"});
  const Outcome outcome =
      run("run kepler_e06 --adaptive --at 0.1,0.2 --end 0.3 --json --out " + path("k.csv"));
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_EQ(Json::parse(outcome.out)["end"]["t"], 0.3);
  EXPECT_EQ(lines(contents(path("k.csv"))).size(), 3U);
}

TEST_F(AdaptiveCommand, DeliversTheErrorAskedForAndReportsTheSearch) {
  const Outcome outcome = run("run pendulum_cartesian --error 1e-6 --json --out " + path("p.csv"));
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  const Json json = Json::parse(outcome.out);
  EXPECT_LT(json["error_q"].get<double>(), 1e-6);
  EXPECT_LT(json["error_p"].get<double>(), 1e-6);
  const Json& search = json["error_control"];
  EXPECT_LT(search["estimate"].get<double>(), 1e-6);
  EXPECT_GT(search["estimate"].get<double>(), 0.1 * json["error_p"].get<double>());
  EXPECT_GE(search["runs"].size(), 3u);
  EXPECT_GT(search["solves"].get<long>(), 0);
  EXPECT_TRUE(search["refusal"].is_null());
  EXPECT_GT(lines(contents(path("p.csv"))).size(), 10u);
}

TEST_F(AdaptiveCommand, RefusesAnErrorOutOfReachAndSaysWhy) {
  const Outcome outcome = run("run knife_edge --error 1e-18 --json");
  EXPECT_EQ(outcome.status, 1);
  EXPECT_NE(outcome.err.find("round-off"), std::string::npos) << outcome.err;
  EXPECT_NE(Json::parse(outcome.out)["status"].get<std::string>().find("1e-18"), std::string::npos);
}

TEST_F(AdaptiveCommand, StudyShowsVariableStepsBesideFixedOnes) {
  const Outcome outcome =
      run("study kepler_e06 --methods type1/gl:3 --adaptive --without-ida --end 10 --budget 0.02 --json");
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  const Json study = Json::parse(outcome.out)["studies"][0];
  for (const Json& measured : study["measured_order"])
    EXPECT_NEAR(measured["slope"].get<double>(), 6.0, 0.5) << measured;
  EXPECT_EQ(study["measured_order"].size(), 2u);
  EXPECT_EQ(study["measured_order"][1]["method"], "type1/gl:3 adaptive");
}

TEST_F(AdaptiveCommand, PlanSaysWhetherVariableStepsPay) {
  EXPECT_NE(run("plan kepler_e099").out.find("save time: --adaptive"), std::string::npos);
  const Outcome adaptive = run("plan kepler_e099 --adaptive --eps 0.1");
  for (const char* part : {"integrating controller", "eps = 0.1", "monitor", "ω0 = "})
    EXPECT_NE(adaptive.out.find(part), std::string::npos) << part << '\n' << adaptive.out;
  const Outcome steady = run("plan contact_oscillator");
  EXPECT_NE(steady.out.find("they save time above 5"), std::string::npos) << steady.out;
  EXPECT_NE(run("plan lotka_volterra_2d").out.find("not offered"), std::string::npos);
}

TEST_F(AdaptiveCommand, MisuseNamesTheValueAndWhatIsAllowed) {
  expect_misuse("run knife_edge --error 0", {"error = 0", "between 0 and 1"});
  expect_misuse("run knife_edge --adaptive --eps=-1", {"eps = -1", "above 0"});
  expect_misuse("run knife_edge --adaptive=1e-4", {"--adaptive takes no value", "--eps"});
  expect_misuse("run knife_edge --adaptive --control fast",
                {"fast", "integrating", "in-step", "irreversible"});
  expect_misuse("run knife_edge --at 11 --error 1e-4", {"--at", "t = 11", "t = 10, the end", "--end"});
  expect_misuse("run knife_edge --adaptive --at 2,1", {"t = 1", "ahead"});
  expect_misuse("run kepler_e06 --method type1/left --adaptive", {"type1/left", "not self-adjoint"});
  expect_misuse("run lotka_volterra_2d --adaptive", {"lotka_volterra_2d", "linear in v"});
}

}  // namespace
}  // namespace diracstep::testing
