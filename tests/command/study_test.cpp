#include <algorithm>
#include <nlohmann/json.hpp>

#include "run_command.hpp"

namespace diracstep::testing {
namespace {

using Json = nlohmann::json;

class StudyCommand : public Command {
 protected:
  const std::string small = "--orders 2,4 --steps 0.1,0.05,0.025 --rtols 1e-6,1e-8 --repeat 2 --end 5";
};

/// Errors on groups and spheres: of the stored numbers, where those of a sphere are told up to its frame.
TEST_F(StudyCommand, ScenesOnManifoldsHaveTheOrdersOfTheirStagesBesideIda) {
  for (const char* scene : {"chaplygin_ball_so3", "conical_pendulum_s2"}) {
    const Outcome outcome = run(std::string("study ") + scene +
                                " --json --methods type1/gl:1,type1/gl:2 --steps 0.05,0.025,0.0125,0.00625 "
                                "--rtols 1e-6,1e-9 --repeat 1");
    ASSERT_EQ(outcome.status, 0) << outcome.err;
    const Json study = Json::parse(outcome.out)["studies"][0];
    for (const Json& row : study["rows"]) {
      EXPECT_EQ(row["status"], "ok") << row;
      const double error = std::max(row["error_q"].get<double>(), row["error_p"].get<double>());
      if (row["method"] == "ida" && row["rtol"] == 1e-9) {
        EXPECT_LT(error, 5e-6) << scene;
      }
      if (row["method"] == "erk" && row["rtol"] == 1e-9) {
        EXPECT_LT(error, 1e-7) << scene;
      }
    }
    int told = 0;  // compositions of high order are at round-off at every one of these steps
    for (const Json& measured : study["measured_order"]) {
      if (!measured["slope"].is_number()) continue;
      ++told;
      EXPECT_NEAR(measured["slope"].get<double>(), measured["order"].get<double>(), 0.2) << scene << measured;
    }
    EXPECT_GE(told, 3) << scene;
  }
}

// Names the scene that takes longest first, so that its thread ends last.
TEST_F(StudyCommand, ScenesSideBySideHaveTheRowsOfScenesInTurn) {
  const std::string scenes = "study pendulum_cartesian knife_edge vertical_rolling_disk --json " + small;
  const Outcome in_turn = run(scenes), at_once = run(scenes + " --parallel 3");
  ASSERT_EQ(at_once.status, 0) << at_once.err;
  const Json expected = Json::parse(in_turn.out)["studies"], found = Json::parse(at_once.out)["studies"];
  ASSERT_EQ(found.size(), 3u);
  for (std::size_t k = 0; k < 3; ++k) {
    EXPECT_EQ(found[k]["scene"], expected[k]["scene"]);
    for (const Json& row : expected[k]["rows"]) {
      if (row.contains("rtol"))
        continue;  // which formulations of a baseline have rows is chosen by their times
      const auto same = [&](const Json& other) {
        return other["method"] == row["method"] && other.value("order", 0) == row.value("order", 0) &&
               other["step"] == row["step"] && other["error_q"] == row["error_q"] &&
               other["steps"] == row["steps"];
      };
      EXPECT_TRUE(std::ranges::any_of(found[k]["rows"], same)) << row;
    }
  }
  expect_misuse("study knife_edge --parallel 0", {"--parallel", "1"});
}

/// All baselines come to the reference, which holds the multiplier; rows that are not the scene's are none.
TEST_F(StudyCommand, MultipliersAsCoordinatesAreThoseOfTheReference) {
  const Outcome outcome = run("study " DIRACSTEP_SOURCE
                              "/examples/scenes/pendulum_tension.toml --json "
                              "--methods type1/gl:3 --orders 6 --steps 0.1 --rtols 1e-9 --repeat 1");
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  const Json rows = Json::parse(outcome.out)["studies"][0]["rows"];
  EXPECT_GE(rows.size(), 3u);
  for (const Json& row : rows) {
    EXPECT_EQ(row["status"], "ok") << row;
    EXPECT_LT(row["error_q"].get<double>(), 1e-5) << row;
    EXPECT_LT(row["constraint"].get<double>(), 1e-5) << row;
  }
}

/// A start without velocities is the same for IDA as for the steps; an explicit method says why it has none.
TEST_F(StudyCommand, VelocitiesThatAreNoDataOfAMotionAreFoundForBaselinesToo) {
  const Outcome outcome = run("study " DIRACSTEP_SOURCE
                              "/examples/scenes/first_order_nonholonomic.toml --json "
                              "--methods type1/gl:3 --orders 6 --steps 0.1 --rtols 1e-9 --repeat 1");
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  const Json result = Json::parse(outcome.out);
  for (const Json& row : result["studies"][0]["rows"]) {
    if (row["method"] == "erk") {
      EXPECT_NE(row["status"].get<std::string>().find("not explicit: "), std::string::npos) << row;
      continue;
    }
    EXPECT_EQ(row["status"], "ok") << row;
    EXPECT_LT(row["error_q"].get<double>(), 1e-5) << row;
  }
}

TEST_F(StudyCommand, JsonHasTheKeysOfTheContract) {
  const Outcome outcome = run("study knife_edge --json " + small);
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_TRUE(outcome.err.starts_with("diracstep: version: ")) << outcome.err;
  const Json study = Json::parse(outcome.out)["studies"][0];
  EXPECT_EQ(study["scene"], "knife_edge");
  EXPECT_EQ(study["t_end"], 5.0);
  EXPECT_EQ(study["unknowns"], 4);
  EXPECT_EQ(study["reference"]["kind"], "exact");
  EXPECT_TRUE(study["reference"]["self_error"].is_number());
  // IDA has a row more for each formulation that was the fastest at a tolerance.
  EXPECT_EQ(std::ranges::count_if(study["rows"], [](const Json& row) { return row["method"] != "ida"; }), 8);
  EXPECT_GE(study["rows"].size(), 10u);
  for (const Json& row : study["rows"]) {
    EXPECT_EQ(row["status"], "ok");
    for (const char* key : {"error_q", "error_p", "constraint", "energy_error", "steps", "newton_iterations",
                            "residual_evaluations", "jacobian_evaluations"})
      EXPECT_TRUE(row[key].is_number()) << key << row;
    for (const char* key : {"median", "min", "max"})
      EXPECT_GT(row["cpu_seconds"][key].get<double>(), 0.0) << key;
    EXPECT_EQ(row["cpu_seconds"]["repeats"], 2);
    const bool baseline = row["method"] == "ida" || row["method"] == "erk";
    EXPECT_EQ(row.contains("rtol"), baseline);
    EXPECT_EQ(row.contains("self_error"), baseline);
    EXPECT_EQ(row.contains("formulation"), baseline) << "of IDA, or the explicit code";
    for (const char* key : {"order", "momentum", "step"}) EXPECT_EQ(row.contains(key), !baseline) << key;
  }
  ASSERT_EQ(study["measured_order"].size(), 2u);
  const Json build = Json::parse(outcome.out)["build"];
  for (const char* key : {"diracstep", "sundials", "compiler", "processor"})
    EXPECT_FALSE(build[key].get<std::string>().empty()) << key;
  EXPECT_NEAR(study["measured_order"][0]["slope"].get<double>(), 2.0, 0.1);
  EXPECT_NEAR(study["measured_order"][1]["slope"].get<double>(), 4.0, 0.1);
  ASSERT_EQ(study["at_error"].size(), 8u);
  for (const Json& at : study["at_error"])
    for (const char* key : {"error", "method", "order", "cpu_seconds", "ida_cpu_seconds", "ratio",
                            "erk_cpu_seconds", "erk_ratio"})
      EXPECT_TRUE(at.contains(key)) << key;
  EXPECT_TRUE(study["at_error"].back()["cpu_seconds"].is_null()) << "1e-11 is out of reach here";
}

TEST_F(StudyCommand, WritesTablesAndPictures) {
  const Outcome outcome =
      run("study knife_edge pendulum_cartesian --out \"" + path("a b/it's") + "\" " + small);
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  const auto shown = lines(outcome.out);  // the detail is in the files
  ASSERT_EQ(shown.size(), 3u) << outcome.out;
  EXPECT_EQ(shown[0].rfind("SUNDIALS ", 0), 0u) << shown[0];
  EXPECT_EQ(shown[1].rfind("knife_edge: 1e-3 type1/midpoint, order ", 0), 0u) << shown[1];
  EXPECT_EQ(shown[2].rfind("pendulum_cartesian:", 0), 0u) << shown[2];
  EXPECT_NE(contents(path("a b/it's/knife_edge.txt")).find("the ladder ended because"), std::string::npos);
  const Json json = Json::parse(contents(path("a b/it's/study.json")));
  EXPECT_EQ(json["studies"].size(), 2u);
  const auto csv = lines(contents(path("a b/it's/study.csv")));
  const auto rows_of = [&](const std::string& start) {
    return std::ranges::count_if(csv, [&](const std::string& row) { return row.starts_with(start); });
  };
  for (const std::string& row : csv)  // no name has a comma in it
    EXPECT_EQ(std::ranges::count(row, ','), std::ranges::count(csv[0], ',')) << row;
  for (const std::string scene : {"knife_edge", "pendulum_cartesian"}) {
    EXPECT_EQ(rows_of(scene + ",type1/midpoint,"), 6) << scene;
    EXPECT_GE(rows_of(scene + ",ida,"), 2)
        << scene << ": of each formulation that was fastest at a tolerance";
    EXPECT_GE(rows_of(scene + ",erk,"), 2) << scene;
  }
  EXPECT_EQ(csv[0].rfind("scene,method,order,momentum,step,rtol,status,error_q,error_p", 0), 0u);
  if (outcome.err.find("gnuplot was not found") != std::string::npos) GTEST_SKIP() << "no gnuplot here";
  for (const char* scene : {"knife_edge", "pendulum_cartesian"}) {
    EXPECT_NE(contents(path("a b/it's/" + std::string(scene) + ".svg")).find("<svg"), std::string::npos);
    EXPECT_EQ(contents(path("a b/it's/" + std::string(scene) + ".png")).substr(1, 3), "PNG");
  }
}

TEST_F(StudyCommand, WithoutAReportTheRowsAreOnTheScreen) {
  const Outcome outcome = run("study knife_edge " + small);
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  for (const char* part : {"reference: exact", "type1/midpoint  4", "IDA, ", "fastest of ours"})
    EXPECT_NE(outcome.out.find(part), std::string::npos) << part << outcome.out;
}

TEST_F(StudyCommand, AQuickStudyHasExplicitCompositionsAndLeavesOutWhatDoesNotFit) {
  const Outcome outcome = run("study double_pendulum lotka_volterra_2d --end 1 --json");
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_EQ(outcome.err.find("trapezoidal"), std::string::npos) << outcome.err;
  const Json studies = Json::parse(outcome.out)["studies"];
  const auto has = [](const Json& study, const std::string& method) {
    return std::any_of(study["rows"].begin(), study["rows"].end(),
                       [&](const Json& row) { return row["method"] == method && row["status"] == "ok"; });
  };
  EXPECT_TRUE(has(studies[0], "type1/trapezoidal"));
  EXPECT_TRUE(has(studies[1], "type1/gl:6"));
  EXPECT_FALSE(has(studies[1], "type1/trapezoidal")) << "it is unstable on phase-space Lagrangians";
  EXPECT_EQ(studies[0]["reference"]["kind"], "converged") << "there is no reference at t = 1";
}

TEST_F(StudyCommand, AnInterruptReachesNoOtherProgram) {
  // As from a terminal: to the whole group, while pictures are drawn.
  const Outcome outcome =
      run("study 'k*' 'p*' --steps 0.01 --orders 2 --rtols 1e-6 --repeat 1 --end 1 --out " + path("o"),
          "timeout --preserve-status -s INT 1");
  EXPECT_EQ(outcome.err.find("gnuplot"), std::string::npos) << outcome.err;
}

TEST_F(StudyCommand, ReportHoldsItsPicturesAndComparesWithAnEarlierStudy) {
  const std::string options = " --orders 2 --steps 0.1,0.05 --rtols 1e-6 --repeat 1 --end 5";
  ASSERT_EQ(run("study knife_edge --out " + path("old") + options).status, 0);
  const std::string page = contents(path("old/report.html"));
  EXPECT_NE(page.find("id=\"knife_edge\""), std::string::npos);
  const Outcome again = run("study 'knife*' --compare " + path("old/study.json") + options);
  EXPECT_EQ(again.status, 0) << again.err;
  EXPECT_NE(again.err.find("comparisons within the noise"), std::string::npos) << again.err;
  expect_misuse("study knife_edge --compare " + path("nothing.json") + options,
                {"--compare", "nothing.json"});
}

TEST_F(StudyCommand, PatternsAndClassesChooseScenes) {
  const std::string rest = " --orders 2 --steps 0.5 --without-ida --without-erk --repeat 1 --end 1 --json";
  const Json studies = Json::parse(run("study 'knife_edg?' --scenes 'kepler_e06'" + rest).out)["studies"];
  ASSERT_EQ(studies.size(), 2u);
  EXPECT_EQ(studies[0]["scene"], "knife_edge");
  EXPECT_EQ(studies[1]["scene"], "kepler_e06");
  expect_misuse("study 'zz*'", {"zz*", "knife_edge"});
}

TEST_F(StudyCommand, IdaTakesTheFormulationAskedForAndNamesItInTheRow) {
  const std::string rest = " --orders 2 --steps 0.02 --without-erk --rtols 1e-6 --repeat 1 --end 1 --json";
  for (const std::string formulation : {"rates", "rates-loose", "index-2", "velocity"}) {
    const Outcome outcome = run("study pendulum_cartesian --ida-formulation " + formulation + rest);
    ASSERT_EQ(outcome.status, 0) << outcome.err;
    EXPECT_EQ(Json::parse(outcome.out)["studies"][0]["rows"].back()["formulation"], formulation);
  }
}

TEST_F(StudyCommand, WithoutGnuplotEverythingElseIsWritten) {
  const Outcome outcome = run("study knife_edge --out " + path("out") + ' ' + small, "PATH=/nonexistent");
  EXPECT_EQ(outcome.status, 0);
  EXPECT_NE(outcome.err.find("gnuplot was not found"), std::string::npos) << outcome.err;
  EXPECT_EQ(Json::parse(contents(path("out/study.json")))["studies"].size(), 1u);
}

TEST_F(StudyCommand, FailedRunIsARowAndAMessage) {
  const Outcome outcome =
      run("study pendulum_cartesian --orders 2 --steps 0.2,0.01 --without-ida --without-erk --json");
  EXPECT_EQ(outcome.status, 1);
  EXPECT_NE(outcome.err.find("no convergence"), std::string::npos) << outcome.err;
  const Json rows = Json::parse(outcome.out)["studies"][0]["rows"];
  ASSERT_EQ(rows.size(), 2u);
  EXPECT_NE(rows[0]["status"].get<std::string>().find("no convergence"), std::string::npos);
  EXPECT_TRUE(rows[0]["error_q"].is_null());
  EXPECT_EQ(rows[1]["status"], "ok");
}

TEST_F(StudyCommand, OrderThatOneMethodLacksIsNoFailure) {
  const std::string rest = " --steps 0.1,0.05 --without-ida --without-erk --repeat 1 --json";
  const Outcome outcome = run("study knife_edge --methods type1/midpoint,type2/euler --orders 1,2" + rest);
  EXPECT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_NE(outcome.err.find("type1/midpoint order 1: no composition"), std::string::npos) << outcome.err;
  const Json rows = Json::parse(outcome.out)["studies"][0]["rows"];
  ASSERT_EQ(rows.size(), 7u);
  EXPECT_TRUE(rows[0]["step"].is_null());
  EXPECT_NE(rows[0]["status"], "ok");
}

TEST_F(StudyCommand, InterruptKeepsFinishedRows) {
  const Outcome outcome =
      run("study kepler_e06 --json --out " + path("out"), "timeout --preserve-status -s INT 1");
  EXPECT_EQ(outcome.status, 1);
  const Json study = Json::parse(outcome.out)["studies"][0];
  EXPECT_TRUE(study["interrupted"].get<bool>());
  EXPECT_FALSE(study["rows"].empty());
  EXPECT_EQ(Json::parse(contents(path("out/study.json")))["studies"][0]["rows"].size(), study["rows"].size());
}

TEST_F(StudyCommand, MisuseNamesTheValueAndWhatIsAllowed) {
  expect_misuse("study nowhere", {"nowhere", "knife_edge"});
  expect_misuse("study knife_edge --methods type1/none", {"type1/none", "type1/midpoint"});
  expect_misuse("study knife_edge --methods ''", {"--methods"});
  expect_misuse("study knife_edge --orders 3", {"3", "2, 4, 6, 8"});
  expect_misuse("study knife_edge --orders 2.5", {"2.5"});
  expect_misuse("study knife_edge --steps ''", {"--steps"});
  expect_misuse("study knife_edge --steps 0.1,,0.2", {"0.1,,0.2"});
  expect_misuse("study knife_edge --steps 0.1,x", {"x"});
  expect_misuse("study knife_edge --steps 0", {"0"});
  expect_misuse("study knife_edge --steps nan", {"nan"});
  expect_misuse("study knife_edge --rtols 1", {"1", "[1e-14, 1e-1]"});
  expect_misuse("study knife_edge --repeat 0", {"0", "1 or more"});
  expect_misuse("study knife_edge --budget 0", {"0"});
  expect_misuse("study knife_edge --end 0", {"0"});
  expect_misuse("study knife_edge --ida-formulation index-3",
                {"index-3", "best, rates, rates-loose, index-2, velocity"});
  expect_misuse("study knife_edge --momentum x", {"plus", "minus", "projected"});
  expect_misuse("study knife_edge --set e=1", {"'e'", "J"});
  expect_misuse("study knife_edge --out /dev/null/x", {"/dev/null/x"});
}

}  // namespace
}  // namespace diracstep::testing
