#include <cmath>
#include <diracstep/core/runs/run.hpp>
#include <misuse.hpp>

#include "sweep_fixture.hpp"

namespace diracstep::testing {
namespace {

constexpr const char* orbits = R"(scene = "kepler_e06"
method = "type1/gl:2"
step = 0.05
end = 2.0
block = 3
[grid]
e = [0.0, 0.3, 0.6]
[random]
count = 4
seed = 5
[random.of]
"start.x" = { uniform = [0.9, 1.1] }
[record]
values = ["x", "v_y", "energy"]
extrema = ["y"]
)";

class SweepFolder : public SweepTest {
 protected:
  Sweep orbit_sweep() const { return read_sweep(write("orbits.toml", orbits)); }
  std::string results(const std::string& folder) const {
    return contents(path(folder + "/results.csv")) + contents(path(folder + "/results.npy"));
  }
};

TEST_F(SweepFolder, AMemberIsTheRunOfItsScene) {
  const Sweep sweep = orbit_sweep();
  const SweepReport report = run(sweep, {.folder = path("out")});
  EXPECT_TRUE(report.complete);
  EXPECT_EQ(report.ok, 12);
  EXPECT_EQ(rows("out")[0], "member,e,start.x,status,t,x,v_y,energy,min_y,max_y,reason");
  const std::vector<std::string> line = fields(rows("out")[1 + 7]);
  EXPECT_EQ(line[0], "7");
  EXPECT_EQ(std::stod(line[1]), 0.3);

  CatalogueScene entry = make_scene("kepler_e06", {{"e", 0.3}});
  auto scene = std::make_shared<Scene>(*entry.scene);
  scene->start.q[0] = sweep.member(7)[1];
  EXPECT_EQ(std::stod(line[2]), scene->start.q[0]);
  Integrator integrator(scene, Registry::with_built_ins(), kinsol(), {.method = "type1/gl:2", .step = 0.05});
  Sample end;
  double least = HUGE_VAL, most = -HUGE_VAL;
  const RunReport ran = run_steps(integrator, 40, Momentum::projected, 1, [&](const Sample& node) {
    least = std::min(least, node.q[1]);
    most = std::max(most, node.q[1]);
    end = node;
    return true;
  });
  ASSERT_TRUE(ran.ok());
  EXPECT_EQ(std::stod(line[4]), 2.0);
  EXPECT_EQ(std::stod(line[5]), end.q[0]);
  EXPECT_EQ(std::stod(line[6]), end.v[1]);
  EXPECT_EQ(std::stod(line[7]), end.energy);
  EXPECT_EQ(std::stod(line[8]), least);
  EXPECT_EQ(std::stod(line[9]), most);
}

TEST_F(SweepFolder, TheResultsAreTheSameBytesForAnyDistribution) {
  const Sweep sweep = orbit_sweep();
  (void)run(sweep, {.folder = path("one"), .threads = 1});
  const std::string expected = results("one");
  ASSERT_GT(expected.size(), 1000u);

  (void)run(sweep, {.folder = path("threads"), .threads = 3});
  EXPECT_EQ(results("threads"), expected);

  for (long part = 3; part >= 1; --part) {
    const SweepReport report = run(sweep, {.folder = path("parts"), .part = part, .parts = 3});
    EXPECT_EQ(report.complete, part == 1);
    EXPECT_EQ(report.merged_here, part == 1);
  }
  EXPECT_EQ(results("parts"), expected);

  Sweep other_blocks = sweep;
  other_blocks.block = 5;
  (void)run(other_blocks, {.folder = path("blocks")});
  EXPECT_EQ(results("blocks"), expected);

  long drawn = 0;
  SweepOptions counter{.folder = path("counter")};
  counter.next_block = [&] { return drawn++; };
  (void)run(sweep, counter);
  EXPECT_EQ(results("counter"), expected);
}

TEST_F(SweepFolder, GoesOnWithWhatIsMissing) {
  const Sweep sweep = orbit_sweep();
  (void)run(sweep, {.folder = path("whole")});
  SweepOptions ended{.folder = path("ended"), .threads = 1};
  ended.goes_on = [&] { return !std::filesystem::exists(path("ended/blocks/000000000000.csv")); };
  const SweepReport first = run(sweep, ended);
  EXPECT_FALSE(first.complete);
  EXPECT_GT(first.done, 0);
  EXPECT_LT(first.done, 12);
  const SweepReport second = run(sweep, {.folder = path("ended")});
  EXPECT_TRUE(second.complete);
  EXPECT_EQ(second.run_here, 12 - first.done);
  EXPECT_EQ(results("ended"), results("whole"));
  EXPECT_EQ(run(sweep, {.folder = path("ended")}).run_here, 0);
}

TEST_F(SweepFolder, EndsWithinAMember) {
  long asked = 0;
  SweepOptions ended{.folder = path("ended"), .threads = 1};
  ended.goes_on = [&] { return ++asked < 3; };  // before the first member, at its start, at its next node
  EXPECT_EQ(run(orbit_sweep(), ended).done, 0);
  EXPECT_LE(asked, 6);
}

TEST_F(SweepFolder, ADamagedBlockIsRunAgain) {
  const Sweep sweep = orbit_sweep();
  (void)run(sweep, {.folder = path("out")});
  const std::string expected = results("out"), block = path("out/blocks/000000000003.csv");
  std::string text = contents(block);
  text[text.size() - 20] ^= 1;
  std::ofstream(block) << text;
  const SweepReport report = run(sweep, {.folder = path("out")});
  ASSERT_EQ(report.messages.size(), 1u);
  expect_parts(report.messages[0], {"000000000003.csv", "not whole"});
  EXPECT_EQ(report.run_here, 3);
  EXPECT_EQ(results("out"), expected);
}

TEST_F(SweepFolder, HoldsOneSweep) {
  const Sweep sweep = orbit_sweep();
  (void)run(sweep, {.folder = path("out")});
  std::string changed = orbits;
  changed.replace(changed.find("seed = 5"), 8, "seed = 6");
  const Sweep other = read_sweep(write("other.toml", changed));
  expect_misuse([&] { (void)run(other, {.folder = path("out")}); }, {"another sweep", "sweep file"});
  std::filesystem::create_directory(path("full"));
  write("full/notes.txt", "x");
  expect_misuse([&] { (void)run(sweep, {.folder = path("full")}); }, {"full", "not empty"});
  expect_misuse([&] { (void)run(sweep, {.folder = path("none/out")}); }, {"none/out", "No such file"});
  expect_misuse([&] { (void)run(sweep, {.folder = path("out"), .part = 4, .parts = 3}); }, {"part 4 of 3"});
}

}  // namespace
}  // namespace diracstep::testing
