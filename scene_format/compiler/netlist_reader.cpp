#include <fmt/format.h>

#include <algorithm>
#include <diracstep/scene_format/compiler/circuit_reader.hpp>
#include <diracstep/scene_format/compiler/detail/netlist_text.hpp>
#include <diracstep/scene_format/compiler/detail/netlist_waveforms.hpp>
#include <diracstep/scene_format/compiler/netlist_reader.hpp>
#include <filesystem>
#include <map>
#include <set>

namespace diracstep::scene_compiler {

namespace {

constexpr double kelvin_at_27_degrees = 300.15;
constexpr double boltzmann_by_charge = 8.617333262e-5;  // V/K, k/e of the SI of 2019
constexpr double usual_junction = 1e-12;                // F

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
    if (name == ".model") return read_model(line);
    if (name == ".tran") return read_transient(line);
    if (name == ".print") return read_print(line);
    text_.fail(
        line[0].place,
        fmt::format("unknown directive '{}'; known are .param, .model, .tran, .print, .end", line[0].text));
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
      if (line[k + 2].expression)
        document_.definitions.emplace(name, text_.value(line[k + 2]));
      else
        document_.parameters.push_back(
            {name, "", "", {text_.number(line[k + 2])}, false, false, {}, line[k].place});
    }
  }

  /// .model NAME D(IS=… N=… CJO=…)
  void read_model(const Words& line) {
    const std::string name = lower(text_.word(line, 1, "a name").text);
    const Word& type = text_.word(line, 2, "a type, D");
    if (lower(type.text) != "d")
      text_.fail(type.place, fmt::format("a model of type '{}'; only diodes, D, are known", type.text));
    Model model;
    for (std::size_t k = 3; k < line.size(); k += 3) {
      const std::string key = lower(line[k].text);
      if (k + 2 >= line.size() || line[k + 1].text != "=") text_.fail(line[k].place, "expected KEY=VALUE");
      if (key == "is")
        model.saturation = text_.value(line[k + 2]);
      else if (key == "n")
        model.emission = text_.value(line[k + 2]);
      else if (key == "cjo" || key == "cj0")
        model.capacitance = text_.value(line[k + 2]);
      else
        text_.fail(line[k].place,
                   fmt::format("unknown parameter '{}' of a diode; known are IS, N, CJO", line[k].text));
    }
    if (!models_.emplace(name, model).second)
      text_.fail(line[1].place, fmt::format("two models are named '{}'", line[1].text));
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
    if (rest.size() > 2 && text_.number(rest[2]) != 0.0) text_.fail(rest[2].place, "output from 0 on only");
    if (rest.size() > 3) document_.step = std::min(document_.step, text_.number(rest[3]));
    transient_ = line[0].place;
  }

  /// .print [tran] V(a) V(a,b) I(R1): the quantity and its names are words.
  void read_print(const Words& line) {
    std::size_t k = 1;
    if (k < line.size() && lower(line[k].text) == "tran") ++k;
    if (k >= line.size()) text_.fail(line[0].place, ".print needs V(node), V(a,b) or I(element)");
    while (k < line.size()) {
      const std::string quantity = upper(line[k].text);
      if (quantity != "V" && quantity != "I" && quantity != "P")
        text_.fail(line[k].place,
                   fmt::format("'{}': expected V(node), V(a,b), I(element) or P(element)", line[k].text));
      const Place place = line[k].place;
      std::vector<std::string> names;
      for (++k; k < line.size() && !starts_quantity(line, k); ++k)
        names.push_back(quantity == "V" ? node(line[k]) : upper(line[k].text));
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

  struct Model {
    std::optional<FormulaText> saturation, emission, capacitance;
  };

  std::string node(const Word& word) const {
    const std::string name = lower(word.text);
    if (word.expression || word.text == "=") text_.fail(word.place, "expected the name of a node");
    const bool plain =
        std::ranges::all_of(name, [](char c) { return in_word(c) || in_number(c) || c == '_'; });
    if (!plain)
      text_.fail(word.place, fmt::format("'{}' is no node: expected letters, digits and _", word.text));
    return name == "gnd" || name == "ground" ? "0" : name;
  }

  SceneDocument::Branch& add_branch(const Words& line, const char* kind) {
    const std::string name = upper(line[0].text);
    if (!is_name(name))
      text_.fail(line[0].place, fmt::format("'{}' is no name for an element", line[0].text));
    if (!elements_.insert(name).second)
      text_.fail(line[0].place, fmt::format("two elements are named '{}'", name));
    const std::string from = node(text_.word(line, 1, "two nodes")),
                      to = node(text_.word(line, 2, "two nodes"));
    if (from == to) text_.fail(line[1].place, fmt::format("{} joins a node to itself", name));
    document_.branches.push_back({kind, name, {from}, {to}, {}, {}, line[0].place});
    return document_.branches.back();
  }

  void start_at(const std::string& key, const FormulaText& value) {
    document_.start.push_back({{key, value.start}, {value}, false});
    if (!given_start_)
      text_.fail(value.start,
                 "IC= is read with 'uic' in .tran; without it the motion starts at the operating point");
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
            fmt::format("unknown element '{}'; known are R, L, C, V, I, D, K, E, F, G, H", line[0].text));
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
    SceneDocument::Branch& branch = add_branch(line, "diode");
    const Word& name = text_.word(line, 3, "a model");
    text_.require_end(line, 4);
    const auto found = models_.find(lower(name.text));
    if (found == models_.end()) text_.fail(name.place, fmt::format("there is no .model '{}'", name.text));
    const Model& model = found->second;
    const double thermal = boltzmann_by_charge * kelvin_at_27_degrees;
    const std::string emission = model.emission ? "(" + model.emission->text + ")" : "1";
    branch.values.emplace("saturation", model.saturation.value_or(FormulaText{"1e-14", line[0].place}));
    branch.values.emplace("thermal_voltage",
                          FormulaText{fmt::format("{:.17g}*{}", thermal, emission), line[0].place});
    branch.values.emplace("capacitance", model.capacitance.value_or(FormulaText{
                                             fmt::format("{:g}", usual_junction), line[0].place}));
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
    const Word& name = text_.word(line, 3, "two nodes that control it");
    const std::string plus = node(name), minus = node(text_.word(line, 4, "two nodes that control it"));
    const FormulaText gain = text_.value(text_.word(line, 5, "a gain"));
    text_.require_end(line, 6);
    const FormulaText given{fmt::format("({})*V({}, {})", gain.text, plus, minus), name.place};
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
  std::map<std::string, Model> models_;
  std::set<std::string> names_, elements_;
  std::optional<Place> transient_;
  bool given_start_ = false;
};

}  // namespace

SceneDocument read_netlist(const std::string& file, const std::string& text) {
  return NetlistReader(NetlistText(file, text)).read();
}

}  // namespace diracstep::scene_compiler
