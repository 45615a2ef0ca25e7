#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cmath>
#include <csignal>
#include <random>
#include <thread>

#include "run_command.hpp"

/// Runs that end in every way a run can: by signals, at a full disk, by a power cut.  Whatever ended them,
/// the trajectory of the resumed run has the bytes of one that never stopped.
namespace diracstep::testing {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;

/// The command as a process of its own, with standard error in a file.
class Started {
 public:
  Started(const std::string& arguments, const std::string& messages, const std::string& before = "") {
    const std::string line =
        before + " exec '" DIRACSTEP_COMMAND "' " + arguments + " >/dev/null 2>'" + messages + "'";
    process_ = fork();
    if (process_ != 0) return;
    execl("/bin/sh", "sh", "-c", line.c_str(), static_cast<char*>(nullptr));
    _exit(127);
  }
  ~Started() {
    if (process_ > 0 && !ended_) end(SIGKILL);
  }
  Started(const Started&) = delete;
  Started& operator=(const Started&) = delete;

  void send(int signal) const { kill(process_, signal); }
  /// The exit status, or minus the signal that ended it.
  int wait() {
    int status = 0;
    while (waitpid(process_, &status, 0) < 0 && errno == EINTR) {
    }
    ended_ = true;
    return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
  }
  int end(int signal) {
    send(signal);
    return wait();
  }
  /// After ends_within().
  int status() const { return status_; }
  bool ends_within(std::chrono::milliseconds time) {
    const auto deadline = std::chrono::steady_clock::now() + time;
    int status = 0;
    while (std::chrono::steady_clock::now() < deadline) {
      if (waitpid(process_, &status, WNOHANG) == process_) {
        status_ = WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
        return ended_ = true;
      }
      std::this_thread::sleep_for(5ms);
    }
    return false;
  }

 private:
  pid_t process_ = -1;
  bool ended_ = false;
  int status_ = 0;
};

class Endings : public Command {
 protected:
  struct Motion {
    std::string what;
    int every;
  };
  const std::vector<Motion> motions{
      {"run pendulum_cartesian --method type1/midpoint --step 0.01 --end 150", 1},
      {"run knife_edge --method type1/gl:3 --step 0.01 --end 80 --momentum minus", 7},
      {"run kepler_e06 --order 4 --method type1/trapezoidal --step 0.005 --end 60 --momentum plus", 3},
      {"run hanging_chain --set N=12 --method type1/gl:2 --step 0.005 --end 8", 50}};

  /// Whether the results are to be believed is not asked here.
  std::string files(const Motion& motion, const std::string& name) const {
    return motion.what + " --doubt ignore --every " + std::to_string(motion.every) + " --out '" + path(name) +
           "'";
  }

  std::string uninterrupted(const Motion& motion) {
    EXPECT_EQ(run(files(motion, "whole.csv")).status, 0) << motion.what;
    return contents(path("whole.csv"));
  }

  /// Ends the run in a random way until it gets through; how often it was ended.
  int end_until_done(const Motion& motion, std::mt19937& random) {
    for (const char* name : {"k.csv", "c"}) fs::remove(path(name));
    const std::vector<int> signals{SIGINT, SIGTERM, SIGHUP, SIGKILL, 0};
    const std::vector<std::string> often{" --checkpoint-every 1", " --checkpoint-every 97", ""};
    for (int ends = 0; ends < 400; ++ends) {
      const std::string mode = fs::exists(path("c")) ? " --resume '" : " --checkpoint '";
      const std::string line =
          files(motion, "k.csv") + mode + path("c") + "'" + often[random() % often.size()];
      const int signal = signals[random() % signals.size()];
      // in units of 512 bytes beyond what is there: the file cannot grow further
      const auto there = fs::exists(path("k.csv")) ? fs::file_size(path("k.csv")) / 512 : 0;
      const std::string limit =
          signal == 0 ? "ulimit -f " + std::to_string(there + 64 + random() % 400) + ";" : "";
      Started process(line, path("err"), limit);
      const auto moment =
          std::chrono::microseconds(5000 + random() % 60000 + 3000 * static_cast<unsigned>(ends));
      std::this_thread::sleep_for(moment);
      if (signal != 0) process.send(signal);
      const int status = process.wait();
      if (status == 0) return ends;
      EXPECT_TRUE(status == 1 || status == -signal) << status << ' ' << line << '\n' << contents(path("err"));
      const std::string written = contents(path("k.csv"));
      // the system may end write(2) in the middle where the process is killed
      EXPECT_TRUE(signal == SIGKILL || written.empty() || written.back() == '\n') << "half a line";
    }
    ADD_FAILURE() << "never done: " << contents(path("err"));
    return 0;
  }

  void end_and_compare(int wanted, unsigned seed) {
    std::mt19937 random(seed);
    int ends = 0, chains = 0;
    std::vector<std::string> whole;
    for (const Motion& motion : motions) whole.push_back(uninterrupted(motion));
    while (ends < wanted && chains < 20 * wanted) {
      const std::size_t which = static_cast<std::size_t>(chains++) % motions.size();
      ends += end_until_done(motions[which], random);
      ASSERT_EQ(contents(path("k.csv")), whole[which]) << "chain " << chains << " of " << motions[which].what;
      EXPECT_FALSE(fs::exists(path("c.new")) && fs::is_symlink(path("c.new")));
    }
    RecordProperty("ends", ends);
    RecordProperty("chains", chains);
    std::printf("%d ends in %d chains\n", ends, chains);
    EXPECT_GE(ends, wanted);
  }
};

TEST_F(Endings, OfEveryKindLeaveTheSameBytes) { end_and_compare(24, 1); }
TEST_F(Endings, AThousandOfThemLeaveTheSameBytes_slow) { end_and_compare(1000, 2); }

/// The interrupt comes at a step whose point is kept: with --every 1 each one is.
TEST_F(Endings, APointIsNotKeptTwice) {
  const Motion motion{"run pendulum_cartesian --method type1/midpoint --step 0.01 --end 400", 1};
  const std::string whole = uninterrupted(motion);
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
    for (const char* name : {"k.csv", "c"}) fs::remove(path(name));
    Started process(files(motion, "k.csv") + " --checkpoint '" + path("c") + "'", path("err"));
    while (contents(path("k.csv")).size() < 100000 && !process.ends_within(1ms)) {
    }
    ASSERT_EQ(process.end(signal), 1) << "over before the signal came, or it saved nothing";
    ASSERT_TRUE(fs::exists(path("c"))) << signal;
    ASSERT_EQ(run(files(motion, "k.csv") + " --resume '" + path("c") + "'").status, 0);
    EXPECT_EQ(contents(path("k.csv")), whole) << signal;
  }
}

TEST_F(Endings, ASecondSignalEndsAtOnceInEveryPhase) {
  const std::string compiler = path("slow_cc");
  std::ofstream(compiler) << "#!/bin/sh\nsleep 100 & echo $! >'" << path("child") << "'\nwait\n";
  fs::permissions(compiler, fs::perms::owner_all);
  ASSERT_EQ(run("new '" + path("s") + "'").status, 0) << "a scene whose kernels are not known yet";
  const std::string own = "DIRACSTEP_CACHE='" + path("cache") + "' DIRACSTEP_CC='" + compiler + "'";
  struct Phase {
    std::string line, before;
  };
  for (const Phase& phase :
       {Phase{"run pleiades --error 1e-13 --end 3", ""},
        Phase{"run kepler_e06 --adaptive --eps 0.0001 --end 1e6", ""},
        Phase{"run kepler_e06 --end 1e9 --step 0.001 --checkpoint '" + path("c") + "'", ""},
        Phase{"run '" + path("s.toml") + "'", own}}) {
    Started process(phase.line, path("err"), phase.before);
    std::this_thread::sleep_for(300ms);
    process.send(SIGINT);
    std::this_thread::sleep_for(250ms);
    process.send(SIGTERM);
    EXPECT_TRUE(process.ends_within(1s)) << phase.line;
  }
  ASSERT_TRUE(fs::exists(path("child"))) << "the compiler was not run";
  const std::string child = contents(path("child"));
  const auto runs = [&] {  // an ended process whose parent has not asked is a zombie
    const std::string state = contents("/proc/" + std::to_string(std::stoi(child)) + "/stat");
    return !state.empty() && state.find(") Z") == std::string::npos;
  };
  for (int i = 0; i < 300 && runs(); ++i) std::this_thread::sleep_for(10ms);
  EXPECT_FALSE(runs()) << "what the compiler started outlives the run";
}

TEST_F(Endings, ALimitOfTimeEndsARunAsAnInterruptDoes) {
  const std::string what =
      "run kepler_e06 --method type1/midpoint --step 0.001 --every 1000 --out '" + path("k.csv") + "'";
  const auto begin = std::chrono::steady_clock::now();
  const Outcome ended = run(what + " --end 1e6 --max-time 0.3 --checkpoint '" + path("c") + "'");
  EXPECT_LT(std::chrono::steady_clock::now() - begin, 20s);
  EXPECT_EQ(ended.status, 1);
  EXPECT_NE(ended.err.find("stopped by --max-time at t = "), std::string::npos) << ended.err;
  EXPECT_TRUE(fs::exists(path("c")));
  const std::string variable = "run kepler_e099 --adaptive --end 20 ";
  const Outcome slow = run(variable + "--eps 1e-6 --max-time 0.3"), many = run(variable + "--max-steps 20");
  EXPECT_EQ(slow.status, 1);
  EXPECT_NE(slow.err.find("stopped by --max-time at t = "), std::string::npos) << slow.err;
  EXPECT_EQ(many.status, 1);
  EXPECT_NE(many.err.find("20 steps did not reach the end"), std::string::npos) << many.err;
  expect_misuse("run kepler_e06 --smallest-step 0.1", {"--adaptive"});
  expect_misuse("run kepler_e06 --error 1e-5 --max-steps 1000", {"--max-solves"});
  expect_misuse("run kepler_e06 --max-time 0", {"--max-time = 0"});
  expect_misuse("run kepler_e06 --end 1000 --step 0.001 --max-steps 1000", {"1000000 steps", "--max-steps"});
}

#if !defined(DIRACSTEP_ADDRESS_SANITIZER)  // whose library must be the first one loaded
/// A disk may lose what was not synchronised, and may take names before bytes: every call of a run that
/// changes files is the last one before a power cut, with the old names and with the new ones.
TEST_F(Endings, APowerCutBeforeAnyWriteLeavesWhatCanBeResumed_slow) {
  const Motion motion{"run knife_edge --method type1/gl:2 --step 0.02 --end 12", 2};
  const std::string control = " --checkpoint-every 40 --checkpoint '", whole = uninterrupted(motion);
  int cuts = 0, resumed = 0;
  for (const char* names : {"old", "new"})
    for (int call = 1;; ++call) {
      const fs::path live = path("live"), disk = path("disk");
      for (const fs::path& folder : {live, disk}) {
        fs::remove_all(folder);
        fs::create_directory(folder);
      }
      const std::string out = motion.what + " --doubt ignore --every 2 --out '";
      const Outcome cut =
          run(out + (live / "k.csv").string() + "'" + control + (live / "c").string() + "'",
              "LD_PRELOAD='" DIRACSTEP_FAULTS "/power_cut.so' DIRACSTEP_POWER_FOLDER='" + live.string() +
                  "' DIRACSTEP_POWER_AFTER='" + disk.string() + "' DIRACSTEP_POWER_NAMES=" + names +
                  " DIRACSTEP_POWER_CALL=" + std::to_string(call));
      if (cut.status == 0) break;
      ASSERT_EQ(cut.status, 137) << cut.err;
      ++cuts;
      fs::remove(disk / "c.lock");
      const bool saved = fs::exists(disk / "c");
      resumed += saved ? 1 : 0;
      const Outcome rest = run(out + (disk / "k.csv").string() + "'" + (saved ? " --resume '" : control) +
                               (disk / "c").string() + "'");
      ASSERT_EQ(rest.status, 0) << names << " names, call " << call << ": " << rest.err;
      ASSERT_EQ(contents(disk / "k.csv"), whole) << names << " names, call " << call;
    }
  std::printf("%d power cuts, %d of them resumed\n", cuts, resumed);
  EXPECT_GT(cuts, 50);
  EXPECT_GT(resumed, cuts / 2);
}
#endif

/// Phases that last: a reference and a baseline of IDA, a fit, boundary values, controls.
TEST_F(Endings, EveryVerbEndsSoonAfterASignalAndSaysSo) {
  const std::string swing = scene("swing", R"toml(
lagrangian = "v_x^2/2 - k*x^2/2"
coordinates = { x = {} }
parameters = { k = 1.3 }
start = { x = 1 }
span = { end = 100, step = 0.0001 }
)toml");
  std::string measured = "t,x\n";
  for (int k = 1; k <= 10; ++k)
    measured += std::to_string(10 * k) + "," + std::to_string(std::cos(10.0 * k * std::sqrt(1.2))) + "\n";
  std::ofstream(path("measured.csv")) << measured;
  const std::string controlled = scene("controlled", R"toml(
lagrangian = "v_x^2/2 + cos(x)"
coordinates = { x = {} }
parameters = { u = 0 }
force = { x = "u" }
span = { end = 10, step = 0.005 }
control = { parameters = ["u"], cost = "u^2" }
)toml");
  struct Verb {
    std::string line;
    std::chrono::milliseconds before;  ///< the signal: to come to the phase that lasts
  };
  std::vector<Verb> verbs{{"study steering_table --methods type1/gl:2 --out '" + path("study") + "'", 3s},
                          {"fit " + swing + " '" + path("measured.csv") + "' --parameters k", 500ms},
                          {"boundary " + swing + " --from x=1 --to x=0.3 --end 20 --step 1e-4", 500ms},
                          {"control " + controlled + " --to x=1 v_x=0", 500ms},
                          {"check --scenes", 500ms},
                          {"orders", 500ms}};
  if (run("study kepler_e06 --sensitivities --end 0.01").status == 0)  // where SUNDIALS has IDAS
    verbs.push_back({"study kepler_e06 --sensitivities --end 1e5", 500ms});
  const std::string messages = path("messages");
  for (const Verb& verb : verbs) {
    Started process(verb.line, messages);
    std::this_thread::sleep_for(verb.before);
    process.send(SIGTERM);
    ASSERT_TRUE(process.ends_within(15s)) << verb.line << ": most of it is for a loaded machine";
    EXPECT_EQ(process.status(), 1) << verb.line;
    EXPECT_NE(contents(messages).find("interrupted"), std::string::npos) << verb.line << contents(messages);
  }
}

/// In the middle of the factorisation of a matrix of ten million unknowns, of which nothing can be kept.
TEST_F(Endings, ALargeFactorisationEndsWithinSecondsOfASignal_slow) {
  const std::string messages = path("messages");
  Started process("boundary kepler_e06 --from x=1 y=0 --to x=-0.3 y=1.1 --end 2.1 --step 1e-6", messages);
  std::this_thread::sleep_for(3s);
  process.send(SIGINT);
  ASSERT_TRUE(process.ends_within(5s));
  EXPECT_EQ(process.status(), 1);
  EXPECT_NE(contents(messages).find("interrupted"), std::string::npos) << contents(messages);
}

}  // namespace
}  // namespace diracstep::testing
