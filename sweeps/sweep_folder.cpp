#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/files/file_lock.hpp>
#include <diracstep/files/input_file.hpp>
#include <diracstep/files/sha256.hpp>
#include <diracstep/reports/build_facts.hpp>
#include <diracstep/reports/json.hpp>
#include <diracstep/sweeps/results.hpp>
#include <exception>
#include <filesystem>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>

namespace diracstep {

namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

constexpr double block_seconds = 10.0, trial_seconds = 0.2, lock_seconds = 60.0;
constexpr long least_blocks_of_a_part = 4;
constexpr std::size_t most_manifest_bytes = 1'000'000'000;

double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

std::string table_sum(const Sweep& sweep) {
  Sha256 sum;
  for (const std::vector<double>& row : sweep.table)
    sum.add({reinterpret_cast<const char*>(row.data()), row.size() * sizeof(double)});
  return sum.hex();
}

/// What the bits of the results depend on, by name.
Json identity(const MemberRuns& runs) {
  const Sweep& sweep = runs.sweep();
  Json what = Json::object();
  for (const auto& [name, fact] : build_facts())
    if (name == "diracstep" || name == "sundials" || name == "compiler") what[name] = fact;
  what["sweep file"] = sweep.text;
  what["table"] = table_sum(sweep);
  for (const auto& [name, entry] : runs.example().definition) what["scene: " + name] = entry;
  what["method"] = sweep.method;
  what["order"] = sweep.order;
  what["step"] = sweep.step;
  what["end"] = *sweep.end;
  what["members"] = sweep.members();
  return what;
}

void require_same_sweep(const Json& there, const Json& here, const std::string& folder) {
  std::string differing;
  for (const auto& [name, value] : here.items())
    if (!there.contains(name) || there[name] != value) differing += (differing.empty() ? "" : ", ") + name;
  for (const auto& [name, value] : there.items())
    if (!here.contains(name)) differing += (differing.empty() ? "" : ", ") + name;
  if (!differing.empty())
    throw Misuse(fmt::format("'{}' holds another sweep, which differs in: {}; give another folder", folder,
                             differing));
}

/// 1, 2 or 5 times a power of ten, at most `value`.
long rounded_down(double value) {
  const double power = std::pow(10.0, std::floor(std::log10(std::max(value, 1.0))));
  const double first = value / power;
  return std::max(1L, static_cast<long>(power * (first >= 5.0 ? 5.0 : first >= 2.0 ? 2.0 : 1.0)));
}

/// As many members as take about ten seconds, by the first ones.
long block_size(const MemberRuns& runs, int threads, long parts) {
  const long members = runs.sweep().members();
  if (runs.sweep().block > 0) return std::min(runs.sweep().block, members);
  const Clock::time_point start = Clock::now();
  long count = 0;
  while (count < members && seconds_since(start) < trial_seconds) (void)runs.run(count++);
  const double rate = static_cast<double>(count) * threads / seconds_since(start);
  const double most = static_cast<double>(members) / static_cast<double>(least_blocks_of_a_part * parts);
  return rounded_down(std::min(rate * block_seconds, most));
}

/// Waits for a process that is making the same file.
std::unique_ptr<FileLock> waited_lock(const std::string& path) {
  for (const Clock::time_point start = Clock::now();;) try {
      return std::make_unique<FileLock>(path);
    } catch (const Misuse&) {
      if (seconds_since(start) > lock_seconds) throw;
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
    }
}

std::unique_ptr<FileLock> lock_if_free(const std::string& path) {
  try {
    return std::make_unique<FileLock>(path);
  } catch (const Misuse&) {
    return nullptr;
  }
}

/// But for what a sweep leaves that ends before it has written what it is.
void require_empty(const fs::path& folder) {
  for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
    const std::string name = entry.path().filename().string();
    if (name.starts_with("sweep.json") || (name == "blocks" && fs::is_empty(entry.path()))) continue;
    throw Misuse(fmt::format("'{}' is no folder of a sweep and not empty, it holds '{}': give another one",
                             folder.string(), name));
  }
}

/// Reads sweep.json, or makes it with the folder; the size of a block.
long join(const MemberRuns& runs, const Json& here, const SweepOptions& options, int threads) {
  const fs::path folder = options.folder, manifest = folder / "sweep.json";
  std::error_code refused;
  fs::create_directory(folder, refused);
  if (refused) throw Misuse(fmt::format("'{}' cannot be made: {}", options.folder, refused.message()));
  const std::unique_ptr<FileLock> lock = waited_lock(manifest.string());
  if (fs::exists(manifest)) {
    const Json there =
        Json::parse(read_file(manifest.string(), "the sweep", most_manifest_bytes), nullptr, false);
    if (!there.contains("identity") || !there.contains("block") || !there["block"].is_number_integer())
      throw Misuse(fmt::format("'{}' was not written by a sweep", manifest.string()));
    require_same_sweep(there["identity"], here, options.folder);
    return there["block"].get<long>();
  }
  require_empty(folder);
  const long block = block_size(runs, threads, options.parts);
  fs::create_directory(folder / "blocks");
  replace_file(manifest.string(), to_text(Json{{"block", block}, {"identity", here}}, 2) + '\n');
  return block;
}

/// Runs the members of blocks with several threads.
class BlockRunner {
 public:
  BlockRunner(const MemberRuns& runs, int threads, const SweepOptions& options)
      : runs_(runs), threads_(threads), options_(options) {}

  /// The lines of so many members; empty where it was told to end.
  std::vector<std::string> run(long first, long size, const std::function<void(long)>& show) {
    std::vector<std::string> rows(static_cast<std::size_t>(size));
    std::atomic<long> next = 0, done = 0;
    std::exception_ptr thrown;
    std::mutex mutex;
    const auto work = [&](bool shows) {
      try {
        for (long k = next++; k < size && goes_on(); k = next++) {
          const MemberResult result = runs_.run(first + k);
          if (!goes_on()) return;  // within it, maybe
          rows[static_cast<std::size_t>(k)] = result_line(runs_.sweep(), first + k, result);
          ++done;
          if (shows) show(done);
        }
      } catch (...) {
        const std::lock_guard lock(mutex);
        thrown = std::current_exception();
        next = size;
      }
    };
    {
      std::vector<std::jthread> pool;
      for (int k = 1; k < threads_; ++k) pool.emplace_back([&] { work(false); });
      work(true);
    }
    if (thrown) std::rethrow_exception(thrown);
    return done == size ? rows : std::vector<std::string>();
  }

  bool goes_on() const { return !options_.goes_on || options_.goes_on(); }

 private:
  const MemberRuns& runs_;
  int threads_;
  const SweepOptions& options_;
};

/// The numbers of blocks that are this process's to look at, in turn.
class BlockNumbers {
 public:
  explicit BlockNumbers(const SweepOptions& options) : options_(options), next_(options.part - 1) {}
  long next() {
    if (options_.next_block) return options_.next_block();
    const long number = next_;
    next_ += options_.parts;
    return number;
  }

 private:
  const SweepOptions& options_;
  long next_;
};

/// Runs the blocks that are missing; false where it was told to end.
bool run_blocks(const MemberRuns& runs, const BlockFiles& blocks, const SweepOptions& options, int threads,
                SweepReport& report) {
  BlockRunner runner(runs, threads, options);
  BlockNumbers numbers(options);
  long mine = 0, done = 0;
  for (long k = options.part - 1; k < blocks.count(); k += options.parts)
    if (!blocks.finished(k)) mine += blocks.size(k);
  for (long number = numbers.next(); number < blocks.count(); number = numbers.next()) {
    if (blocks.finished(number)) continue;
    const std::unique_ptr<FileLock> lock = lock_if_free(blocks.path(number));
    if (!lock || blocks.finished(number)) continue;  // another process is at it, or was
    const auto show = [&](long in_block) {
      if (options.progress)
        options.progress(
            static_cast<double>(done + in_block) / static_cast<double>(std::max(mine, 1L)),
            fmt::format("member {} of {}", blocks.first(number) + in_block, runs.sweep().members()));
    };
    const std::vector<std::string> rows = runner.run(blocks.first(number), blocks.size(number), show);
    if (rows.empty()) return false;
    blocks.write(number, rows);
    done += blocks.size(number);
    report.run_here += blocks.size(number);
  }
  return runner.goes_on();
}

void count_finished(const BlockFiles& blocks, SweepReport& report) {
  report.done = 0;
  for (long k = 0; k < blocks.count(); ++k)
    if (blocks.finished(k)) report.done += blocks.size(k);
  report.complete = report.done == report.members;
}

}  // namespace

SweepReport run_sweep(const Sweep& sweep, const std::function<CatalogueScene(const Parameters&)>& make_scene,
                      const Registry& registry, const SolverFactory& solvers, const SweepOptions& options) {
  if (options.parts < 1 || options.part < 1 || options.part > options.parts)
    throw Misuse(fmt::format("part {} of {}; expected a part from 1 to the number of parts", options.part,
                             options.parts));
  if (options.threads < 0) throw Misuse(fmt::format("threads = {}; 0 or more are needed", options.threads));
  const int threads = options.threads > 0
                          ? options.threads
                          : static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
  const MemberRuns runs(sweep, make_scene, registry, solvers, options.goes_on);
  SweepReport report;
  report.method = runs.sweep().error ? "by the error asked for" : runs.sweep().method;
  report.members = sweep.members();
  const Json what = identity(runs);
  report.block = join(runs, what, options, threads);
  const BlockFiles blocks(options.folder, sha256(what.dump()).substr(0, 16), report.members, report.block);
  for (;;) {
    const bool all = run_blocks(runs, blocks, options, threads, report);
    count_finished(blocks, report);
    if (!all || !report.complete) return report;
    const std::unique_ptr<FileLock> lock = lock_if_free((fs::path(options.folder) / "results.csv").string());
    if (!lock) return report;  // another process gathers them
    const std::optional<long> damaged = gather_results(runs.sweep(), blocks, options.folder, report);
    if (!damaged) {
      report.merged_here = true;
      return report;
    }
    report.messages.push_back(
        fmt::format("'{}' is not whole: its members are run again", blocks.path(*damaged)));
    fs::remove(blocks.path(*damaged));
    if (options.next_block || options.parts > 1) return count_finished(blocks, report), report;
  }
}

}  // namespace diracstep
