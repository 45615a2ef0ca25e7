#include <gtest/gtest.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <cstdlib>
#include <diracstep/core/integrator/integrator.hpp>
#include <diracstep/core/system/stage_kernel.hpp>
#include <diracstep/scene_format/loader/compiler_process.hpp>
#include <diracstep/scene_format/loader/kernel_cache.hpp>
#include <diracstep/scene_format/scene_file.hpp>
#include <diracstep/solvers/direct_solver.hpp>
#include <filesystem>
#include <fstream>
#include <map>
#include <optional>
#include <thread>

#include "temporary_folder.hpp"

/// What is loaded from the cache runs in this process: only what this user has compiled, whole, may be.
namespace diracstep::testing {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;

class Cache : public ::testing::Test {
 protected:
  Cache() { set("DIRACSTEP_CACHE", cache().string()); }
  ~Cache() override {
    for (const auto& [name, value] : before_)
      value ? setenv(name.c_str(), value->c_str(), 1) : unsetenv(name.c_str());
  }

  void set(const std::string& name, const std::string& value) {
    const char* const old = std::getenv(name.c_str());
    before_.try_emplace(name, old == nullptr ? std::nullopt : std::optional<std::string>(old));
    setenv(name.c_str(), value.c_str(), 1);
  }

  fs::path folder() const { return folder_.path(); }
  fs::path cache() const { return folder() / "cache"; }

  /// How the kernels of an oscillator were made; another `number` is another source.
  static std::string origin(int number = 1) { return oscillator(number).code; }

  static CatalogueScene oscillator(int number) {
    return scene_from_text(
        "s.toml", "name = \"s\"\nlagrangian = \"v_x^2/2 - " + std::to_string(number) +
                      "*x^4/7\"\n[coordinates]\nx = {}\n[start]\nx = 1\n[span]\nend = 1\nstep = 0.1\n");
  }

  static constexpr long worth_it = StageKernelSource::evaluations_worth_a_kernel;
  static bool has_stage_kernel(const CatalogueScene& entry, long evaluations = 0) {
    const auto* const source = dynamic_cast<const StageKernelSource*>(entry.scene->lagrangian.get());
    return source != nullptr && source->stage_kernel(nullptr, 3, evaluations).run != nullptr;
  }

  std::vector<fs::path> kept() const {
    std::vector<fs::path> all;
    for (const auto& entry : fs::directory_iterator(cache())) all.push_back(entry.path());
    return all;
  }

  void write_script(const fs::path& path, const std::string& text) const {
    std::ofstream(path) << "#!/bin/sh\n" << text;
    fs::permissions(path, fs::perms::owner_all);
  }

 private:
  TemporaryFolder folder_;
  std::map<std::string, std::optional<std::string>> before_;
};

/// A first short run does not wait for it.
TEST_F(Cache, AStageKernelIsCompiledWhereItIsWorthIt) {
  const CatalogueScene entry = oscillator(3);
  EXPECT_FALSE(has_stage_kernel(entry));
  EXPECT_EQ(kept().size(), 1u);
  EXPECT_TRUE(has_stage_kernel(entry, worth_it));
  EXPECT_EQ(kept().size(), 2u);
  EXPECT_TRUE(has_stage_kernel(entry));
  EXPECT_TRUE(has_stage_kernel(oscillator(3))) << "it is in the cache";
  set("DIRACSTEP_CC", "none");
  EXPECT_FALSE(has_stage_kernel(oscillator(3), worth_it));
}

TEST_F(Cache, ALongRunCompilesItsStageKernel) {
  const CatalogueScene entry = oscillator(4);
  Integrator steps(entry.scene, Registry::with_built_ins(), direct(), {.method = "type1/gl:3", .step = 0.01});
  const auto take = [&](int count) {
    for (int k = 0; k < count; ++k) ASSERT_TRUE(steps.step().ok());
  };
  take(1000);
  EXPECT_FALSE(has_stage_kernel(entry));
  take(1000000);
  EXPECT_TRUE(has_stage_kernel(entry));
}

/// As the members of an ensemble or a sweep, which share the file and no step.
TEST_F(Cache, ManyShortRunsCompileTheirStageKernel) {
  const SceneFile file("s.toml",
                       "name = \"s\"\nlagrangian = \"v_x^2/2 - a*x^4/7\"\n[coordinates]\nx = {}\n"
                       "[parameters]\na = 5\n[start]\nx = 1\n[span]\nend = 1\nstep = 0.1\n");
  const auto run = [&](int member) {
    const CatalogueScene entry = file.load({{"a", 5.0 + 0.01 * member}});
    Integrator steps(entry.scene, Registry::with_built_ins(), direct(),
                     {.method = "type1/gl:3", .step = 0.01});
    for (int k = 0; k < 1000; ++k) ASSERT_TRUE(steps.step().ok());
  };
  run(0);
  EXPECT_FALSE(has_stage_kernel(file.load({})));
  for (int member = 1; member < 500; ++member) run(member);
  EXPECT_TRUE(has_stage_kernel(file.load({})));
}

TEST_F(Cache, ADamagedObjectIsCompiledAnewAndNeverLoaded) {
  ASSERT_EQ(origin(), "compiled now");
  ASSERT_EQ(kept().size(), 1u) << "leftovers";
  const fs::path object = kept().front();
  const std::string whole = contents(object);
  struct stat status {};
  ASSERT_EQ(stat(object.c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 0777u, 0600u);
  const auto damage = [&](const std::string& bytes) {
    fs::remove(object);  // the old file is in use
    std::ofstream(object, std::ios::binary) << bytes;
    fs::permissions(object, fs::perms::owner_read | fs::perms::owner_write);
    EXPECT_EQ(origin(), "compiled now; what was in the cache is damaged");
    EXPECT_EQ(contents(object).size(), whole.size());
    EXPECT_EQ(origin(), "compiled, from the cache");
  };
  for (const std::size_t size :
       {std::size_t{0}, std::size_t{1}, std::size_t{8192}, whole.size() / 2, whole.size() - 1})
    damage(whole.substr(0, size));
  for (const std::size_t at : {std::size_t{0}, whole.size() / 3, whole.size() - 80, whole.size() - 1}) {
    std::string changed = whole;
    changed[at] = static_cast<char>(changed[at] ^ 1);
    damage(changed);
  }
  damage(whole + "x");
}

TEST_F(Cache, AnObjectThatOthersMayWriteOrOwnIsNotLoaded) {
  ASSERT_EQ(origin(), "compiled now");
  const fs::path object = kept().front();
  ASSERT_EQ(chmod(object.c_str(), 0622), 0);
  EXPECT_EQ(origin(), "compiled now; what was in the cache may be written by others");
  EXPECT_EQ(origin(), "compiled, from the cache");
  fs::rename(object, folder() / "elsewhere");
  fs::create_symlink(folder() / "elsewhere", object);
  EXPECT_EQ(origin(), "compiled now; what was in the cache is no regular file");
  if (geteuid() != 0) GTEST_SKIP() << "only root gives files away";
  ASSERT_EQ(chown(kept().front().c_str(), 65534, 65534), 0);
  EXPECT_EQ(origin(), "compiled now; what was in the cache belongs to another user");
  EXPECT_EQ(origin(), "compiled, from the cache");
}

TEST_F(Cache, AFolderThatOthersMayWriteOrOwnIsNotUsed) {
  fs::create_directories(cache());
  for (const mode_t mode : {0777u, 01777u, 0770u}) {
    ASSERT_EQ(chmod(cache().c_str(), mode), 0);
    EXPECT_NE(origin().find("compiled now; not kept: others may write to"), std::string::npos) << origin();
    EXPECT_TRUE(kept().empty());
  }
  ASSERT_EQ(chmod(cache().c_str(), 0700), 0);
  ASSERT_EQ(chmod(folder().c_str(), 0777), 0);
  EXPECT_NE(origin().find("others may write to"), std::string::npos) << "a folder above it: " << origin();
  ASSERT_EQ(chmod(folder().c_str(), 0700), 0);
  EXPECT_EQ(origin(), "compiled now");
  if (geteuid() != 0) GTEST_SKIP() << "only root gives folders away";
  ASSERT_EQ(chown(cache().c_str(), 65534, 65534), 0);
  EXPECT_NE(origin().find("belongs to another user"), std::string::npos) << origin();
  ASSERT_EQ(chown(cache().c_str(), 0, 0), 0);
}

TEST_F(Cache, IsMadeForThisUserAlone) {
  ASSERT_EQ(origin(), "compiled now");
  struct stat status {};
  ASSERT_EQ(stat(cache().c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 0777u, 0700u);
}

TEST_F(Cache, TheKeyHoldsTheCompiler) {
  write_script(folder() / "cc1", "exec cc \"$@\"\n");
  write_script(folder() / "cc2", "# another one\nexec cc \"$@\"\n");
  for (const char* name : {"cc1", "cc2"}) {
    set("DIRACSTEP_CC", (folder() / name).string());
    EXPECT_EQ(origin(), "compiled now") << name;
    EXPECT_EQ(origin(), "compiled, from the cache") << name;
  }
  EXPECT_EQ(kept().size(), 2u);
}

TEST_F(Cache, IsBoundedInSize) {
  ASSERT_EQ(origin(1), "compiled now");
  const auto size = fs::file_size(kept().front());
  set("DIRACSTEP_CACHE_BYTES", std::to_string(size * 5 / 2));
  std::ofstream(cache() / "notes.txt") << "of the user";
  for (int number = 2; number <= 5; ++number) ASSERT_EQ(origin(number), "compiled now");
  EXPECT_EQ(kept().size(), 3u) << "two objects and the user's own file";
  EXPECT_EQ(origin(5), "compiled, from the cache");
  EXPECT_EQ(origin(1), "compiled now") << "used longest ago";
}

TEST_F(Cache, ManyProcessesCompileTheSameAtOnce) {
  std::vector<pid_t> children;
  for (int i = 0; i < 8; ++i) {
    children.push_back(fork());
    if (children.back() == 0) _exit(origin().starts_with("compiled") ? 0 : 1);
  }
  for (const pid_t child : children) {
    int status = 0;
    waitpid(child, &status, 0);
    EXPECT_EQ(status, 0);
  }
  EXPECT_EQ(kept().size(), 1u) << "leftovers";
}

TEST_F(Cache, AFolderThatCannotBeWrittenCostsACompilationAndNothingElse) {
  set("DIRACSTEP_CACHE", "/proc/none");
  EXPECT_NE(origin().find("compiled now; not kept"), std::string::npos) << origin();
}

TEST_F(Cache, ACompilerThatHangsIsEndedWithItsChildren) {
  const fs::path child = folder() / "child";
  write_script(folder() / "cc", "sleep 1000 &\necho $! >'" + child.string() + "'\nsleep 1000\n");
  set("DIRACSTEP_CC", (folder() / "cc").string());
  set("DIRACSTEP_CC_SECONDS", "0.5");
  const auto begin = std::chrono::steady_clock::now();
  const std::string told = origin();
  EXPECT_LT(std::chrono::steady_clock::now() - begin, 10s);
  EXPECT_NE(told.find("interpreted"), std::string::npos) << told;
  EXPECT_NE(told.find("was ended after 0.5 s"), std::string::npos) << told;
  const auto runs = [&] {  // an ended process whose parent has not asked is a zombie
    const std::string state = contents("/proc/" + std::to_string(std::stoi(contents(child))) + "/stat");
    return !state.empty() && state.find(") Z") == std::string::npos;
  };
  for (int i = 0; i < 300 && runs(); ++i) std::this_thread::sleep_for(10ms);
  EXPECT_FALSE(runs()) << "its child outlives it";
}

TEST_F(Cache, ACompilerThatFailsOrDiesIsTold) {
  set("DIRACSTEP_CC", (folder() / "cc").string());
  write_script(folder() / "cc", "printf 'no \\033[31msuch flag\\n' >&2\nexit 3\n");
  EXPECT_NE(origin().find("failed: no \\u001b[31msuch flag"), std::string::npos) << origin();
  write_script(folder() / "cc", "kill -SEGV $$\n");
  EXPECT_NE(origin().find("ended by signal"), std::string::npos) << origin();
  std::ofstream(folder() / "cc") << "no program";
  EXPECT_NE(origin().find("interpreted"), std::string::npos) << origin();
  EXPECT_TRUE(kept().empty()) << "leftovers of compilers that failed";
}

TEST_F(Cache, ASourceAboveTheLimitIsInterpreted) {
  set("DIRACSTEP_LIMITS", "source_bytes=100");
  EXPECT_NE(origin().find("the limit for a compiler is 100"), std::string::npos) << origin();
}

}  // namespace
}  // namespace diracstep::testing
