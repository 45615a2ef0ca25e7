#include <fmt/format.h>

#include <algorithm>
#include <diracstep/scene_format/compiler/circuit_reader.hpp>
#include <diracstep/scene_format/compiler/detail/netlist_models.hpp>
#include <diracstep/scene_format/compiler/detail/netlist_paths.hpp>
#include <diracstep/scene_format/compiler/detail/netlist_starts.hpp>
#include <diracstep/scene_format/compiler/detail/netlist_text.hpp>
#include <diracstep/scene_format/compiler/detail/netlist_waveforms.hpp>
#include <diracstep/scene_format/compiler/netlist_reader.hpp>
#include <filesystem>
#include <map>
#include <set>

namespace diracstep::scene_compiler {

namespace {

class NetlistReader {
 public:
  explicit NetlistReader(const NetlistText& text) : text_(text) {}

  SceneDocument read() {
    document_.file = text_.file();
    document_.name = scene_name();
    document_.kind = "circuit";
    for (const Words& line : text_.lines())
      if (line[0].text[0] == '.') read_directive(line);
    for (const Words& line : text_.lines())
      if (line[0].text[0] != '.') read_element(line);
    for (const Words& line : controlled_by_current_) read_controlled_by_current(line);
    starts_.fill(document_);
    if (!given_start_ && !document_.start.empty())
      text_.fail(document_.start[0].key.start,
                 "a start is read with 'uic' in .tran; without it the motion starts at the operating point");
    note_floating_nodes(document_);
    note_title();
    require_whole();
    document_.operating_point = !given_start_;
    for (const auto& branch : document_.branches)
      for (SceneDocument::Coordinate& coordinate : coordinates_of(branch))
        document_.coordinates.push_back(std::move(coordinate));
    return std::move(document_);
  }

 private:
  std::string scene_name() const {
    std::string name = std::filesystem::path(text_.file()).stem().string();
    std::ranges::replace_if(
        name, [](char c) { return !in_word(c) && !in_number(c) && c != '_'; }, '_');
    return is_name(name) ? name : "netlist";
  }

  /// A first line that could be read as an element is one more often than not.
  void note_title() {
    document_.description = text_.title();
    NetlistReader trial(*this);
    try {
      const Words line = text_.words_of(text_.title(), 0, 1);
      if (line.empty() || line[0].text.empty()) return;
      if (line[0].text[0] == '.')
        trial.read_directive(line);
      else
        trial.read_element(line);
      for (std::size_t k = controlled_by_current_.size(); k < trial.controlled_by_current_.size(); ++k)
        trial.read_controlled_by_current(line);
    } catch (const SceneError&) {
      return;
    }
    document_.notes.push_back(fmt::format(
        "the first line of a netlist is its title: nothing is read from '{}'; put a title above it",
        text_.title()));
  }

  /// The value of "key = value" at the end of a line, from word k on; none of any other key.
  std::optional<FormulaText> assigned(const Words& line, std::size_t k, const char* key) const {
    if (k >= line.size()) return std::nullopt;
    if (lower(line[k].text) != key || k + 2 >= line.size() || line[k + 1].text != "=")
      text_.fail(line[k].place, fmt::format("'{}' is not known here; expected {}=VALUE or nothing",
                                            line[k].text, upper(key)));
    text_.require_end(line, k + 3);
    return text_.value(line[k + 2]);
  }

  // Directives.

  void read_directive(const Words& line) {
    const std::string name = lower(line[0].text);
    if (name == ".param") return read_parameters(line);
    if (name == ".model") return models_.read(line, document_.notes);
    if (name == ".tran") return read_transient(line);
    if (name == ".print" || name == ".plot" || name == ".probe" || name == ".save") return read_print(line);
    if (name == ".ic") return starts_.read(line);
    if (name == ".temp") return read_temperature(line);
    if (const std::string why = why_left_out(name); !why.empty()) {
      document_.notes.push_back(
          fmt::format("line {}: {} is left out: {}", line[0].place.line, line[0].text, why));
      return;
    }
    if (name == ".subckt" || name == ".ends")
      text_.fail(line[0].place, "subcircuits are not supported: write out their elements");
    text_.fail(
        line[0].place,
        fmt::format(
            "unknown directive '{}'; known are .param, .model, .tran, .ic, .print, .plot, .save, .temp, .end",
            line[0].text));
  }

  /// Directives that change nothing in the motion of a circuit.
  static std::string why_left_out(const std::string& name) {
    if (name == ".options" || name == ".option") return "tolerances are those of --eps and --step";
    if (name == ".control") return "commands are those of the command line";
    for (const char* other : {".op", ".ac", ".dc", ".noise", ".tf", ".four", ".meas", ".measure"})
      if (name == other) return "what is run is .tran";
    return "";
  }

  void read_temperature(const Words& line) {
    if (text_.number(text_.word(line, 1, "a temperature")) != 27.0)
      text_.fail(line[1].place, "models are those at 27 degrees");
  }

  void read_parameters(const Words& line) {
    if (line.size() < 4) text_.fail(line[0].place, ".param needs NAME=VALUE");
    for (std::size_t k = 1; k < line.size(); k += 3) {
      if (k + 2 >= line.size() || line[k + 1].text != "=") text_.fail(line[k].place, "expected NAME=VALUE");
      const std::string name = lower(line[k].text);
      if (!is_name(name)) text_.fail(line[k].place, fmt::format("'{}' is no name for a parameter", name));
      if (is_reserved(name))
        text_.fail(line[k].place, fmt::format("the name '{}' is taken; choose another", name));
      if (!names_.insert(name).second)
        text_.fail(line[k].place, fmt::format("the name '{}' is used twice", name));
      Word given = line[k + 2];
      given.expression = given.expression || !text_.is_number(given);
      if (given.expression)
        document_.definitions.emplace(name, text_.value(given));
      else
        document_.parameters.push_back(
            {name, "", "", {text_.number(line[k + 2])}, false, false, {}, line[k].place});
    }
  }

  /// .tran STEP STOP [0 [MAX]] [uic]
  void read_transient(const Words& line) {
    if (transient_) text_.fail(line[0].place, "a second .tran");
    Words rest(line.begin() + 1, line.end());
    if (!rest.empty() && lower(rest.back().text) == "uic") {
      given_start_ = true;
      rest.pop_back();
    }
    if (rest.size() < 2 || rest.size() > 4)
      text_.fail(line[0].place, ".tran needs STEP STOP [0 [MAX]] [uic]");
    document_.step = text_.number(rest[0]);
    document_.t_end = document_.study_end = text_.number(rest[1]);
    if (!(document_.step > 0.0) || !(document_.t_end > 0.0))
      text_.fail(line[0].place, ".tran needs a step and an end above 0");
    if (rest.size() > 2 && text_.number(rest[2]) != 0.0)
      document_.notes.push_back(
          fmt::format("line {}: output begins at 0, not at {}", line[0].place.line, rest[2].text));
    if (rest.size() > 3) document_.step = std::min(document_.step, text_.number(rest[3]));
    transient_ = line[0].place;
  }

  /// .print [tran] V(a) V(a,b) I(R1): the quantity and its names are words.
  void read_print(const Words& line) {
    std::size_t k = 1;
    const bool listing = lower(line[0].text) == ".save" || lower(line[0].text) == ".probe";
    const std::string analysis = k < line.size() ? lower(line[k].text) : "";
    if (analysis == "ac" || analysis == "dc" || analysis == "noise" ||
        (listing && (k >= line.size() || analysis == "all")))
      return;
    if (analysis == "tran") ++k;
    if (k >= line.size()) text_.fail(line[0].place, ".print needs V(node), V(a,b) or I(element)");
    while (k < line.size()) {
      const std::string quantity = upper(line[k].text);
      if (quantity != "V" && quantity != "I" && quantity != "P")
        text_.fail(line[k].place,
                   fmt::format("'{}': expected V(node), V(a,b), I(element) or P(element)", line[k].text));
      const Place place = line[k].place;
      std::vector<std::string> names;
      for (++k; k < line.size() && !starts_quantity(line, k); ++k)
        names.push_back(quantity == "V" ? text_.node(line[k]) : upper(line[k].text));
      if (names.empty() || names.size() > (quantity == "V" ? 2u : 1u))
        text_.fail(place, fmt::format("{}(…) with {} names", quantity, names.size()));
      document_.outputs.push_back({fmt::format("{}({})", quantity, fmt::join(names, "-")),
                                   {fmt::format("{}({})", quantity, fmt::join(names, ", ")), place},
                                   place});
    }
  }

  /// A quantity stands before a parenthesis: what is named V in one is a node.
  bool starts_quantity(const Words& line, std::size_t k) const {
    const std::string quantity = upper(line[k].text);
    if (quantity != "V" && quantity != "I" && quantity != "P") return false;
    const std::string text = text_.line_text(line[k].place.line);
    const std::size_t behind = static_cast<std::size_t>(line[k].place.column);
    return behind < text.size() && text[behind] == '(';
  }

  // Elements.

  SceneDocument::Branch& add_branch(const Words& line, const char* kind) {
    const std::string name = upper(line[0].text);
    if (!is_name(name))
      text_.fail(line[0].place, fmt::format("'{}' is no name for an element", line[0].text));
    if (!elements_.insert(name).second)
      text_.fail(line[0].place, fmt::format("two elements are named '{}'", name));
    const std::string from = text_.node(text_.word(line, 1, "two nodes")),
                      to = text_.node(text_.word(line, 2, "two nodes"));
    if (from == to) text_.fail(line[1].place, fmt::format("{} joins a node to itself", name));
    document_.branches.push_back({kind, name, {from}, {to}, {}, {}, line[0].place});
    return document_.branches.back();
  }

  void start_at(const std::string& key, const FormulaText& value) {
    document_.start.push_back({{key, value.start}, {value}, false});
  }

  void read_element(const Words& line) {
    switch (lower(line[0].text)[0]) {
      case 'r':
        return read_passive(line, "resistor");
      case 'l':
        return read_passive(line, "inductor");
      case 'c':
        return read_passive(line, "capacitor");
      case 'v':
        return read_source(line, "source_voltage");
      case 'i':
        return read_source(line, "source_current");
      case 'd':
        return read_diode(line);
      case 's':
        return read_switch(line);
      case 'k':
        return read_coupling(line);
      case 'e':
      case 'g':
        return read_controlled_by_voltage(line);
      case 'f':
      case 'h':
        controlled_by_current_.push_back(line);
        return;
      default:
        text_.fail(
            line[0].place,
            fmt::format("unknown element '{}'; known are R, L, C, V, I, D, S, K, E, F, G, H", line[0].text));
    }
  }

  void read_passive(const Words& line, const char* kind) {
    SceneDocument::Branch& branch = add_branch(line, kind);
    const FormulaText size = text_.value(text_.word(line, 3, "a value"));
    branch.values.emplace("value", size);
    if (branch.kind == "resistor") return text_.require_end(line, 4);
    const auto start = assigned(line, 4, "ic");
    if (!start) return;
    if (branch.kind == "capacitor")
      start_at("q" + branch.name, {fmt::format("({})*({})", start->text, size.text), start->start});
    else
      start_at("v_q" + branch.name, *start);
  }

  void read_source(const Words& line, const char* kind) {
    const FormulaText wave = NetlistWaveforms(text_, document_).waveform(line);
    SceneDocument::Branch& branch = add_branch(line, kind);
    // The voltage of a source in SPICE is that of its first node over its second.
    branch.values.emplace("value", branch.kind == "source_voltage" ? negative(wave) : wave);
  }

  static FormulaText negative(const FormulaText& text) { return {"-(" + text.text + ")", text.start}; }

  void read_diode(const Words& line) {
    SceneDocument::Branch diode = add_branch(line, "diode");
    const auto series = models_.fill_diode(text_.word(line, 3, "a model"), diode);
    text_.require_end(line, 4);
    if (series) {
      const std::string name = diode.name + "_RS";
      const SceneDocument::NodeName between{lower(name)};
      if (!elements_.insert(name).second)
        text_.fail(line[0].place, fmt::format("'{}' is the series resistance of {}", name, diode.name));
      document_.branches.push_back(
          {"resistor", name, diode.from, between, {{"value", *series}}, {}, line[0].place});
      diode.from = between;
    }
    *std::ranges::find(document_.branches, diode.name, &SceneDocument::Branch::name) = diode;
  }

  /// S n+ n- nc+ nc- MODEL
  void read_switch(const Words& line) {
    SceneDocument::Branch& branch = add_branch(line, "switch");
    const std::string voltage = controlling_voltage(line);
    models_.fill_switch(text_.word(line, 5, "a model"), voltage, branch);
    text_.require_end(line, 6);
  }

  std::string controlling_voltage(const Words& line) const {
    const std::string plus = text_.node(text_.word(line, 3, "two nodes that control it")),
                      minus = text_.node(text_.word(line, 4, "two nodes that control it"));
    return fmt::format("V({}, {})", plus, minus);
  }

  void read_coupling(const Words& line) {
    const std::string first = upper(text_.word(line, 1, "two inductors").text),
                      second = upper(text_.word(line, 2, "two inductors").text);
    document_.mutuals.push_back(
        {first, second, text_.value(text_.word(line, 3, "a coefficient")), true, line[0].place});
    text_.require_end(line, 4);
  }

  void read_controlled_by_voltage(const Words& line) {
    const bool voltage = lower(line[0].text)[0] == 'e';
    const std::string controlling = controlling_voltage(line);
    const FormulaText gain = text_.value(text_.word(line, 5, "a gain"));
    text_.require_end(line, 6);
    const FormulaText given{fmt::format("({})*{}", gain.text, controlling), line[3].place};
    SceneDocument::Branch& branch = add_branch(line, voltage ? "source_voltage" : "source_current");
    branch.values.emplace("value", voltage ? negative(given) : given);
  }

  void read_controlled_by_current(const Words& line) {
    const bool voltage = lower(line[0].text)[0] == 'h';
    const Word& control = text_.word(line, 3, "a voltage source that controls it");
    const FormulaText gain = text_.value(text_.word(line, 4, "a gain"));
    text_.require_end(line, 5);
    const std::string name = upper(control.text);
    if (name[0] != 'V' || !elements_.contains(name))
      text_.fail(control.place, fmt::format("there is no voltage source '{}'", control.text));
    const FormulaText given{fmt::format("({})*I({})", gain.text, name), control.place};
    SceneDocument::Branch& branch = add_branch(line, voltage ? "source_voltage" : "source_current");
    branch.values.emplace("value", voltage ? negative(given) : given);
  }

  void require_whole() const {
    if (!transient_) text_.fail({1, 1}, "there is no .tran STEP STOP");
    if (document_.branches.empty()) text_.fail({1, 1}, "there are no elements");
    const bool grounded = std::ranges::any_of(document_.branches, [](const auto& branch) {
      return branch.from.name == "0" || branch.to.name == "0";
    });
    if (!grounded) text_.fail({1, 1}, "no element leads to node 0");
  }

  const NetlistText& text_;
  SceneDocument document_;
  std::vector<Words> controlled_by_current_;
  NetlistModels models_{text_};
  NetlistStarts starts_{text_};
  std::set<std::string> names_, elements_;
  std::optional<Place> transient_;
  bool given_start_ = false;
};

}  // namespace

SceneDocument read_netlist(const std::string& file, const std::string& text) {
  return NetlistReader(NetlistText(file, text)).read();
}

}  // namespace diracstep::scene_compiler
