#include <sys/mount.h>

#include <filesystem>
#include <fstream>

#include "run_command.hpp"

/// Every verb that writes, where there is no room: a clear error, status 1, and no file left half written.
namespace diracstep::testing {
namespace {

namespace fs = std::filesystem;

/// As sh limits the size of a file, in blocks of 512 bytes: what does not fit fails as on a full disk.
std::string limit(int blocks) { return "ulimit -f " + std::to_string(blocks) + ";"; }

class FullDisk : public Command {
 protected:
  void write(const std::string& name, const std::string& text) const { std::ofstream(path(name)) << text; }

  void expect_told(const Outcome& outcome, const std::string& name) const {
    EXPECT_EQ(outcome.status, 1) << outcome.err;
    EXPECT_NE(outcome.err.find(name), std::string::npos) << outcome.err;
    EXPECT_NE(outcome.err.find("could not be written in full"), std::string::npos) << outcome.err;
  }
};

TEST_F(FullDisk, ATrajectoryEndsWithAWholeLine) {
  expect_told(
      run("run knife_edge --method type1/midpoint --step 0.001 --end 10 --out " + path("k.csv"), limit(200)),
      "k.csv");
  const std::string written = contents(path("k.csv"));
  EXPECT_GT(written.size(), 1000u);
  EXPECT_EQ(written.back(), '\n');
}

TEST_F(FullDisk, APictureStaysWhereTheNextOneHasNoRoom) {
  if (std::system("command -v gnuplot >/dev/null") != 0) GTEST_SKIP() << "gnuplot is missing";
  const std::string line = "equilibrium hanging_chain --picture '" + path("p") + "'";
  ASSERT_EQ(run(line).status, 0);
  const std::string picture = contents(path("p.svg"));
  EXPECT_EQ(run(line, limit(2)).status, 1);
  EXPECT_EQ(contents(path("p.svg")), picture);
}

TEST_F(FullDisk, TheLastCheckpointStaysAndTheRunCanGoOn) {
  const std::string whole = "run knife_edge --method type1/gl:2 --step 0.01 --end 100 --json";
  const std::string files = " --out " + path("k.csv") + " --checkpoint-every 100";
  ASSERT_EQ(run(whole + " --out " + path("whole.csv")).status, 0);
  expect_told(run(whole + files + " --checkpoint " + path("c"), limit(500)), "k.csv");
  ASSERT_TRUE(fs::exists(path("c")));
  EXPECT_FALSE(fs::exists(path("c.new")));
  const Outcome rest = run(whole + files + " --resume " + path("c"));
  EXPECT_EQ(rest.status, 0) << rest.err;
  EXPECT_EQ(contents(path("k.csv")), contents(path("whole.csv")));
}

TEST_F(FullDisk, ACheckpointThatDoesNotFitLeavesTheOldOne) {
  const std::string what = "run hanging_chain --set N=25 --method type1/midpoint --step 0.005";
  ASSERT_EQ(run(what + " --end 0.05 --checkpoint " + path("c")).status, 0);
  const std::string before = contents(path("c"));
  ASSERT_GT(before.size(), 2048u);
  expect_told(run(what + " --end 0.1 --resume " + path("c"), limit(2)), path("c"));
  EXPECT_EQ(contents(path("c")), before);
  EXPECT_FALSE(fs::exists(path("c.new")));
}

TEST_F(FullDisk, AStudyKeepsWhatIsThere) {
  const std::string study = "study knife_edge --methods type1/midpoint --steps 0.1 --rtols 1e-4 --repeat 1";
  write("table.md", "before\n");
  expect_told(run(study + " --out " + path("out") + " --table " + path("table.md"), limit(4)), "out/");
  EXPECT_EQ(contents(path("table.md")), "before\n");
  for (const auto& entry : fs::recursive_directory_iterator(path("out")))
    EXPECT_NE(entry.path().extension(), ".new") << entry.path();
}

TEST_F(FullDisk, StabilityKeepsThePageAndTheDirectory) {
  const std::string page = "<!-- tables of diracstep stability -->\nold\n<!-- end of the tables -->\n";
  write("page.md", page);
  const std::string stability = "stability fput --set om=50 --methods type1/midpoint --without-ida";
  expect_told(run(stability + " --write " + path("page.md"), limit(1)), "page.md");
  EXPECT_EQ(contents(path("page.md")), page);
  expect_told(run(stability + " --out " + path("out"), limit(1)), "stability.json");
  EXPECT_FALSE(fs::exists(path("out/stability.json.new")));
}

TEST_F(FullDisk, ANewSceneIsWholeOrNotThere) {
  const Outcome outcome = run("new " + path("mine"), limit(1));
  EXPECT_EQ(outcome.status, 1) << outcome.err;
  EXPECT_NE(outcome.err.find("could not be written in full"), std::string::npos) << outcome.err;
  EXPECT_FALSE(fs::exists(path("mine.toml")));
}

TEST_F(FullDisk, ADeviceIsWrittenToAndNotReplaced) {
  expect_told(run("run knife_edge --end 1 --checkpoint /dev/full"), "/dev/full");
  EXPECT_TRUE(fs::is_character_file("/dev/full"));
  EXPECT_EQ(run("run knife_edge --end 1 --checkpoint /dev/null").status, 0);
  EXPECT_TRUE(fs::is_character_file("/dev/null"));
}

TEST_F(FullDisk, ALinkStaysALink) {
  write("real", "");
  fs::create_symlink(path("real"), path("link"));
  ASSERT_EQ(run("run knife_edge --end 1 --checkpoint " + path("link")).status, 0);
  EXPECT_TRUE(fs::is_symlink(path("link")));
  EXPECT_GT(fs::file_size(path("real")), 100u);
}

TEST_F(FullDisk, UnwritableFoldersAreNamed) {
  write("file", "");
  const std::string nowhere = path("file") + "/x";
  for (const char* what : {"run knife_edge --end 1 --out ", "run knife_edge --end 1 --checkpoint ",
                           "study knife_edge --out ", "stability fput --out ", "stability fput --write "}) {
    const Outcome outcome = run(what + nowhere);
    EXPECT_EQ(outcome.status, 2) << what;
    EXPECT_NE(outcome.err.find(nowhere), std::string::npos) << what << outcome.err;
  }
  const Outcome scene = run("new " + nowhere);
  EXPECT_NE(scene.status, 0);
  EXPECT_NE(scene.err.find(nowhere), std::string::npos) << scene.err;
  const Outcome table =
      run("study knife_edge --methods type1/midpoint --steps 0.1 --rtols 1e-4 --repeat 1 --table " + nowhere);
  EXPECT_EQ(table.status, 2);
  EXPECT_NE(table.err.find(nowhere), std::string::npos) << table.err;
}

/// A file system of 64 KiB, where one may be mounted.
TEST_F(FullDisk, AFullFileSystemIsTold) {
  const std::string folder = path("small");
  fs::create_directory(folder);
  if (::mount("tmpfs", folder.c_str(), "tmpfs", 0, "size=64k") != 0) GTEST_SKIP() << "no mounts here";
  const Outcome outcome = run("run knife_edge --method type1/midpoint --step 0.001 --end 10 --out " + folder +
                              "/k.csv --checkpoint " + folder + "/c");
  const std::string written = contents(folder + "/k.csv");
  ::umount(folder.c_str());
  expect_told(outcome, folder);
  EXPECT_NE(outcome.err.find("No space left"), std::string::npos) << outcome.err;
  ASSERT_FALSE(written.empty());
  EXPECT_EQ(written.back(), '\n');
}

}  // namespace
}  // namespace diracstep::testing
