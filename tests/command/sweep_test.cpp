#include <nlohmann/json.hpp>
#include <random>

#include "run_command.hpp"

/// The verb sweep.
namespace diracstep::testing {
namespace {

using Json = nlohmann::json;

class SweepVerb : public Command {
 protected:
  /// 40 members in blocks of 2; each takes a few milliseconds.
  std::string orbits() const {
    std::ofstream(path("orbits.toml")) << R"(scene = "kepler_e06"
method = "type1/gl:2"
step = 0.002
end = 20
block = 2
[grid]
e = { from = 0.1, to = 0.5, count = 5 }
[random]
count = 8
[random.of]
"start.x" = { uniform = [0.9, 1.1] }
)";
    return "sweep '" + path("orbits.toml") + "'";
  }
  std::string to(const std::string& folder) const { return " --out '" + path(folder) + "'"; }
  std::string results(const std::string& folder) const {
    return contents(path(folder + "/results.csv")) + contents(path(folder + "/results.npy"));
  }
};

TEST_F(SweepVerb, ShowsWhatWasRecorded) {
  const Outcome outcome = run(orbits() + to("out"));
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  for (const char* part : {"40 members of kepler_e06", "40 run here", "ok 40, doubted 0, failed 0",
                           "recorded", "v_y", "results.csv"})
    EXPECT_NE(outcome.out.find(part), std::string::npos) << part << '\n' << outcome.out;
  const Outcome again = run(orbits() + to("out") + " --json");
  ASSERT_EQ(again.status, 0) << again.err;
  const Json json = Json::parse(again.out);
  EXPECT_EQ(json["run_here"], 0);
  EXPECT_EQ(json["ok"], 40);
  EXPECT_EQ(json["columns"]["x"]["count"], 40);
  EXPECT_EQ(lines(contents(path("out/results.csv"))).size(), 41u);
}

TEST_F(SweepVerb, ATaskOfAnArrayTakesItsPart) {
  ASSERT_EQ(run(orbits() + to("whole")).status, 0);
  for (const char* id : {"14", "10", "12"}) {
    const std::string variables =
        std::string(
            "SLURM_ARRAY_TASK_MIN=10 SLURM_ARRAY_TASK_STEP=2 SLURM_ARRAY_TASK_COUNT=3 SLURM_ARRAY_TASK_ID=") +
        id;
    const Outcome outcome = run(orbits() + to("tasks") + " --json", variables);
    ASSERT_EQ(outcome.status, 0) << outcome.err;
    EXPECT_EQ(Json::parse(outcome.out)["run_here"], id[1] == '4' ? 12 : 14);
  }
  EXPECT_EQ(results("tasks"), results("whole"));
  expect_misuse(orbits() + to("tasks") + " --part 4/3", {"--part 4/3", "K/N", "3/8"});
  expect_misuse(orbits() + to("tasks") + " --part 1", {"--part 1"});
}

TEST_F(SweepVerb, ProcessesShareAFolder) {
  ASSERT_EQ(run(orbits() + to("whole")).status, 0);
  const std::string one = "'" DIRACSTEP_COMMAND "' " + orbits() + to("shared") + " --threads 1 --json > '";
  ASSERT_EQ(std::system(("{ " + one + path("a") + "' & " + one + path("b") + "' & " + one + path("c") +
                         "' & wait; } 2>'" + path("errors") + "'")
                            .c_str()),
            0);
  long run_here = 0;
  for (const char* name : {"a", "b", "c"})
    run_here += Json::parse(contents(path(name)))["run_here"].get<long>();
  EXPECT_EQ(run_here, 40) << contents(path("errors"));
  ASSERT_EQ(run(orbits() + to("shared")).status, 0);
  EXPECT_EQ(results("shared"), results("whole"));
}

TEST_F(SweepVerb, AnInterruptKeepsFinishedBlocks) {
  ASSERT_EQ(run(orbits() + to("whole")).status, 0);
  const Outcome ended = run(orbits() + to("out") + " --threads 1", "timeout -s INT 0.1");
  EXPECT_TRUE(ended.status == 1 || ended.status == 124) << ended.status << ended.err;
  ASSERT_EQ(run(orbits() + to("out")).status, 0);
  EXPECT_EQ(results("out"), results("whole"));
}

TEST_F(SweepVerb, KilledAtRandomMomentsNothingIsLost_slow) {
  ASSERT_EQ(run(orbits() + to("whole")).status, 0);
  const std::string expected = results("whole");
  std::mt19937 random(1);
  std::uniform_real_distribution<double> moment(0.005, 0.15);
  int killed = 0;
  for (int chain = 0; killed < 100; ++chain) {
    const std::string folder = to("out" + std::to_string(chain));
    for (int k = 0; k < 6; ++k)
      if (run(orbits() + folder + " --threads 2", "timeout -s KILL " + std::to_string(moment(random)))
              .status == -1)
        ++killed;
    ASSERT_EQ(run(orbits() + folder).status, 0) << chain;
    ASSERT_EQ(results("out" + std::to_string(chain)), expected) << chain;
  }
}

TEST_F(SweepVerb, WhatCannotBeRunIsRefused) {
  expect_misuse("sweep '" + path("none.toml") + "'" + to("out"), {"none.toml", "cannot be read"});
  std::ofstream(path("empty.toml")) << "scene = \"kepler_e06\"\n";
  expect_misuse("sweep '" + path("empty.toml") + "'" + to("out"), {"nothing varies"});
  expect_misuse(orbits() + to("no/such/folder"), {"no/such/folder"});
  expect_misuse(orbits(), {"--out"});
}

TEST_F(SweepVerb, AFullDiskIsToldAndTheRestIsRunLater) {
  ASSERT_EQ(run(orbits() + to("whole")).status, 0);
  const Outcome full = run(orbits() + to("out"), "ulimit -f 1;");
  EXPECT_EQ(full.status, 1);
  EXPECT_NE(full.err.find("could not be written in full"), std::string::npos) << full.err;
  std::filesystem::remove_all(path("out"));
  ASSERT_EQ(run(orbits() + to("out")).status, 0);
  EXPECT_EQ(results("out"), results("whole"));
}

}  // namespace
}  // namespace diracstep::testing
