#include <dlfcn.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <cstdlib>
#include <diracstep/scene_format/loader/kernel_library.hpp>
#include <diracstep/scene_format/loader/shipped_scenes.hpp>
#include <filesystem>
#include <fstream>
#include <sstream>

extern char** environ;

namespace diracstep {

namespace {

namespace fs = std::filesystem;
using scene_compiler::CompiledKernel;
using scene_compiler::SceneProgram;

std::string variable(const char* name) {
  const char* value = std::getenv(name);
  return value == nullptr ? "" : value;
}

/// Empty where there is no place for one.
fs::path cache_directory() {
  if (const std::string own = variable("DIRACSTEP_CACHE"); !own.empty()) return own;
  if (const std::string cache = variable("XDG_CACHE_HOME"); !cache.empty())
    return fs::path(cache) / "diracstep";
  if (const std::string home = variable("HOME"); !home.empty())
    return fs::path(home) / ".cache" / "diracstep";
  return {};
}

std::vector<std::string> compilers() {
  if (const std::string own = variable("DIRACSTEP_CC"); !own.empty()) return {own};
  return {"cc", "gcc", "clang"};
}

/// Runs a program without a shell, its messages in a file; its exit status, or -1 where it does not start.
int run(const std::vector<std::string>& command, const fs::path& messages) {
  std::vector<char*> arguments;
  for (const auto& part : command) arguments.push_back(const_cast<char*>(part.c_str()));
  arguments.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, 0, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_addopen(&actions, 1, "/dev/null", O_WRONLY, 0);
  posix_spawn_file_actions_addopen(&actions, 2, messages.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
  pid_t child = 0;
  const int error = posix_spawnp(&child, arguments[0], &actions, nullptr, arguments.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  if (error != 0) return -1;
  int status = 0;
  while (waitpid(child, &status, 0) < 0)
    if (errno != EINTR) return -1;
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

std::string first_line(const fs::path& path) {
  std::ifstream file(path);
  std::string line;
  std::getline(file, line);
  return line.substr(0, 200);
}

KernelLibrary opened(const fs::path& path, const SceneProgram& program, const std::string& origin) {
  const auto close = [](void* handle) {
    if (handle != nullptr) dlclose(handle);
  };
  std::shared_ptr<void> handle(dlopen(path.c_str(), RTLD_NOW | RTLD_LOCAL), close);
  if (!handle) return {};
  void* const table = dlsym(handle.get(), ("diracstep_kernels_" + program.name).c_str());
  return {static_cast<const CompiledKernel*>(table), handle, origin};
}

/// Empty, or why it failed.
std::string compile(const SceneProgram& program, const fs::path& object) {
  static std::atomic<int> number = 0;
  const fs::path work = object.string() + fmt::format(".{}.{}", getpid(), number++);
  const fs::path source = work.string() + ".c", messages = work.string() + ".txt";
  {
    std::ofstream file(source, std::ios::binary);
    file << program.source;
    file.close();
    if (!file) return fmt::format("{} cannot be written", source.string());
  }
  std::string failure = "no C compiler was found (cc, gcc or clang; Debian: apt-get install gcc libc6-dev)";
  if (!variable("DIRACSTEP_CC").empty())
    failure = fmt::format("DIRACSTEP_CC={} could not be run", variable("DIRACSTEP_CC"));
  for (const auto& compiler : compilers()) {
    const int status = run({compiler, "-std=c11", "-O3", "-ffp-contract=off", "-fno-math-errno", "-fPIC",
                            "-shared", "-w", "-o", work.string(), source.string(), "-lm"},
                           messages);
    if (status == -1 || status == 127) continue;
    std::error_code ignored;
    if (status == 0) {
      fs::rename(work, object, ignored);  // at once: another process may be doing the same
      failure = ignored ? fmt::format("{} cannot be written", object.string()) : "";
    } else {
      failure = fmt::format("{} failed: {}", compiler, first_line(messages));
    }
    break;
  }
  std::error_code ignored;
  for (const auto& leftover : {work, source, messages}) fs::remove(leftover, ignored);
  return failure;
}

}  // namespace

KernelLibrary kernel_library(const SceneProgram& program) {
  if (variable("DIRACSTEP_CC") == "none") return {.origin = "interpreted, as DIRACSTEP_CC=none asks for"};
  for (const ShippedScene& shipped : shipped_scenes())
    if (shipped.program == program.name) return {shipped.kernels, {}, "compiled with the library"};
  const fs::path directory = cache_directory();
  if (directory.empty())
    return {.origin = "interpreted, slowly: no cache directory; set DIRACSTEP_CACHE, XDG_CACHE_HOME or HOME"};
  const fs::path object = directory / (program.name + ".so");
  if (KernelLibrary found = opened(object, program, "compiled, from the cache"); found.kernels) return found;
  std::error_code error;
  fs::create_directories(directory, error);
  const std::string failure = compile(program, object);
  if (!failure.empty()) return {.origin = "interpreted, slowly: " + failure};
  KernelLibrary made = opened(object, program, "compiled now");
  if (made.kernels) return made;
  return {.origin = fmt::format("interpreted, slowly: {} cannot be loaded", object.string())};
}

}  // namespace diracstep
