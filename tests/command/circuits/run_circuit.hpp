#pragma once

/// Circuits from scene files and from netlists, run by the command.
#include <cmath>
#include <nlohmann/json.hpp>

#include "../run_command.hpp"

namespace diracstep::testing {

using Json = nlohmann::json;

/// A table of an element.
inline std::string element(const std::string& kind, const std::string& name, const std::string& from,
                           const std::string& to, const std::string& rest) {
  return "[[" + kind + "]]\nname = \"" + name + "\"\nnodes = [\"" + from + "\", \"" + to + "\"]\n" + rest +
         "\n";
}

inline std::string span(double end, double step) {
  std::ostringstream text;
  text << "[span]\nend = " << end << "\nstep = " << step << '\n';
  return text.str();
}

class Circuits : public Command {
 protected:
  Json json(const std::string& file, const std::string& arguments = "") const {
    const Outcome outcome = run("run " + file + ' ' + arguments + " --json");
    EXPECT_EQ(outcome.status, 0) << outcome.err;
    return Json::parse(outcome.out, nullptr, false);
  }
  Json outputs(const std::string& text, const std::string& arguments = "") const {
    return json(scene("circuit", text), arguments)["outputs"];
  }
  std::string netlist(const std::string& text) const {
    std::ofstream(path("circuit.cir")) << text;
    return path("circuit.cir");
  }
  void expect_refused(const std::string& text, int line, const std::vector<std::string>& words) const {
    const std::string file = netlist(text);
    std::vector<std::string> all = words;
    all.push_back("circuit.cir:" + std::to_string(line) + ':');
    expect_misuse("run " + file, all);
  }
};

inline double value(const Json& outputs, const char* name) { return outputs[name].get<double>(); }

/// The root of a rising function between two numbers.
template <class F>
double root(double low, double high, const F& f) {
  for (int k = 0; k < 200; ++k) (f(0.5 * (low + high)) > 0.0 ? high : low) = 0.5 * (low + high);
  return low;
}

constexpr double thermal_voltage_at_27 = 8.617333262e-5 * 300.15;

}  // namespace diracstep::testing
