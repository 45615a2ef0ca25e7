#include <gtest/gtest.h>

#include <chrono>
#include <set>
#include <thread>

#include "run_command.hpp"

/// Calls of the system and of the allocator that fail one after another, and plugins that do not come back:
/// told, with status 0, 1 or 2 and no abort, and files from which the run goes on with the same bytes.
namespace diracstep::testing {
namespace {

namespace fs = std::filesystem;

class Faults : public Command {
 protected:
  struct Task {
    std::string line;                     ///< of a run, without its files
    bool checkpoints;                     ///< a run with checkpoints, resumed after each fault
    std::vector<std::string> files = {};  ///< of anything else: whole or not there
  };
  const Task run_task{
      "run knife_edge --method type1/gl:2 --step 0.05 --end 3 --every 2 --doubt ignore --json", true};

  std::string folder() const { return path("w"); }
  std::string file(const std::string& name) const { return folder() + "/" + name; }

  void clear() const {
    fs::remove_all(folder());
    fs::create_directory(folder());
  }

  static std::string preload(const std::string& kind, const std::string& more) {
    return "LD_PRELOAD='" DIRACSTEP_FAULTS "/failing_calls.so' DIRACSTEP_FAULT_KIND=" + kind + " " + more;
  }

  std::string first(const Task& task) const {
    if (!task.checkpoints) return task.line;
    return task.line + " --out '" + file("k.csv") + "' --checkpoint-every 20 --checkpoint '" + file("c") +
           "'";
  }

  /// The number of each call that comes from a place of its own.
  std::vector<long> places(const Task& task, const std::string& kind) const {
    clear();
    EXPECT_EQ(run(first(task), preload(kind, "DIRACSTEP_FAULT_COUNTS='" + path("counts") + "'")).status, 0);
    std::istringstream numbers(contents(path("counts")));
    std::vector<long> all;
    for (long number; numbers >> number;) all.push_back(number);
    EXPECT_GT(all.size(), 10u);
    return all;
  }

  /// Lets call number `call` fail, and all later ones where `lasting`; then the task is done again.
  void fail_and_recover(const Task& task, const std::string& kind, long call, bool lasting,
                        const std::string& whole) {
    clear();
    const std::string what = kind + ", call " + std::to_string(call) + (lasting ? " and all later ones" : "");
    const Outcome outcome =
        run(first(task), preload(kind, "DIRACSTEP_FAULT_CALL=" + std::to_string(call) +
                                           (lasting ? " DIRACSTEP_FAULT_LASTING=1" : "")));
    ASSERT_TRUE(outcome.status >= 0 && outcome.status <= 2)
        << what << ": status " << outcome.status << outcome.err;
    if (outcome.status != 0 && fs::is_empty(folder())) return;  // as before the task
    if (!task.checkpoints) {
      const Outcome again = run(task.line);
      ASSERT_EQ(again.status, 0) << what << again.err;
      for (const std::string& name : task.files) ASSERT_TRUE(fs::exists(file(name))) << what << name;
      return;
    }
    if (outcome.status == 0) {
      ASSERT_EQ(contents(file("k.csv")), whole) << what << ": said to be done";
    }
    const bool saved = fs::exists(file("c"));
    const std::string rest =
        saved ? task.line + " --out '" + file("k.csv") + "' --resume '" + file("c") + "'" : first(task);
    const Outcome resumed = run(rest);
    ASSERT_EQ(resumed.status, 0) << what << ": " << resumed.err;
    ASSERT_EQ(contents(file("k.csv")), whole) << what;
  }

  void fail_everywhere(const Task& task, const std::string& kind, std::size_t stride) {
    clear();
    ASSERT_EQ(run(first(task)).status, 0);
    const std::string whole = task.checkpoints ? contents(file("k.csv")) : "";
    const std::vector<long> all = places(task, kind);
    int faults = 0;
    for (std::size_t i = 0; i < all.size(); i += stride)
      for (const bool lasting : {false, true}) {
        ++faults;
        fail_and_recover(task, kind, all[i], lasting, whole);
        if (HasFatalFailure()) return;
      }
    std::printf("%s: %d faults at %zu places\n", kind.c_str(), faults, all.size());
  }
};

#if !defined(DIRACSTEP_ADDRESS_SANITIZER)  // whose library must be the first one loaded
TEST_F(Faults, OfTheSystemAreToldAndLeaveWholeFiles) { fail_everywhere(run_task, "io", 4); }
TEST_F(Faults, OfTheAllocatorAreToldAndLeaveWholeFiles) { fail_everywhere(run_task, "memory", 97); }
TEST_F(Faults, OfTheSystemAtEveryPlaceOfARun_slow) { fail_everywhere(run_task, "io", 1); }
TEST_F(Faults, OfTheAllocatorAtEveryPlaceOfARun_slow) { fail_everywhere(run_task, "memory", 1); }

TEST_F(Faults, OfASceneFile_slow) {
  ASSERT_EQ(run("new '" + path("s") + "'").status, 0);
  setenv("DIRACSTEP_CACHE", path("cache").c_str(), 1);
  const Task task{"run '" + path("s.toml") + "' --step 0.05 --end 1 --json", true};
  ASSERT_EQ(run(task.line).status, 0);  // compiled, so that the cache is read
  fail_everywhere(task, "io", 1);
  fail_everywhere(task, "memory", 3);
  unsetenv("DIRACSTEP_CACHE");
}

TEST_F(Faults, OfAStudy_slow) {
  const Task task{"study knife_edge --methods type1/midpoint --steps 0.2 --rtols 1e-4 --repeat 1 --out '" +
                      file("out") + "' --table '" + file("t.md") + "'",
                  false,
                  {"out/study.csv", "out/study.json", "out/report.html", "t.md"}};
  const std::string folders = getenv("PATH");
  setenv("PATH", "/none", 1);  // gnuplot would take most of the time
  fail_everywhere(task, "io", 1);
  fail_everywhere(task, "memory", 23);
  setenv("PATH", folders.c_str(), 1);
}
#endif

class EndingPlugin : public Command {
 protected:
  std::string line(const std::string& more) const {
    return "run kepler_e06 --method type1/ending --step 0.05 --end 10 --doubt ignore --out '" +
           path("k.csv") + "' --plugin '" + DIRACSTEP_TEST_PLUGINS "/ending.so'" + more;
  }
  std::string saving() const { return line(" --checkpoint '" + path("c") + "' --checkpoint-every 10"); }

  /// The run goes on with the same plugin once that behaves.
  void expect_whole_files() const {
    const std::string resumed = line(" --resume '" + path("c") + "'");
    const Outcome rest = run(resumed);
    ASSERT_EQ(rest.status, 0) << rest.err;
    const std::string after = contents(path("k.csv"));
    ASSERT_EQ(run(line("")).status, 0);
    EXPECT_EQ(after, contents(path("k.csv")));
  }
};

TEST_F(EndingPlugin, ThatExitsIsTold) {
  const Outcome outcome = run(saving(), "ENDING=exit");
  EXPECT_EQ(outcome.status, 1);
  EXPECT_NE(outcome.err.find("ended the program"), std::string::npos) << outcome.err;
  expect_whole_files();
}

TEST_F(EndingPlugin, ThatReturnsAnErrorIsTold) {
  const Outcome outcome = run(saving(), "ENDING=error");
  EXPECT_EQ(outcome.status, 1);
  EXPECT_NE(outcome.err.find("error 7"), std::string::npos) << outcome.err;
  expect_whole_files();
}

TEST_F(EndingPlugin, ThatLoopsIsToldAndEndedByALimitOrASecondSignal) {
  const auto begin = std::chrono::steady_clock::now();
  const Outcome limited = run(saving() + " --max-time 2", "ENDING=loop");
  EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(20));
  EXPECT_EQ(limited.status, 1);
  EXPECT_NE(limited.err.find("does not end"), std::string::npos) << limited.err;
  expect_whole_files();

  fs::remove(path("c"));
  // INT once it loops, soon after its first checkpoint, a message within a second, and TERM
  const std::string looping =
      "ENDING=loop '" DIRACSTEP_COMMAND "' " + saving() + " 2>'" + path("told") + "' & ";
  const Outcome twice =
      run("--version >/dev/null; " + looping + "until [ -e '" + path("c") +
          "' ]; do sleep 0.1; done; sleep 0.5; kill -INT $!; sleep 1.5; kill -TERM $!; wait $!; echo $?");
  EXPECT_NE(twice.out.find("143"), std::string::npos) << twice.out;
  EXPECT_NE(contents(path("told")).find("has not ended yet"), std::string::npos) << contents(path("told"));
  expect_whole_files();
}

}  // namespace
}  // namespace diracstep::testing
