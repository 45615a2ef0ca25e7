#include <gtest/gtest.h>

#include <cmath>
#include <csignal>
#include <nlohmann/json.hpp>
#include <random>

#include "run_command.hpp"

/// Runs that stop and go on: the files of an interrupted run end up with the bytes of one that never stopped.
namespace diracstep::testing {
namespace {

using Json = nlohmann::json;

class CheckpointCommand : public Command {
 protected:
  /// A run of some 0.3 s with its trajectory.
  const std::string scene =
      "run knife_edge --method type1/gl:3 --step 0.01 --end 200 --every 7 --momentum minus";

  std::string with_file(const std::string& name) const { return " --json --out '" + path(name) + "'"; }

  /// Kills the run at random moments until it gets through; the number of kills.
  int kill_until_done(std::mt19937& random) const {
    std::string control = " --checkpoint '" + path("c") + "' --checkpoint-every 97";
    for (int kills = 0;; ++kills) {
      const double seconds = 0.02 + 0.02 * kills + 1e-4 * static_cast<double>(random() % 500);
      // --foreground: timeout(1) does not kill itself as well, and so waits until the run has ended
      const Outcome outcome = run(scene + with_file("k.csv") + control,
                                  "timeout --foreground -s KILL " + std::to_string(seconds));
      if (outcome.status == 0) return kills;
      // 124: it ended by itself just as it was to be killed
      EXPECT_TRUE(outcome.status == 128 + SIGKILL || outcome.status == 124) << outcome.err;
      if (std::filesystem::exists(path("c"))) control = " --resume '" + path("c") + "' --checkpoint-every 97";
      if (kills > 300) {
        ADD_FAILURE() << "never done: " << outcome.err;
        return kills;
      }
    }
  }

  void kill_and_compare(int rounds) {
    ASSERT_EQ(run(scene + with_file("whole.csv")).status, 0);
    std::mt19937 random(static_cast<unsigned>(rounds));
    int kills = 0;
    for (int round = 0; round < rounds; ++round) {
      for (const char* name : {"k.csv", "c"}) std::filesystem::remove(path(name));
      kills += kill_until_done(random);
      ASSERT_EQ(contents(path("k.csv")), contents(path("whole.csv"))) << "round " << round;
    }
    EXPECT_GE(kills, rounds) << "too few kills to say anything";
  }
};

TEST_F(CheckpointCommand, KilledRunsEndWithTheSameBytes) { kill_and_compare(2); }
TEST_F(CheckpointCommand, ManyKilledRunsEndWithTheSameBytes_slow) { kill_and_compare(60); }

TEST_F(CheckpointCommand, ResumedRunsSayTheSameToTheLastBit) {
  for (const char* what : {"run hanging_chain --set N=25 --method type1/midpoint --step 0.005",
                           "run pendulum_cartesian --method type1/gl:6 --step 0.2",
                           "run lotka_volterra_2d --method type1/gl:2 --step 0.05",
                           "run kepler_e06 --method type1/trapezoidal --order 4 --step 0.05"}) {
    const std::string first = std::string(what) + " --end 1", second = std::string(what) + " --end 2";
    const std::string again = " --resume '" + path("c") + "'";
    ASSERT_EQ(run(second + with_file("whole.csv")).status, 0) << what;
    ASSERT_EQ(run(first + with_file("k.csv") + " --checkpoint '" + path("c") + "'").status, 0) << what;
    const Outcome rest = run(second + with_file("k.csv") + again);
    ASSERT_EQ(rest.status, 0) << what << rest.err;
    EXPECT_NE(rest.err.find("going on from step"), std::string::npos) << rest.err;
    EXPECT_EQ(contents(path("k.csv")), contents(path("whole.csv"))) << what;
  }
}

TEST_F(CheckpointCommand, WorkOfAResumedRunIsThatOfTheWhole) {
  const std::string what = "run knife_edge --step 0.1 --json";
  const Json whole = Json::parse(run(what + " --end 2").out);
  ASSERT_EQ(run(what + " --end 1 --checkpoint '" + path("c") + "'").status, 0);
  EXPECT_EQ(Json::parse(run(what + " --end 2 --resume '" + path("c") + "'").out), whole);
}

TEST_F(CheckpointCommand, OtherRunsAreRefusedWithBothValues) {
  const std::string control = " --resume '" + path("c") + "'";
  ASSERT_EQ(run("run knife_edge --method type1/midpoint --step 0.1 --end 1 --checkpoint '" + path("c") + "'")
                .status,
            0);
  expect_misuse("run knife_edge --method type1/midpoint --step 0.05 --end 2" + control,
                {"step is 0.1", "here it is 0.05"});
  expect_misuse("run knife_edge --method type1/midpoint --step 0.1 --end 2 --set m=2" + control,
                {"its parameter m is 1", "here it is 2"});
  expect_misuse("run knife_edge --step 0.1 --end 2 --method type1/gl:2" + control,
                {"type1/midpoint", "type1/gl:2"});
  expect_misuse("run kepler_e06 --step 0.1 --end 2" + control, {"knife_edge", "kepler_e06"});
  expect_misuse("run knife_edge --method type1/midpoint --step 0.1 --end 2 --out " + path("k.csv") + control,
                {"trajectory is none"});
}

/// Events that switch several rows, formulas of columns, and an end that lies behind.
TEST_F(CheckpointCommand, WhatARunIsMadeOfIsKnown) {
  const std::string begun = " --out '" + path("r.csv") + "' --checkpoint '" + path("r") + "'",
                    resumed = " --out '" + path("r.csv") + "' --resume '" + path("r") + "'";
  ASSERT_EQ(run("run rocking_block --end 1" + begun).status, 0);
  expect_misuse("run rocking_block --end 0.5" + resumed, {"stands at t = 1"});
  const Outcome on = run("run rocking_block --end 2" + resumed);
  EXPECT_EQ(on.status, 0) << on.err;
  const auto with_output = [&](const std::string& formula) {
    std::ofstream(path("s.toml")) << "name = \"s\"\nlagrangian = \"v_x^2/2 - x^2/2\"\n[coordinates]\nx = {}\n"
                                     "[start]\nx = 1\n[outputs]\nshown = \"" +
                                         formula + "\"\n[span]\nend = 1\nstep = 0.1\n";
    return "run '" + path("s.toml") + "'";
  };
  ASSERT_EQ(
      run(with_output("x*v_x") + " --out '" + path("o.csv") + "' --checkpoint '" + path("o") + "'").status,
      0);
  expect_misuse(with_output("1000") + " --end 2 --out '" + path("o.csv") + "' --resume '" + path("o") + "'",
                {"output shown", "x*v_x", "1000"});
}

TEST_F(CheckpointCommand, DamagedFilesAreRefused) {
  const std::string first = "run knife_edge --step 0.1 --end 1 --out " + path("k.csv");
  const std::string second =
      "run knife_edge --step 0.1 --end 2 --out " + path("k.csv") + " --resume " + path("c");
  ASSERT_EQ(run(first + " --checkpoint '" + path("c") + "'").status, 0);
  const std::string whole = contents(path("c")), trajectory = contents(path("k.csv"));
  const auto with = [&](const std::string& name, const std::string& bytes) {
    std::ofstream(path(name), std::ios::binary) << bytes;
  };
  expect_misuse("run knife_edge --resume " + path("none"), {"none", "No such file"});
  for (const auto& [bytes, why] : {std::pair{std::string(), "does not begin"},
                                   {whole.substr(0, 10), "does not begin"},
                                   {whole.substr(0, whole.size() - 1), "check sum"},
                                   {whole + "x", "check sum"}}) {
    with("c", bytes);
    expect_misuse(second, {why});
  }
  with("c", whole);
  with("k.csv", trajectory.substr(0, 100));
  expect_misuse(second, {"has 100 bytes"});
  with("k.csv", std::string(trajectory.size(), 'x'));
  expect_misuse(second, {"columns of this scene"});
  with("k.csv", trajectory);
  EXPECT_EQ(run(second).status, 0);
}

TEST_F(CheckpointCommand, ThatCannotBeWrittenIsAnError) {
  for (const char* folder : {"none/c", "file/c"}) {
    std::ofstream(path("file")) << "";
    const Outcome outcome = run("run knife_edge --checkpoint '" + path(folder) + "'");
    EXPECT_EQ(outcome.status, 2) << folder;
    EXPECT_NE(outcome.err.find("cannot be written"), std::string::npos) << outcome.err;
  }
  expect_misuse("run knife_edge --checkpoint-every 5", {"--checkpoint FILE"});
  expect_misuse("run knife_edge --checkpoint c --checkpoint-every=-5", {"-5"});
  expect_misuse("run knife_edge --checkpoint c --out c", {"--checkpoint and --out are both 'c'"});
  expect_misuse("run knife_edge --adaptive --checkpoint c",
                {"--checkpoint", "--adaptive", "fixed steps only"});
  expect_misuse("run knife_edge --error 1e-6 --resume c", {"--resume", "--error"});
}

TEST_F(CheckpointCommand, RetriesAreReported) {
  const Outcome outcome =
      run("run kepler_e06 --method type1/midpoint --step 0.5 --end 5 --substeps 8 --doubt ignore --json");
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  const Json retries = Json::parse(outcome.out)["retries"];
  for (const char* key :
       {"line_searches", "plain_guesses", "previous_solutions", "continuations", "other_branches"})
    EXPECT_TRUE(retries[key].is_number()) << key;
  EXPECT_GE(retries["divided_steps"].get<int>(), 1);
  EXPECT_NE(
      run("run kepler_e06 --method type1/midpoint --step 0.5 --end 5 --substeps 8").out.find("divided steps"),
      std::string::npos);
  EXPECT_EQ(run("run kepler_e06 --method type1/midpoint --step 0.5 --end 5").status, 1);
  expect_misuse("run kepler_e06 --substeps 0", {"substeps = 0", "1 or more"});
}

TEST_F(CheckpointCommand, SameInputSameBytes) {
  const std::string what = "run knife_edge --method type1/gl:4 --order 8 --step 0.1 --json --out ";
  ASSERT_EQ(run(what + path("a.csv")).status, 0);
  ASSERT_EQ(run(what + path("b.csv")).status, 0);
  EXPECT_EQ(contents(path("a.csv")), contents(path("b.csv")));
}

}  // namespace
}  // namespace diracstep::testing
