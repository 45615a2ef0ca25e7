#include <cmath>
#include <nlohmann/json.hpp>

#include "run_command.hpp"

/// --plugin, DIRACSTEP_PLUGIN_PATH, and check on methods.
namespace diracstep::testing {
namespace {

using Json = nlohmann::json;

std::string plugin(const std::string& name) {
  return " --plugin '" DIRACSTEP_TEST_PLUGINS "/" + name + ".so' ";
}

class Plugins : public Command {};

TEST_F(Plugins, AreListedWithWhatTheyBring) {
  const Json list = Json::parse(run("list plugins --json" + plugin("harmonic") + plugin("galerkin")).out);
  ASSERT_EQ(list["plugins"].size(), 2u);
  EXPECT_EQ(list["plugins"][0]["methods"], Json::array({"type1/harmonic"}));
  EXPECT_EQ(list["plugins"][0]["scenes"], Json::array({"two_springs"}));
  EXPECT_EQ(list["plugins"][1]["rules"], Json::array({"simpson"}));
  const Outcome methods = run("list methods" + plugin("galerkin"));
  EXPECT_NE(methods.out.find("type2/legendre(type1/galerkin2)"), std::string::npos);
  EXPECT_NE(run("list scenes" + plugin("harmonic")).out.find("two_springs"), std::string::npos);
}

TEST_F(Plugins, WorkInEveryVerb) {
  EXPECT_EQ(
      run(plugin("harmonic") + "run two_springs --end 1 --step 0.01 --rule simpson" + plugin("galerkin"))
          .status,
      0);
  const std::string options = " --method type1/harmonic" + plugin("harmonic");
  EXPECT_EQ(run("plan two_springs" + options).status, 0);
  EXPECT_EQ(run("plan two_springs " + plugin("harmonic") + " --method type1/harmonic").status, 0);
  EXPECT_EQ(run("study two_springs --methods type1/harmonic --steps 0.1,0.05 --repeat 1 --without-ida" +
                plugin("harmonic"))
                .status,
            0);
  const Outcome outcome = run("run knife_edge --rule simpson --end 1" + plugin("galerkin"));
  EXPECT_EQ(outcome.status, 0) << outcome.err;
}

/// The discrete Lagrangian that knows the stiff spring beats the others at a step of 2.5 radians of it.
TEST_F(Plugins, TheHarmonicDiscreteLagrangianIsWorthHaving) {
  const auto stiff = [&](const std::string& options) {
    const Outcome outcome = run("run two_springs --json --doubt ignore" + plugin("harmonic") + options);
    EXPECT_EQ(outcome.status, 0) << outcome.err;
    return Json::parse(outcome.out)["end"]["q"]["stiff"].get<double>();
  };
  const double exact = stiff("--method type1/gl:4 --step 0.002");
  EXPECT_LT(std::abs(stiff("--method type1/harmonic") - exact), 1e-6);
  EXPECT_GT(std::abs(stiff("--method type1/gl:2") - exact), 1e-3);
}

TEST_F(Plugins, ComeFromThePathToo) {
  const std::string path = "DIRACSTEP_PLUGIN_PATH='/no/such/place:" DIRACSTEP_TEST_PLUGINS "'";
  const Outcome outcome = run("list plugins --json", path);
  EXPECT_EQ(outcome.status, 0);
  bool found = false;
  const Json list = Json::parse(outcome.out);
  for (const Json& entry : list["plugins"]) found = found || entry["name"] == "harmonic";
  EXPECT_TRUE(found);
  // What cannot be loaded is told and left out.
  for (const char* word :
       {"/no/such/place", "faulty_0.so", "does not export", "faulty_1.so", "version", "left out"})
    EXPECT_NE(outcome.err.find(word), std::string::npos) << word << " not in\n" << outcome.err;
  EXPECT_EQ(run("run two_springs --end 1 --method type1/harmonic" + plugin("harmonic"), path).status, 0);
}

TEST_F(Plugins, ThatCannotBeLoadedAreMisuse) {
  expect_misuse("list --plugin missing.so", {"missing.so", "no such file"});
  expect_misuse("list" + plugin("faulty_0"), {"faulty_0.so", "diracstep_plugin_entry"});
  expect_misuse("list" + plugin("faulty_1"), {"faulty_1.so", "version 7", "has 1"});
  expect_misuse("run knife_edge" + plugin("faulty_2"), {"type1/midpoint", "already registered"});
  expect_misuse("run two_springs --set a=1" + plugin("harmonic"), {"two_springs", "'a'"});
  expect_misuse("run knife_edge --rule middle", {"middle", "trapezoidal"});
  expect_misuse("check type1/none", {"type1/none", "type1/midpoint"});
}

TEST_F(Plugins, ThatFailWhileRunningEndTheRunAndNotTheStudy) {
  const Outcome error = run("run kepler_e06 --method type1/faulty" + plugin("faulty_3"));
  EXPECT_EQ(error.status, 1);
  EXPECT_NE(error.err.find("error 42: the answer is refused"), std::string::npos) << error.err;
  EXPECT_EQ(run("run kepler_e06 --method type1/faulty" + plugin("faulty_4")).status, 1);
  EXPECT_EQ(run("run kepler_e06 --method type1/throwing" + plugin("throwing")).status, 1);
  const Outcome study = run(
      "study kepler_e06 --methods type1/faulty,type1/midpoint --orders 1,2 --steps 0.05 --end 1 --repeat 1 " +
      ("--without-ida --json" + plugin("faulty_3")));
  bool midpoint = false;
  const Json json = Json::parse(study.out);
  for (const Json& row : json["studies"][0]["rows"])
    midpoint = midpoint || (row["method"] == "type1/midpoint" && row["status"] == "ok");
  EXPECT_TRUE(midpoint) << study.out << study.err;
}

TEST_F(Plugins, CheckPrintsTheTable) {
  const Outcome good = run("check" + plugin("galerkin"));
  EXPECT_EQ(good.status, 0) << good.out;
  for (const char* line :
       {"type1/galerkin2: passes", "symplecticity", "order, mixed", "membership", "simpson"})
    EXPECT_NE(good.out.find(line), std::string::npos) << line;
  const Json json = Json::parse(run("check type1/midpoint 'type2/legendre(type1/left)' --json").out);
  ASSERT_EQ(json["methods"].size(), 2u);
  for (const Json& method : json["methods"]) {
    EXPECT_TRUE(method["passed"].get<bool>()) << method;
    EXPECT_GT(method["checks"].size(), 14u);
  }
}

TEST_F(Plugins, CheckFailsWhereACheckFails) {
  const Outcome outcome = run("check --json type1/faulty" + plugin("faulty_3"));
  EXPECT_EQ(outcome.status, 1);
  const Json json = Json::parse(outcome.out);
  EXPECT_FALSE(json["methods"][0]["passed"].get<bool>());
  bool told = false;
  for (const Json& check : json["methods"][0]["checks"])
    told = told || check["detail"].get<std::string>().find("the answer is refused") != std::string::npos;
  EXPECT_TRUE(told) << outcome.out;
}

}  // namespace
}  // namespace diracstep::testing
