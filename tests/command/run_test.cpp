#include <cmath>
#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>
#include <regex>

#include "run_command.hpp"

namespace diracstep::testing {
namespace {

using Json = nlohmann::json;

class RunCommand : public Command {};

TEST_F(RunCommand, WritesTheTrajectoryAsCsv) {
  const Outcome outcome = run("run knife_edge --step 0.1 --end 1 --out " + path("k.csv"));
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_EQ(outcome.out, run("run knife_edge --step 0.1 --end 1").out);
  const auto all = lines(contents(path("k.csv")));
  ASSERT_EQ(all.size(), 12u);
  EXPECT_EQ(all[0], "t,x,y,ph,v_x,v_y,v_ph,p_x,p_y,p_ph,lambda_blade,energy");
  for (const auto& line : all) EXPECT_EQ(fields(line).size(), 12u) << line;
  EXPECT_EQ(fields(all[1])[0], "0");
  EXPECT_DOUBLE_EQ(std::stod(fields(all[11])[0]), 1.0);
}

TEST_F(RunCommand, ADashStandsForStandardOutput) {
  ASSERT_EQ(run("run knife_edge --step 0.1 --end 1 --out " + path("k.csv")).status, 0);
  const Outcome outcome = run("run knife_edge --step 0.1 --end 1 --out -");
  EXPECT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_EQ(outcome.out, contents(path("k.csv")));
  EXPECT_NE(outcome.err.find("largest residual of the constraint rows"), std::string::npos) << outcome.err;
  std::ofstream(path("all")) << "kept\n";
  run("run knife_edge --step 0.1 --end 1 --out - >>" + path("all"));
  EXPECT_EQ(contents(path("all")), "kept\n" + outcome.out);
  EXPECT_EQ(run("run knife_edge --step 0.1 --end 1 --out - >/dev/full").status, 1);
  expect_misuse("run knife_edge --out - --json", {"--out -", "--json"});
  expect_misuse("run knife_edge --out - --checkpoint " + path("c"), {"--out -", "--checkpoint"});
}

TEST_F(RunCommand, OfALargeSceneTheFirstCoordinatesAndTheLastAreShown) {
  const std::string chain = "run hanging_chain --method type1/midpoint --end 0.01";
  const Outcome outcome = run(chain);
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  for (const char* part : {"\nx_4 ", "\ny_64 ", "119 of 128 coordinates left out",
                           "force of row link_8:", "55 of 64 rows left out", "force of row link_64:"})
    EXPECT_NE(outcome.out.find(part), std::string::npos) << part << " is missing in\n" << outcome.out;
  EXPECT_LT(lines(outcome.out).size(), 40u);
  EXPECT_EQ(Json::parse(run(chain + " --json").out)["end"]["q"].size(), 128u);
  EXPECT_EQ(run("run hanging_chain --set N=12 --end 0.01").out.find("left out"), std::string::npos);
}

TEST_F(RunCommand, NumbersInTheCsvReadBackExactly) {
  const Outcome outcome = run("run knife_edge --step 0.1 --end 1 --json --out " + path("k.csv"));
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  const Json end = Json::parse(outcome.out)["end"];
  const auto last = fields(lines(contents(path("k.csv"))).back());
  EXPECT_EQ(std::strtod(last[1].c_str(), nullptr), end["q"]["x"].get<double>());
  EXPECT_EQ(std::strtod(last[8].c_str(), nullptr), end["p"]["y"].get<double>());
  EXPECT_EQ(std::strtod(last[10].c_str(), nullptr), end["lambda"]["blade"].get<double>());
}

TEST_F(RunCommand, ADegenerateCircuitHasAColumnForEachRowOfItsOwn) {
  ASSERT_EQ(run("run lc_circuit --step 0.1 --end 1 --out " + path("c.csv")).status, 0);
  const auto all = lines(contents(path("c.csv")));
  EXPECT_EQ(
      all.front(),
      "t,qL,qC1,qC2,qC3,v_qL,v_qC1,v_qC2,v_qC3,p_qL,p_qC1,p_qC2,p_qC3,lambda_node_a,lambda_node_b,energy");
  for (const std::string& line : all) EXPECT_EQ(fields(line).size(), 16U) << line;
  EXPECT_EQ(fields(all[1]).back(), "0.625");
}

TEST_F(RunCommand, KeepsEachKthPointAndTheLast) {
  ASSERT_EQ(run("run knife_edge --step 0.1 --end 1 --every 4 --out " + path("k.csv")).status, 0);
  std::vector<double> times;
  for (const auto& line : lines(contents(path("k.csv"))))
    if (line[0] != 't') times.push_back(std::stod(fields(line)[0]));
  ASSERT_EQ(times.size(), 4u);
  EXPECT_NEAR(times[1], 0.4, 1e-15);
  EXPECT_NEAR(times[2], 0.8, 1e-15);
  EXPECT_NEAR(times[3], 1.0, 1e-15);
}

TEST_F(RunCommand, SummaryHasErrorsWorkAndConstraint) {
  const Outcome outcome = run("run pendulum_cartesian --end 1");
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  for (const char* word :
       {"50 steps of 0.02", "error against the exact reference", "Newton iterations", "constraint rows"})
    EXPECT_NE(outcome.out.find(word), std::string::npos) << word << '\n' << outcome.out;
}

TEST_F(RunCommand, JsonIsOneDocumentWithEverything) {
  const Outcome outcome = run("run knife_edge --step 0.3 --end 1 --order 4 --json");
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_NE(outcome.err.find("adjusted"), std::string::npos) << outcome.err;
  const Json json = Json::parse(outcome.out);
  EXPECT_EQ(json["status"], "ok");
  EXPECT_EQ(json["order"], 4);
  EXPECT_EQ(json["momentum"], "projected");
  EXPECT_EQ(json["steps"], 4);
  EXPECT_LT(json["error_q"].get<double>(), 1e-3);
  EXPECT_LT(json["constraint"].get<double>(), 1e-14);
}

TEST_F(RunCommand, RepresentativesOfTheMomentumDifferByImpulses) {
  const auto p_x = [&](const std::string& momentum) {
    return Json::parse(
               run("run knife_edge --step 0.1 --end 1 --json --momentum " + momentum).out)["end"]["p"]["x"]
        .get<double>();
  };
  const double plus = p_x("plus"), minus = p_x("minus"), projected = p_x("projected");
  EXPECT_GT(std::abs(plus - minus), 1e-3);
  EXPECT_GT(std::abs(plus - projected), 1e-4);
}

TEST_F(RunCommand, SetChangesAParameter) {
  const Json json = Json::parse(run("run kepler_e06 --set e=0.25 --end 1 --json").out);
  EXPECT_EQ(json["parameters"]["e"], 0.25);
  EXPECT_LT(json["error_q"].get<double>(), 1e-2);  // the reference has the same eccentricity
}

/// A pendulum of the length 1e-9 beside a coordinate that moves at 1e9: without a tolerance of its own it is
/// solved to 1e-15 of the other.
TEST_F(RunCommand, AToleranceOfACoordinateIsTaken) {
  const std::string file = path("small.toml");
  std::ofstream(file) << "name = \"small\"\nlagrangian = \"v_x^2/2 + a^2*cos(x/a) + v_y^2/2\"\n"
                         "[coordinates]\nx = {}\ny = {}\n[parameters]\na = 1e-9\nu = 0\n"
                         "[start]\nx = \"a\"\nv_y = \"u\"\n[span]\nend = 10\nstep = 0.1\n";
  const auto end_of_x = [&](const std::string& options) {
    const Outcome outcome = run("run " + file + " --json --doubt ignore " + options);
    EXPECT_EQ(outcome.status, 0) << outcome.err;
    return nlohmann::json::parse(outcome.out)["end"]["q"]["x"].get<double>();
  };
  const double alone = end_of_x("");
  EXPECT_GT(std::abs(end_of_x("--set u=1e9") - alone), 1e-10);
  EXPECT_NEAR(end_of_x("--set u=1e9 --tolerance x=1e-24"), alone, 1e-18);
  EXPECT_NE(run("run " + file + " --tolerance z=1").err.find("no coordinate 'z'"), std::string::npos);
  EXPECT_EQ(run("run " + file + " --tolerance x=-1").status, 2);
}

TEST_F(RunCommand, NonConvergenceIsToldAndKeepsWhatWasComputed) {
  const Outcome outcome =
      run("run pendulum_cartesian --method type1/midpoint --step 0.2 --every 4 --out " + path("p.csv"));
  EXPECT_EQ(outcome.status, 1);
  for (const char* word : {"no convergence", "momentum residual", "constraint residual"})
    EXPECT_NE(outcome.err.find(word), std::string::npos) << word << '\n' << outcome.err;
  std::smatch told;
  ASSERT_TRUE(std::regex_search(outcome.err, told, std::regex("step ([0-9]+) from t = ([0-9.]+)")))
      << outcome.err;
  const std::size_t steps = std::stoul(told[1]);
  const auto all = lines(contents(path("p.csv")));
  EXPECT_NEAR(std::stod(fields(all.back())[0]), std::stod(told[2]), 1e-4);  // the last good point
  EXPECT_EQ(all.size(), 1 + 1 + steps / 4 + (steps % 4 == 0 ? 0 : 1));  // header, start, each fourth, last
}

TEST_F(RunCommand, FailureInJsonHasAStatusAndNoNaN) {
  const Outcome outcome = run("run pendulum_cartesian --step 2 --json");
  EXPECT_EQ(outcome.status, 1);
  const Json json = Json::parse(outcome.out);
  EXPECT_NE(json["status"].get<std::string>().find("step 0 from t = 0"), std::string::npos) << json["status"];
  EXPECT_EQ(outcome.out.find("nan"), std::string::npos);
}

TEST_F(RunCommand, InterruptKeepsWhatWasComputed) {
  const Outcome outcome =
      run("run kepler_e06 --end 1e6 --every 1000 --json --out " + path("k.csv"), "timeout -s INT 0.5");
  const Json json = Json::parse(outcome.out);
  EXPECT_NE(json["status"].get<std::string>().find("interrupted"), std::string::npos);
  EXPECT_NE(outcome.err.find("interrupted"), std::string::npos);
  const auto all = lines(contents(path("k.csv")));
  EXPECT_GT(all.size(), 2u);
  EXPECT_EQ(fields(all.back()).size(), fields(all.front()).size());
}

TEST_F(RunCommand, InterruptIsExitStatusOne) {
  EXPECT_EQ(run("run kepler_e06 --end 1e6", "timeout --preserve-status -s INT 0.5").status, 1);
}

TEST_F(RunCommand, FullDiskIsAFailure) {
  for (const char* step : {"0.25", "0.001"}) {  // met at the end, and while writing
    const Outcome outcome = run(std::string("run knife_edge --out /dev/full --step ") + step);
    EXPECT_EQ(outcome.status, 1);
    EXPECT_NE(outcome.err.find("No space left"), std::string::npos) << outcome.err;
  }
}

TEST_F(RunCommand, MisuseNamesTheValueAndWhatIsAllowed) {
  expect_misuse("run nowhere", {"nowhere", "knife_edge", "pendulum_cartesian"});
  expect_misuse("run knife_edge --method type1/none", {"type1/none", "type1/midpoint"});
  expect_misuse("run knife_edge --order 3", {"3", "2, 4, 6, 8"});
  expect_misuse("run knife_edge --step 0", {"step", "0"});
  expect_misuse("run knife_edge --step nan", {"nan"});
  expect_misuse("run knife_edge --step=-0.1", {"-0.1"});
  expect_misuse("run knife_edge --step small", {"small"});
  expect_misuse("run knife_edge --end 0", {"t = 0"});
  expect_misuse("run knife_edge --end inf", {"inf"});
  expect_misuse("run knife_edge --every 0", {"every", "0", "1 or more"});
  expect_misuse("run knife_edge --momentum half", {"half", "plus", "minus", "projected"});
  expect_misuse("run knife_edge --set m", {"'m'", "name=value"});
  expect_misuse("run knife_edge --set m=heavy", {"heavy"});
  expect_misuse("run knife_edge --set m=-1", {"m"});
  expect_misuse("run knife_edge --set mass=1", {"mass", "J", "g_sin_alpha"});
  expect_misuse("run knife_edge --out " + path("none/k.csv"), {"none/k.csv", "No such file"});
}

}  // namespace
}  // namespace diracstep::testing
