#include <algorithm>
#include <array>
#include <csignal>
#include <cstdint>
#include <cstdlib>
#include <diracstep/command/arguments.hpp>
#include <diracstep/command/command_line.hpp>
#include <diracstep/command/interrupt.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <string>
#include <vector>

/// libFuzzer's entry: any bytes as a command line, its words divided by line ends, are read and end with an
/// exit status from 0 to 2.  What neither writes files nor takes long is run: list methods, plan,
/// and run, which is interrupted before its first step.  Each word is also read as a list of names, of
/// numbers, and so on.
namespace {

using namespace diracstep;

constexpr std::size_t max_words = 40;

std::vector<std::string> words(const std::uint8_t* data, std::size_t size) {
  std::vector<std::string> all{"diracstep", ""};
  for (std::size_t i = 0; i < size && all.size() < max_words; ++i) {
    if (data[i] == '\n')
      all.emplace_back();
    else if (data[i] != 0)  // ends a word for every program
      all.back() += static_cast<char>(data[i]);
  }
  return all;
}

/// A large N makes a large scene, which takes its time.
bool is_quick(const std::string& word) {
  const auto value = word.find('=');
  return value == std::string::npos || std::abs(std::atof(word.c_str() + value + 1)) <= 100.0;
}

bool runs(const std::vector<std::string>& line) {
  constexpr std::array verbs{"list", "plan", "run"};
  constexpr std::array writers{"--out", "--checkpoint", "--resume", "--plugin", "--error"};
  if (line[1] == "list" && std::ranges::find(line, "methods") == line.end()) return false;
  return std::ranges::find(verbs, line[1]) != verbs.end() && std::ranges::all_of(line, [&](const auto& word) {
           return is_quick(word) &&
                  std::ranges::none_of(writers, [&](const char* option) { return word.starts_with(option); });
         });
}

void read_as_argument(const std::string& word) {
  const auto refusable = [&](auto read) {
    try {
      read();
    } catch (const Misuse& refused) {
      if (*refused.what() == '\0') std::abort();
    }
  };
  refusable([&] { (void)command::names("--option", word); });
  refusable([&] { (void)command::numbers("--option", word); });
  refusable([&] { (void)command::whole_numbers("--option", word); });
  refusable([&] { (void)command::parameters({word}); });
  refusable([&] { (void)command::momentum(word); });
}

void interrupt_all_runs() {
  command::catch_interrupts();
  if (!command::interrupted()) std::raise(SIGINT);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  interrupt_all_runs();
  std::vector<std::string> line = words(data, size);
  for (const std::string& word : line) read_as_argument(word);
  std::vector<char*> arguments;
  for (std::string& word : line) arguments.push_back(word.data());
  const int status = command::execute(static_cast<int>(arguments.size()), arguments.data(), runs(line));
  if (status < 0 || status > 2) std::abort();
  return 0;
}
