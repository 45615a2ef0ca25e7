#include <diracstep/version.h>
#include <dlfcn.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cmath>
#include <cstdlib>
#include <diracstep/core/system/stage_kernel.hpp>
#include <diracstep/files/output_file.hpp>
#include <diracstep/files/sha256.hpp>
#include <diracstep/files/shown_text.hpp>
#include <diracstep/scene_format/compiler/size_limits.hpp>
#include <diracstep/scene_format/loader/compiler_process.hpp>
#include <diracstep/scene_format/loader/kernel_cache.hpp>
#include <diracstep/scene_format/loader/kernel_library.hpp>
#include <diracstep/scene_format/loader/shipped_scenes.hpp>
#include <filesystem>
#include <fstream>
#include <sstream>
#if defined(__GLIBC__)
#include <gnu/libc-version.h>
#endif

namespace diracstep {

namespace {

namespace fs = std::filesystem;
using scene_compiler::CompiledKernel;
using scene_compiler::CompiledStageKernel;
using scene_compiler::SceneProgram;
using scene_compiler::StageKernels;

constexpr std::array<const char*, 7> flags{"-std=c11", "-O3", "-ffp-contract=off", "-fno-math-errno", "-fPIC",
                                           "-shared",  "-w"};
constexpr double usual_seconds = 120.0;

double compiler_seconds() {
  const double given = std::strtod(environment("DIRACSTEP_CC_SECONDS").c_str(), nullptr);
  return std::isfinite(given) && given > 0.0 ? given : usual_seconds;
}

/// The first compiler there is, as a path; empty where there is none.
std::string found_compiler() {
  const std::string own = environment("DIRACSTEP_CC");
  const auto is_program = [](const std::string& path) { return ::access(path.c_str(), X_OK) == 0; };
  if (own.find('/') != std::string::npos) return is_program(own) ? own : "";
  std::vector<std::string> names{"cc", "gcc", "clang"};
  if (!own.empty()) names = {own};
  for (const std::string& name : names) {
    std::istringstream folders(environment("PATH"));
    for (std::string folder; std::getline(folders, folder, ':');)
      if (std::string path = fmt::format("{}/{}", folder, name); !folder.empty() && is_program(path))
        return path;
  }
  return "";
}

/// What the bits of an object depend on beside its source.
std::string circumstances(const std::string& compiler) {
  struct stat status {};
  std::error_code error;
  const fs::path program = fs::canonical(compiler, error);
  if (::stat(program.c_str(), &status) != 0) status = {};
  std::string text = fmt::format("{} {} {} {}.{} ", DIRACSTEP_VERSION, program.string(), status.st_size,
                                 status.st_mtim.tv_sec, status.st_mtim.tv_nsec);
  for (const char* flag : flags) text += std::string(flag) + ' ';
#if defined(__GLIBC__)
  text += std::string("glibc ") + gnu_get_libc_version();
#endif
  return text;
}

std::string first_line(const fs::path& path) {
  std::ifstream file(path);
  std::string line;
  std::getline(file, line);
  return shown_line(line.substr(0, 200));
}

/// Empty, or why it failed.
std::string compile(const std::string& text, const std::string& compiler, const fs::path& folder) {
  const fs::path source = folder / "kernels.c", messages = folder / "messages.txt";
  try {
    OutputFile file(source.string(), OutputFile::Mode::fresh);
    file.write(text);
    file.close();
  } catch (const std::exception& error) {
    return error.what();
  }
  std::vector<std::string> command{compiler};
  command.insert(command.end(), flags.begin(), flags.end());
  for (const auto& part :
       {std::string("-o"), (folder / "kernels.so").string(), source.string(), std::string("-lm")})
    command.push_back(part);
  const ProcessEnd end = run_process(command, messages.string(), compiler_seconds());
  switch (end.kind) {
    case ProcessEnd::Kind::not_started:
      return fmt::format("{} could not be run", compiler);
    case ProcessEnd::Kind::out_of_time:
      return fmt::format("{} was ended after {:g} s (DIRACSTEP_CC_SECONDS)", compiler, compiler_seconds());
    case ProcessEnd::Kind::killed:
      return fmt::format("{} was ended by signal {}", compiler, end.status);
    case ProcessEnd::Kind::exited:
      break;
  }
  return end.status == 0 ? "" : fmt::format("{} failed: {}", compiler, first_line(messages));
}

/// A table of kernels in a compiled object.
struct Table {
  void* address = nullptr;  ///< null where there is none, for the reason in `origin`
  std::shared_ptr<void> handle = {};
  std::string origin = {};
};

Table with_table(std::shared_ptr<void> object, const std::string& symbol, const std::string& origin) {
  if (!object) return {};
  void* const table = dlsym(object.get(), symbol.c_str());
  return {table, std::move(object), origin};
}

/// A C source that defines the table `symbol`, and what compiles it.
struct Source {
  const std::string& text;
  std::string symbol, compiler;
};

Table compiled_now(const Source& source, const KernelCache& cache, const std::string& key,
                   const std::string& complaint) {
  const fs::path folder = cache.make_work_folder();
  if (folder.empty()) return {.origin = "no folder for a compiler's files can be made"};
  const std::string failure = compile(source.text, source.compiler, folder);
  Table made;
  if (failure.empty()) {
    std::string origin = "compiled now";
    if (!complaint.empty()) origin += fmt::format("; what was in the cache {}", complaint);
    if (!cache.keep(folder / "kernels.so", key))
      origin += "; not kept: " + (cache.refusal().empty() ? "the cache cannot be written" : cache.refusal());
    made = with_table(loaded_object(folder / "kernels.so"), source.symbol, origin);
  }
  std::error_code ignored;
  fs::remove_all(folder, ignored);
  if (made.address != nullptr) return made;
  return {.origin = failure.empty() ? "the compiled kernels cannot be loaded" : failure};
}

/// From the cache, or where it is not there compiled and put there.
Table compiled_table(const Source& source, bool compile_it = true) {
  const KernelCache cache;
  const std::string key = Sha256().add(circumstances(source.compiler)).add(source.text).hex();
  std::string complaint;
  Table found = with_table(cache.load(key, complaint), source.symbol, "compiled, from the cache");
  return found.address != nullptr || !compile_it ? found : compiled_now(source, cache, key, complaint);
}

KernelLibrary interpreted(const std::string& why) { return {.origin = "interpreted, slowly: " + why}; }

}  // namespace

KernelLibrary kernel_library(const SceneProgram& program) {
  if (environment("DIRACSTEP_CC") == "none") return {.origin = "interpreted, as DIRACSTEP_CC=none asks for"};
  for (const ShippedScene& shipped : shipped_scenes())
    if (shipped.program == program.name)
      return {shipped.kernels, {}, "compiled with the library", shipped.stages};
  if (const std::size_t limit = scene_compiler::size_limits().source_bytes; program.source.size() > limit)
    return interpreted(fmt::format("{} bytes of C code, the limit for a compiler is {} (DIRACSTEP_LIMITS)",
                                   program.source.size(), limit));
  const std::string compiler = found_compiler();
  if (compiler.empty() && !environment("DIRACSTEP_CC").empty())
    return interpreted(fmt::format("DIRACSTEP_CC={} could not be run", environment("DIRACSTEP_CC")));
  if (compiler.empty())
    return interpreted("no C compiler was found (cc, gcc or clang; Debian: apt-get install gcc libc6-dev)");
  Table table = compiled_table({program.source, "diracstep_kernels_" + program.name, compiler});
  if (table.address == nullptr) return interpreted(table.origin);
  return {static_cast<const CompiledKernel*>(table.address), std::move(table.handle), table.origin};
}

CompiledStageKernel StageKernelLibrary::kernel(int stages, long evaluations) const {
  if (kernels_.kernels == nullptr || !sources_.any() || stages > StageKernels::most_stages) return nullptr;
  const auto number = static_cast<std::size_t>(stages) - 1;
  if (kernels_.handle == nullptr) return kernels_.stages == nullptr ? nullptr : kernels_.stages[number];
  Compiled& compiled = compiled_[number];
  const bool compile = (compiled.evaluations += evaluations) >= StageKernelSource::evaluations_worth_a_kernel;
  const std::unique_lock lock(mutex_, std::try_to_lock);
  if (!lock.owns_lock()) return nullptr;
  if (compiled.tried || (compiled.looked_for && !compile)) return compiled.kernel;
  compiled.looked_for = true;
  compiled.tried = compile;
  const std::string symbol = fmt::format("diracstep_stages_{}_{}", program_.name, stages);
  const std::string text = sources_.source_file(symbol, stages);
  Table table = compiled_table({text, symbol, found_compiler()}, compile);
  if (table.address == nullptr) return nullptr;
  compiled.tried = true;
  compiled.handle = std::move(table.handle);
  return compiled.kernel = *static_cast<const CompiledStageKernel*>(table.address);
}

}  // namespace diracstep
