#include <fmt/format.h>

#include <algorithm>
#include <diracstep/files/sha256.hpp>
#include <diracstep/scene_format/loader/scene_definition.hpp>

namespace diracstep {

using namespace scene_compiler;

namespace {

constexpr std::size_t longest = 200;  // characters of an entry that is stated in full

std::string stated(const std::string& text) {
  return text.size() <= longest ? text : fmt::format("{} characters, SHA-256 {}", text.size(), sha256(text));
}

std::string without_spaces(std::string text) {
  std::erase_if(text, [](char c) { return c == ' ' || c == '\t' || c == '\n' || c == '\r'; });
  return text;
}

std::string formula(const FormulaText& text) { return without_spaces(text.text); }

std::string node(const SceneDocument::NodeName& name) {
  return name.index ? fmt::format("{}[{}]", name.name, formula(*name.index)) : name.name;
}

class Definition {
 public:
  void add(std::string what, const std::string& text) {
    entries_.emplace_back(std::move(what), stated(text));
  }
  void add(std::string what, const std::optional<FormulaText>& text) {
    if (text) add(std::move(what), formula(*text));
  }
  void add(const std::string& what, const SceneDocument::Entry& entry) {
    std::string text;
    for (const FormulaText& value : entry.values) text += (text.empty() ? "" : ", ") + formula(value);
    add(what + ' ' + entry.key.text, text);
  }
  std::vector<std::pair<std::string, std::string>> take() { return std::move(entries_); }

 private:
  std::vector<std::pair<std::string, std::string>> entries_;
};

}  // namespace

std::vector<std::pair<std::string, std::string>> scene_definition(const SceneDocument& document) {
  Definition all;
  all.add("lagrangian", document.lagrangian);
  all.add("hamiltonian", document.hamiltonian);
  all.add("dissipation", document.dissipation);
  for (const auto& coordinate : document.coordinates)
    all.add("coordinate " + coordinate.name, (coordinate.loops ? formula(*coordinate.loops) : "single") +
                                                 (coordinate.cyclic ? ", cyclic" : ""));
  for (const auto& [name, kind] : document.spaces.kind_of) all.add("space of " + name, kind);
  for (const auto& parameter : document.parameters)  // single values are known as they are used
    if (parameter.array)
      all.add("array " + parameter.name, fmt::format("{:.17g}", fmt::join(parameter.values, ", ")));
  for (const auto& [name, text] : document.definitions) all.add("definition " + name, formula(text));
  for (const auto& input : document.inputs)
    all.add("input " + input.name, fmt::format("{} {:.17g} at {:.17g}", static_cast<int>(input.kind),
                                               fmt::join(input.values, ", "), fmt::join(input.times, ", ")));
  for (const auto& row : document.rows)
    all.add("row " + row.name, formula(row.equation) + (row.loops ? " for " + formula(*row.loops) : "") +
                                   (row.compliance ? " compliance " + formula(*row.compliance) : ""));
  for (const auto& state : document.states) all.add("rate of " + state.name, formula(state.rate));
  for (const auto& entry : document.force) all.add("force on", entry);
  for (const auto& branch : document.branches) {
    std::string values;
    for (const auto& [key, value] : branch.values) values += fmt::format("{}={} ", key, formula(value));
    all.add(branch.kind + ' ' + branch.name,
            fmt::format("{}from {} to {}{}", values, node(branch.from), node(branch.to),
                        branch.loops ? " for " + formula(*branch.loops) : ""));
    if (branch.kind == "opamp")
      all.add("inputs of " + branch.name, node(branch.plus) + ' ' + node(branch.minus));
  }
  for (const auto& mutual : document.mutuals)
    all.add(fmt::format("{} of {} and {}", mutual.coefficient ? "coupling" : "mutual", mutual.first,
                        mutual.second),
            formula(mutual.value));
  for (const auto& port : document.two_ports) all.add(port.kind + ' ' + port.name, formula(port.value));
  all.add("start time", document.start_time);
  for (const auto& entry : document.start) all.add("start of", entry);
  all.add("start projected", document.project ? "yes" : "no");
  if (document.operating_point) all.add("start at the operating point", "yes");
  for (const FormulaText& guess : document.guesses) all.add("guess " + formula(guess), "yes");
  for (const auto& row : document.rows)
    if (!row.on) all.add("row off at the start " + row.name, "yes");
  for (const auto& event : document.events) {
    const std::string of = " of event " + event.name;
    all.add("when" + of, event.when);
    all.add("kind" + of, fmt::format("{}, {}, every {:.17g}", static_cast<int>(event.direction),
                                     event.stop ? "stops" : "goes on", event.every));
    all.add("if" + of, event.condition);
    all.add("restitution" + of, event.restitution);
    for (const auto& entry : event.set) all.add("set" + of + ',', entry);
    if (!event.on.empty()) all.add("on" + of, fmt::format("{}", fmt::join(event.on, ", ")));
    if (!event.off.empty()) all.add("off" + of, fmt::format("{}", fmt::join(event.off, ", ")));
  }
  for (const auto& output : document.outputs) all.add("output " + output.name, formula(output.formula));
  for (const auto& kept : document.invariants) all.add("invariant " + kept.name, formula(kept.formula));
  all.add("redundant rows dropped", document.drop_redundant_rows ? "yes" : "no");
  return all.take();
}

}  // namespace diracstep
