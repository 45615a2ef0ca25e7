#include <fcntl.h>
#include <fmt/format.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <CLI/App.hpp>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <ctime>
#include <diracstep/command/arguments.hpp>
#include <diracstep/command/progress.hpp>
#include <diracstep/command/verbs.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/runs/run.hpp>
#include <diracstep/files/output_file.hpp>
#include <diracstep/reports/json.hpp>
#include <diracstep/reports/report.hpp>
#include <diracstep/scene_format/parts/part_motion.hpp>
#include <diracstep/scene_format/scene_text.hpp>
#include <memory>
#include <numeric>
#include <optional>

namespace diracstep::command {

namespace {

struct PartsArguments {
  std::string scene, out;
  std::vector<std::string> set;
  int parts = 1, order = 2;
  std::optional<double> step, end;
  bool json = false;
};

double own_seconds() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

/// One number of each part, wherever it is.
struct OfParts {
  const Processes& processes;

  template <class Number>
  std::vector<double> operator()(const std::vector<PartMotion>& parts, const Number& number) const {
    if (processes.count > 1) return processes.gather(number(parts.front()));
    std::vector<double> numbers;
    for (const PartMotion& part : parts) numbers.push_back(number(part));
    return numbers;
  }
};

double sum_of_parts(const std::vector<double>& numbers) {
  return std::accumulate(numbers.begin(), numbers.end(), 0.0);
}

/// q and v of all parts as one NumPy array of two rows, each part written by who has it.  It has its name
/// once it is whole.
class EndFile {
 public:
  /// The path names no input.
  EndFile(const std::string& path, long size, const Processes& processes)
      : path_(behind_links(path)), size_(size), processes_(processes) {
    if (processes_.number == 0) begin();
    if (processes_.count > 1) processes_.meet();
    if (processes_.number > 0) open();
  }
  EndFile(const EndFile&) = delete;
  EndFile& operator=(const EndFile&) = delete;
  ~EndFile() {
    if (!whole_ && descriptor_ >= 0) ::close(descriptor_);
  }

  void write(const PartMotion& part) {
    const Vector q = part.q(), v = part.v();
    put(q.data(), q.size() * 8, header_size + 8L * part.part().first());
    put(v.data(), v.size() * 8, header_size + 8L * (size_ + part.part().first()));
  }

  void finish() {
    if (::fsync(descriptor_) != 0) refuse("written");
    if (processes_.count > 1) processes_.meet();
    if (whole_) whole_->become();
  }

 private:
  static constexpr long header_size = 128;

  void open() {
    descriptor_ = ::open((path_ + ".new").c_str(), O_WRONLY | O_CLOEXEC | O_NOFOLLOW);
    if (descriptor_ < 0) refuse("opened");
  }
  void begin() {
    struct stat there {};
    if (::stat(path_.c_str(), &there) == 0 && !S_ISREG(there.st_mode))
      throw Misuse(fmt::format("--out: '{}' is no file that can be replaced", path_));
    descriptor_ = whole_.emplace(path_).descriptor();
    std::string text = "\x93NUMPY";
    text += {'\x01', '\x00', static_cast<char>(header_size - 10), '\x00'};
    text += fmt::format("{{'descr': '<f8', 'fortran_order': False, 'shape': (2, {}), }}", size_);
    text.resize(static_cast<std::size_t>(header_size - 1), ' ');
    text += '\n';
    put(text.data(), header_size, 0);
  }
  void put(const void* from, long size, long at) {
    const char* next = static_cast<const char*>(from);
    while (size > 0) {
      const ssize_t written = ::pwrite(descriptor_, next, static_cast<std::size_t>(size), at);
      if (written < 0 && errno == EINTR) continue;
      if (written <= 0) refuse("written");
      next += written;
      at += written;
      size -= written;
    }
  }
  [[noreturn]] void refuse(const char* what) const {
    throw Error(fmt::format("'{}.new' cannot be {}: {}", path_, what, std::strerror(errno)));
  }

  std::string path_;
  long size_;
  const Processes& processes_;
  std::optional<Replacement> whole_;  ///< of the first process
  int descriptor_ = -1;
};

/// The whole motion, by this process or by all that mpirun started.
class PartsRun {
 public:
  PartsRun(const PartsArguments& arguments, const Session& session)
      : arguments_(arguments), session_(session), processes_(session.processes) {
    const std::string text = scene_text(arguments.scene);
    const Parameters changes = parameters(arguments.set);
    const bool shared = processes_.count > 1;
    if (arguments.parts < 1) throw Misuse(fmt::format("--parts {}: expected 1 or more", arguments.parts));
    const int count = shared ? processes_.count : arguments.parts;
    for (int k = shared ? processes_.number : 0; k < (shared ? processes_.number + 1 : count); ++k)
      parts_.emplace_back(ScenePart::read(arguments.scene, text, changes, k, count));
    const ScenePart& first = parts_.front().part();
    grid_ = fit_steps(first.start_time(), arguments.end.value_or(first.natural_end()),
                      arguments.step.value_or(first.natural_step()));
  }

  void run() {
    if (!arguments_.out.empty() && processes_.number == 0)
      require_outputs({{"--out", arguments_.out}}, inputs_of({arguments_.scene}, session_));
    std::optional<EndFile> file;  // refused before the run where it cannot be written
    if (!arguments_.out.empty())
      file.emplace(arguments_.out, parts_.front().part().scene_coordinates(), processes_);
    exchange(parts_);
    energy_before_ = energy();
    Progress progress;
    const double begin = own_seconds();
    exchanging_ = 0.0;
    run_parts(
        parts_, [this](std::span<PartMotion> parts) { exchange(parts); }, arguments_.order, grid_.step,
        grid_.steps,
        [&](long k) {
          done_ = k;
          if (processes_.number == 0)
            progress.show(static_cast<double>(k) / static_cast<double>(grid_.steps), "steps");
          return true;
        });
    seconds_ = own_seconds() - begin - exchanging_;
    energy_after_ = energy();
    kinetic_ = sum_of_parts(
        OfParts{processes_}(parts_, [](const PartMotion& part) { return part.kinetic_energy(); }));
    if (!file) return;
    for (const PartMotion& part : parts_) file->write(part);
    file->finish();
  }

  /// Empty, or why the result is not to be trusted: explicit steps that are too large grow without an error.
  std::string doubt() const {
    constexpr double most_change = 0.1;
    const double change = std::abs(energy_after_ - energy_before_),
                 size = std::abs(energy_before_) + kinetic_;
    if (!std::isfinite(energy_after_)) return "the motion has left the range of doubles: take smaller steps";
    if (!parts_.front().part().keeps_energy() || change <= most_change * size) return "";
    return fmt::format(
        "the energy, which this scene keeps, went from {:g} to {:g}: the step is too large for the "
        "result to be trusted",
        energy_before_, energy_after_);
  }

  Json facts() const {
    const OfParts of{processes_};
    const ScenePart& first = parts_.front().part();
    const std::size_t here = parts_.size();
    rusage usage{};
    getrusage(RUSAGE_SELF, &usage);
    Json facts{{"scene", first.name()},
               {"coordinates", first.scene_coordinates()},
               {"method", "type1/trapezoidal"},
               {"order", arguments_.order},
               {"steps", done_},
               {"step", grid_.step},
               {"energy", energy_after_},
               {"energy_change", energy_after_ - energy_before_}};
    const auto whole = [&](const auto& number) {
      return of(parts_, [&](const PartMotion& part) { return static_cast<double>(number(part)); });
    };
    facts["parts"] = {{"coordinates", whole([](const auto& part) { return part.part().own(); })},
                      {"read_of_others", whole([](const auto& part) { return part.part().others(); })},
                      {"neighbours", whole([](const auto& part) { return part.part().neighbours().size(); })},
                      {"messages", whole([](const auto& part) { return part.traffic().messages; })},
                      {"bytes", whole([](const auto& part) { return part.traffic().bytes; })},
                      {"seconds", whole([&](const auto&) { return seconds_ / static_cast<double>(here); })},
                      {"memory_mb", whole([&](const auto&) {
                         return static_cast<double>(usage.ru_maxrss) / 1024.0 / static_cast<double>(here);
                       })}};
    return facts;
  }

 private:
  void exchange(std::span<PartMotion> parts) {
    const double begin = own_seconds();
    if (processes_.count == 1) {
      exchange_here(parts);
    } else {
      std::vector<Exchanged> all;
      for (PartMessage& message : parts.front().messages())
        all.push_back({message.with, message.out, message.in});
      processes_.exchange(all);
      parts.front().take();
    }
    exchanging_ += own_seconds() - begin;
  }

  double energy() const {
    return sum_of_parts(OfParts{processes_}(parts_, [](const PartMotion& part) { return part.energy(); }));
  }

  const PartsArguments& arguments_;
  const Session& session_;
  const Processes& processes_;
  std::vector<PartMotion> parts_;
  StepGrid grid_{};
  long done_ = 0;
  double energy_before_ = 0.0, energy_after_ = 0.0, kinetic_ = 0.0, seconds_ = 0.0, exchanging_ = 0.0;
};

std::string parts_text(const Json& facts) {
  std::string text =
      fmt::format("{}: {} coordinates, {} of order {}, {} steps of {:g}\n", facts["scene"].get<std::string>(),
                  facts["coordinates"].get<long>(), facts["method"].get<std::string>(),
                  facts["order"].get<int>(), facts["steps"].get<long>(), facts["step"].get<double>());
  text += fmt::format("energy: {:.15g}, changed by {:.2e}\n\n", facts["energy"].get<double>(),
                      facts["energy_change"].get<double>());
  std::vector<std::vector<std::string>> rows{
      {"part", "coordinates", "read of others", "neighbours", "messages", "bytes", "seconds", "memory"}};
  const Json& parts = facts["parts"];
  for (std::size_t k = 0; k < parts["coordinates"].size(); ++k) {
    const auto whole = [&](const char* name) { return fmt::format("{:.0f}", parts[name][k].get<double>()); };
    rows.push_back({std::to_string(k + 1), whole("coordinates"), whole("read_of_others"), whole("neighbours"),
                    whole("messages"), whole("bytes"),
                    fmt::format("{:.2f}", parts["seconds"][k].get<double>()), whole("memory_mb") + " MB"});
  }
  return text + aligned(rows);
}

void run_in_parts(const PartsArguments& arguments, Session& session) {
  PartsRun run(arguments, session);
  run.run();
  const Json facts = run.facts();
  if (session.processes.number > 0) return;
  print(arguments.json ? to_text(facts, 2) + '\n' : parts_text(facts));
  if (const std::string doubt = run.doubt(); !doubt.empty()) {
    say(doubt);
    session.exit_status = doubted;
  }
}

}  // namespace

void add_parts(CLI::App& app, Session& session) {
  CLI::App* verb = app.add_subcommand(
      "parts", "Explicit steps of one huge scene, cut into parts, one for each rank of mpirun");
  const auto options = std::make_shared<PartsArguments>();
  verb->add_option("SCENE", options->scene,
                   "A scene of the catalogue or a file NAME.toml, without rows and forces")
      ->required();
  verb->add_option("--step", options->step, "Step size; default: the scene's");
  verb->add_option("--end", options->end, "Final time; default: the scene's");
  verb->add_option("--order", options->order, "2, 4, 6, 8 or 10, by composition");
  verb->add_option("--parts", options->parts, "Without mpirun: so many parts in this process");
  verb->add_option("--out", options->out, "q and v at the end as one NumPy array of two rows, NAME.npy");
  verb->add_flag("--json", options->json, "One JSON document on standard output");
  add_set_option(*verb, options->set);
  verb->footer("Example:  mpirun -n 2 diracstep parts toda_200 --set N=1000000 --end 1 --out end.npy");
  verb->callback([options, &session] { run_in_parts(*options, session); });
}

}  // namespace diracstep::command
