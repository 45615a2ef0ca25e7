#pragma once

#include <gtest/gtest.h>
#include <sys/wait.h>

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "temporary_folder.hpp"

/// Runs the built command as a user's shell would.
namespace diracstep::testing {

struct Outcome {
  int status;
  std::string out;
  std::string err;
};

inline std::vector<std::string> lines(const std::string& text) {
  std::istringstream stream(text);
  std::vector<std::string> all;
  for (std::string line; std::getline(stream, line);) all.push_back(line);
  return all;
}

inline std::vector<std::string> fields(const std::string& line) {
  std::istringstream stream(line);
  std::vector<std::string> all;
  for (std::string field; std::getline(stream, field, ',');) all.push_back(field);
  return all;
}

/// A load of 1 mH and 1 kΩ, whose current follows its voltage within 1 µs, behind a source of 50 Hz with
/// steps of 0.5 ms: R/L h = 500.
inline constexpr const char* stiff_load = R"toml(
[parameters]
c = 1e-5
r = 1000
[definitions]
volt = "5 + sin(2*pi*50*t)"
[[source_voltage]]
name = "V"
nodes = ["ground", "p"]
value = "volt"
[[capacitor]]
name = "C"
nodes = ["p", "ground"]
value = "c"
[[inductor]]
name = "L"
nodes = ["p", "m"]
value = "1e-3"
[[resistor]]
name = "R"
nodes = ["m", "ground"]
value = "r"
[start]
qC = "5*c"
[span]
end = 0.013
step = 0.0005
)toml";

/// A directory of its own for each test, removed afterwards.
class Command : public ::testing::Test {
 protected:
  std::string path(const std::string& name) const { return folder_.path(name); }

  /// A scene file of this text, and its path.
  std::string scene(const std::string& name, const std::string& text) const {
    return folder_.write(name + ".toml", "name = \"" + name + "\"\n" + text);
  }

  /// `arguments` as typed in a shell; `before` precedes the command, "VAR=x" or "timeout 1".
  Outcome run(const std::string& arguments, const std::string& before = "") const {
    const std::string line = before + " '" DIRACSTEP_COMMAND "' " + arguments + " 2>'" + path("stderr") + "'";
    Outcome outcome{-1, {}, {}};
    std::FILE* pipe = popen(line.c_str(), "r");
    if (pipe == nullptr) return outcome;
    char buffer[4096];
    for (std::size_t n; (n = std::fread(buffer, 1, sizeof buffer, pipe)) > 0;) outcome.out.append(buffer, n);
    const int status = pclose(pipe);
    outcome.status = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
    outcome.err = contents(path("stderr"));
    return outcome;
  }

  /// Expects exit status 2, nothing on standard output, and each of `words` on standard error.
  void expect_misuse(const std::string& arguments, const std::vector<std::string>& words) const {
    const Outcome outcome = run(arguments);
    EXPECT_EQ(outcome.status, 2) << arguments << '\n' << outcome.err;
    EXPECT_EQ(outcome.out, "") << arguments;
    for (const auto& word : words)
      EXPECT_NE(outcome.err.find(word), std::string::npos) << arguments << ": '" << word << "' not in\n"
                                                           << outcome.err;
  }

 private:
  TemporaryFolder folder_;
};

}  // namespace diracstep::testing
