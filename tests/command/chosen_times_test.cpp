#include <cmath>
#include <map>
#include <nlohmann/json.hpp>

#include "run_command.hpp"

/// run --at and --every-time with steps of one size, and the columns of [outputs].
namespace diracstep::testing {
namespace {

using Json = nlohmann::json;

/// Lines of a CSV file by their first field.
std::map<std::string, std::string> by_time(const std::string& text) {
  std::map<std::string, std::string> all;
  for (const std::string& line : lines(text)) all[fields(line)[0]] = line;
  return all;
}

class ChosenTimes : public Command {
 protected:
  std::string oscillator(const std::string& outputs = "") const {
    std::ofstream(path("osc.toml")) << R"(name = "osc"
lagrangian = "(v_x^2 - k*x^2)/2"
[coordinates]
x = {}
[parameters]
k = 1
[definitions]
spring = "k*x"
[start]
x = 1
[span]
end = 2
step = 0.25
)" + outputs;
    return "'" + path("osc.toml") + "'";
  }
  /// The largest error of x at times between the nodes.
  double error(const std::string& method, double step) const {
    const Outcome outcome =
        run("run " + oscillator() + " --method " + method + " --step " + std::to_string(step) +
            " --at 0.31,0.77,1.234,1.9 --out '" + path("o.csv") + "'");
    EXPECT_EQ(outcome.status & ~3, 0) << outcome.err;
    double largest = 0.0;
    const auto all = lines(contents(path("o.csv")));
    EXPECT_EQ(all.size(), 5U);
    for (std::size_t k = 1; k < all.size(); ++k)
      largest =
          std::max(largest, std::abs(std::stod(fields(all[k])[1]) - std::cos(std::stod(fields(all[k])[0]))));
    return largest;
  }
};

TEST_F(ChosenTimes, ValuesBetweenNodesHaveTheOrderOfTheMethod) {
  for (const auto& [method, order, step] :
       {std::tuple{"type1/midpoint", 2.0, 0.1}, std::tuple{"type1/gl:2", 4.0, 0.2},
        std::tuple{"type1/gl:3", 6.0, 0.5}}) {
    const double slope = std::log2(error(method, step) / error(method, step / 2.0));
    EXPECT_NEAR(slope, order, 0.35) << method;
  }
}

TEST_F(ChosenTimes, TheMotionKeepsItsBits) {
  const std::string scene = "pendulum_cartesian --method type1/gl:2 --step 0.05 --end 1";
  ASSERT_EQ(run("run " + scene + " --out '" + path("nodes.csv") + "'").status, 0);
  ASSERT_EQ(run("run " + scene + " --at 0,0.11,0.12,0.5,0.987,1 --out '" + path("at.csv") + "'").status, 0);
  const auto nodes = by_time(contents(path("nodes.csv"))), at = by_time(contents(path("at.csv")));
  EXPECT_EQ(at.size(), 7U);
  for (const char* time : {"0", "0.5", "1"}) {
    ASSERT_TRUE(at.contains(time)) << contents(path("at.csv"));
    EXPECT_EQ(at.at(time), nodes.at(time));
  }
}

TEST_F(ChosenTimes, EveryTimeShowsStartAndEnd) {
  const std::string times = "run " + oscillator() + " --method type1/gl:3 --every-time 0.3 --out -";
  const auto all = lines(run(times).out);
  ASSERT_EQ(all.size(), 8U);  // 0, 0.3 … 1.8
  EXPECT_EQ(fields(all[1])[0], "0");
  EXPECT_NEAR(std::stod(fields(all.back())[0]), 1.8, 1e-15);
  EXPECT_NEAR(std::stod(fields(all.back())[1]), std::cos(1.8), 1e-6);
  EXPECT_EQ(lines(run(times + " --adaptive").out).size(), 8U);
}

TEST_F(ChosenTimes, AResumedRunGoesOnWithItsTimes) {
  const std::string scene = "run kepler_e06 --method type1/gl:2 --step 0.01 --end 30 --every-time 0.0371";
  const std::string whole = path("whole.csv"), parts = path("parts.csv"), state = path("state");
  ASSERT_EQ(run(scene + " --out '" + whole + "'").status, 0);
  ASSERT_EQ(run(scene + " --checkpoint-every 1000 --checkpoint '" + state + "' --out '" + parts + "'").status,
            0);
  EXPECT_EQ(contents(parts), contents(whole));
  std::ofstream(parts, std::ios::app) << "0,what came after the checkpoint\n";
  ASSERT_EQ(run(scene + " --resume '" + state + "' --out '" + parts + "'").status, 0);
  EXPECT_EQ(contents(parts), contents(whole));
  expect_misuse("run kepler_e06 --method type1/gl:2 --step 0.01 --end 30 --every-time 0.04 --resume '" +
                    state + "' --out '" + parts + "'",
                {"times of the trajectory"});
}

TEST_F(ChosenTimes, AResumedRunDividesItsStepsAtTheSameKinks) {
  const std::string scene = "run " +
                            oscillator("[force]\nx = \"if(mod(t, 0.7123) < 0.3, 1, 0)*sin(3*t)\"\n") +
                            " --method type1/gl:2 --step 0.001";
  const std::string whole = path("whole.csv"), parts = path("parts.csv"), state = path("state");
  ASSERT_EQ(run(scene + " --end 10 --out '" + whole + "'").status, 0);
  ASSERT_EQ(run(scene + " --end 5 --checkpoint '" + state + "' --out '" + parts + "'").status, 0);
  ASSERT_EQ(run(scene + " --end 10 --resume '" + state + "' --out '" + parts + "'").status, 0);
  EXPECT_EQ(contents(parts), contents(whole));
}

TEST_F(ChosenTimes, TimesThatCannotBeShownAreMisuse) {
  expect_misuse("run knife_edge --at 1,0.5", {"--at", "t = 0.5"});
  expect_misuse("run knife_edge --end 1 --at 2", {"--at", "t = 2", "t = 1"});
  expect_misuse("run knife_edge --at 0.5 --every 2", {"--every"});
  expect_misuse("run knife_edge --every-time 0", {"--every-time"});
  expect_misuse("run knife_edge --every-time 1e-12", {"--every-time", "points"});
}

TEST_F(ChosenTimes, OutputsAreColumnsAndEndValues) {
  const std::string scene =
      oscillator("[outputs]\ntotal = \"(v_x^2 + k*x^2)/2\"\nforce_of_it = \"-spring + 0*t\"\n");
  const Outcome outcome = run("run " + scene + " --set k=4 --json --out '" + path("o.csv") + "'");
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  const auto all = lines(contents(path("o.csv")));
  const auto names = fields(all[0]), last = fields(all.back());
  ASSERT_EQ(names.size(), 7U);
  EXPECT_EQ(names[5], "total");
  EXPECT_EQ(names[6], "force_of_it");
  EXPECT_NEAR(std::stod(last[5]), std::stod(last[4]), 1e-15);  // the energy
  EXPECT_EQ(std::stod(last[6]), -4.0 * std::stod(last[1]));
  EXPECT_EQ(Json::parse(outcome.out)["outputs"]["force_of_it"].get<double>(), std::stod(last[6]));
  EXPECT_NE(run("run " + scene).out.find("output total: 0.5"), std::string::npos);
}

TEST_F(ChosenTimes, NamesOfOutputsDoNotClash) {
  for (const char* name :
       {"x", "v_x", "k", "energy", "lambda_row", "invariant_a", "t", "spring", "p_z", "sin"})
    expect_misuse("run " + oscillator("[outputs]\n" + std::string(name) + " = \"2*x\"\n"),
                  {"osc.toml:15", name});
  expect_misuse("run " + oscillator("[outputs]\nsum_of_it = \"x + w\"\n"), {"osc.toml:15", "'w'"});
}

}  // namespace
}  // namespace diracstep::testing
