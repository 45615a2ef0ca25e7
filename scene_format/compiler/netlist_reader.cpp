#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <diracstep/scene_format/compiler/circuit_reader.hpp>
#include <diracstep/scene_format/compiler/netlist_reader.hpp>
#include <filesystem>
#include <map>
#include <set>

namespace diracstep::scene_compiler {

namespace {

constexpr double kelvin_at_27_degrees = 300.15;
constexpr double boltzmann_by_charge = 8.617333262e-5;  // V/K, k/e of the SI of 2019
constexpr double usual_junction = 1e-12;                // F

std::string lower(std::string text) {
  std::ranges::transform(text, text.begin(), [](unsigned char c) { return std::tolower(c); });
  return text;
}

std::string upper(std::string text) {
  std::ranges::transform(text, text.begin(), [](unsigned char c) { return std::toupper(c); });
  return text;
}

bool in_number(char c) { return std::isdigit(static_cast<unsigned char>(c)) != 0; }
bool in_word(char c) { return std::isalpha(static_cast<unsigned char>(c)) != 0; }
bool is_space(char c) { return std::isspace(static_cast<unsigned char>(c)) != 0; }

/// What a letter behind a number multiplies it with; 1 for units.
const char* power_of_suffix(const std::string& suffix) {
  if (suffix.starts_with("meg")) return "e6";
  if (suffix.starts_with("mil")) return nullptr;
  static const std::map<char, const char*> powers{{'t', "e12"}, {'g', "e9"},  {'k', "e3"},   {'m', "e-3"},
                                                  {'u', "e-6"}, {'n', "e-9"}, {'p', "e-12"}, {'f', "e-15"}};
  const auto found = powers.find(suffix.empty() ? ' ' : suffix[0]);
  return found == powers.end() ? "" : found->second;
}

/// The length of a number at `at`, without suffix; 0 where there is none.
std::size_t number_length(const std::string& text, std::size_t at) {
  std::size_t i = at, digits = 0;
  for (; i < text.size() && (in_number(text[i]) || text[i] == '.'); ++i) digits += in_number(text[i]) ? 1 : 0;
  if (digits == 0) return 0;
  if (i < text.size() && (text[i] == 'e' || text[i] == 'E')) {
    std::size_t j = i + 1;
    if (j < text.size() && (text[j] == '+' || text[j] == '-')) ++j;
    if (j < text.size() && in_number(text[j])) {
      while (j < text.size() && in_number(text[j])) ++j;
      return j - at;
    }
  }
  return i - at;
}

/// A word of a line: a name, a number or an expression in braces, with its place.
struct Word {
  std::string text;
  Place place;
  bool expression = false;
};

/// A line with those that continue it.
using Words = std::vector<Word>;

class NetlistReader {
 public:
  NetlistReader(const std::string& file, const std::string& text) : file_(file), text_(text) {}

  SceneDocument read() {
    document_.file = file_;
    document_.name = scene_name();
    document_.kind = "circuit";
    split();
    for (const Words& line : lines_)
      if (line[0].text[0] == '.') read_directive(line);
    for (const Words& line : lines_)
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
  [[noreturn]] void fail(Place place, const std::string& message) const {
    throw SceneError(file_, place, message);
  }

  std::string scene_name() const {
    std::string name = std::filesystem::path(file_).stem().string();
    std::ranges::replace_if(
        name, [](char c) { return !in_word(c) && !in_number(c) && c != '_'; }, '_');
    return is_name(name) ? name : "netlist";
  }

  // Lines and words.

  void split() {
    int number = 0;
    std::size_t begin = 0;
    bool ended = false;
    while (begin <= text_.size() && !ended) {
      const std::size_t end = std::min(text_.find('\n', begin), text_.size());
      const std::string line = text_.substr(begin, end - begin);
      begin = end + 1;
      ++number;
      if (number == 1) {
        title_ = line;
        continue;
      }
      const std::size_t first = line.find_first_not_of(" \t\r");
      if (first == std::string::npos || line[first] == '*') continue;
      const bool continued = line[first] == '+';
      Words words = words_of(line, continued ? first + 1 : first, number);
      if (words.empty()) continue;
      if (continued && lines_.empty()) fail(words[0].place, "there is no line that this one could continue");
      if (continued) {
        lines_.back().insert(lines_.back().end(), words.begin(), words.end());
        continue;
      }
      ended = lower(words[0].text) == ".end";
      if (!ended) lines_.push_back(std::move(words));
    }
  }

  /// A first line that could be read as an element is one more often than not.
  void note_title() {
    document_.description = title_;
    NetlistReader trial(*this);
    try {
      const Words line = words_of(title_, 0, 1);
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
        "the first line of a netlist is its title: nothing is read from '{}'; put a title above it", title_));
  }

  /// Blanks, commas and parentheses part words; '=' is one of its own.
  Words words_of(const std::string& line, std::size_t from, int number) const {
    Words words;
    for (std::size_t i = from; i < line.size();) {
      const char c = line[i];
      const Place place{number, static_cast<int>(i) + 1};
      if (c == ';' || (c == '$' && (i == from || is_space(line[i - 1])))) break;
      if (is_space(c) || c == ',' || c == '(' || c == ')') {
        ++i;
      } else if (c == '=') {
        words.push_back({"=", place});
        ++i;
      } else if (c == '{' || c == '\'') {
        const std::size_t end = line.find(c == '{' ? '}' : '\'', i + 1);
        if (end == std::string::npos) fail(place, "an expression that does not end on its line");
        words.push_back({line.substr(i + 1, end - i - 1), {number, place.column + 1}, true});
        i = end + 1;
      } else {
        std::size_t end = i;
        while (end < line.size() && !is_space(line[end]) &&
               std::string_view(",()={};'").find(line[end]) == std::string_view::npos)
          ++end;
        words.push_back({line.substr(i, end - i), place});
        i = end;
      }
    }
    return words;
  }

  /// Numbers with suffixes as plain ones, names in small letters.
  std::string formula_text(const Word& word) const {
    const std::string text = lower(word.text);
    std::string formula;
    for (std::size_t i = 0; i < text.size();) {
      if (in_word(text[i]) || text[i] == '_') {
        const std::size_t begin = i;
        while (i < text.size() && (in_word(text[i]) || in_number(text[i]) || text[i] == '_')) ++i;
        formula += text.substr(begin, i - begin);
        continue;
      }
      const std::size_t length = number_length(text, i);
      if (length == 0) {
        formula += text[i++];
        continue;
      }
      const std::string mantissa = text.substr(i, length);
      i += length;
      const std::size_t begin = i;
      while (i < text.size() && in_word(text[i])) ++i;
      const char* power = power_of_suffix(text.substr(begin, i - begin));
      if (power == nullptr) fail(word.place, fmt::format("'{}': mil is not supported", word.text));
      const bool plain = *power == '\0' || mantissa.find('e') == std::string::npos;
      formula += plain ? mantissa + power : fmt::format("({}*1{})", mantissa, power);
    }
    return formula;
  }

  /// A number or an expression in braces.
  FormulaText value(const Word& word) const {
    if (word.expression) return {formula_text(word), word.place};
    const bool sign = word.text[0] == '-' || word.text[0] == '+';
    const std::size_t begin = sign ? 1 : 0, length = number_length(word.text, begin);
    const bool number =
        length > 0 && std::all_of(word.text.begin() + static_cast<std::ptrdiff_t>(begin + length),
                                  word.text.end(), in_word);
    if (!number)
      fail(word.place, fmt::format("'{}': expected a number such as 4.7k, or an expression in braces such as "
                                   "{{2*rl}}",
                                   word.text));
    return {formula_text(word), word.place};
  }

  double number(const Word& word) const {
    const FormulaText text = value(word);
    const char* begin = text.text.c_str();
    char* end = nullptr;
    const double result = std::strtod(begin, &end);
    if (*end != '\0' || !std::isfinite(result))
      fail(word.place, fmt::format("'{}': a plain number is needed here", word.text));
    return result;
  }

  const Word& word(const Words& line, std::size_t k, const char* what) const {
    if (k >= line.size()) fail(line[0].place, fmt::format("'{}' needs {}", line[0].text, what));
    return line[k];
  }

  void require_end(const Words& line, std::size_t k) const {
    if (k < line.size())
      fail(line[k].place,
           fmt::format("'{}' is not known here, in the line of {}", line[k].text, line[0].text));
  }

  /// The value of "key = value" at the end of a line, from word k on; none of any other key.
  std::optional<FormulaText> assigned(const Words& line, std::size_t k, const char* key) const {
    if (k >= line.size()) return std::nullopt;
    if (lower(line[k].text) != key || k + 2 >= line.size() || line[k + 1].text != "=")
      fail(line[k].place,
           fmt::format("'{}' is not known here; expected {}=VALUE or nothing", line[k].text, upper(key)));
    require_end(line, k + 3);
    return value(line[k + 2]);
  }

  // Directives.

  void read_directive(const Words& line) {
    const std::string name = lower(line[0].text);
    if (name == ".param") return read_parameters(line);
    if (name == ".model") return read_model(line);
    if (name == ".tran") return read_transient(line);
    if (name == ".print") return read_print(line);
    fail(line[0].place,
         fmt::format("unknown directive '{}'; known are .param, .model, .tran, .print, .end", line[0].text));
  }

  void read_parameters(const Words& line) {
    if (line.size() < 4) fail(line[0].place, ".param needs NAME=VALUE");
    for (std::size_t k = 1; k < line.size(); k += 3) {
      if (k + 2 >= line.size() || line[k + 1].text != "=") fail(line[k].place, "expected NAME=VALUE");
      const std::string name = lower(line[k].text);
      if (!is_name(name)) fail(line[k].place, fmt::format("'{}' is no name for a parameter", name));
      if (is_reserved(name)) fail(line[k].place, fmt::format("the name '{}' is taken; choose another", name));
      if (!names_.insert(name).second) fail(line[k].place, fmt::format("the name '{}' is used twice", name));
      if (line[k + 2].expression)
        document_.definitions.emplace(name, value(line[k + 2]));
      else
        document_.parameters.push_back(
            {name, "", "", {number(line[k + 2])}, false, false, {}, line[k].place});
    }
  }

  /// .model NAME D(IS=… N=… CJO=…)
  void read_model(const Words& line) {
    const std::string name = lower(word(line, 1, "a name").text);
    const Word& type = word(line, 2, "a type, D");
    if (lower(type.text) != "d")
      fail(type.place, fmt::format("a model of type '{}'; only diodes, D, are known", type.text));
    Model model;
    for (std::size_t k = 3; k < line.size(); k += 3) {
      const std::string key = lower(line[k].text);
      if (k + 2 >= line.size() || line[k + 1].text != "=") fail(line[k].place, "expected KEY=VALUE");
      if (key == "is")
        model.saturation = value(line[k + 2]);
      else if (key == "n")
        model.emission = value(line[k + 2]);
      else if (key == "cjo" || key == "cj0")
        model.capacitance = value(line[k + 2]);
      else
        fail(line[k].place,
             fmt::format("unknown parameter '{}' of a diode; known are IS, N, CJO", line[k].text));
    }
    if (!models_.emplace(name, model).second)
      fail(line[1].place, fmt::format("two models are named '{}'", line[1].text));
  }

  /// .tran STEP STOP [0 [MAX]] [uic]
  void read_transient(const Words& line) {
    if (transient_) fail(line[0].place, "a second .tran");
    Words rest(line.begin() + 1, line.end());
    if (!rest.empty() && lower(rest.back().text) == "uic") {
      given_start_ = true;
      rest.pop_back();
    }
    if (rest.size() < 2 || rest.size() > 4) fail(line[0].place, ".tran needs STEP STOP [0 [MAX]] [uic]");
    document_.step = number(rest[0]);
    document_.t_end = document_.study_end = number(rest[1]);
    if (!(document_.step > 0.0) || !(document_.t_end > 0.0))
      fail(line[0].place, ".tran needs a step and an end above 0");
    if (rest.size() > 2 && number(rest[2]) != 0.0) fail(rest[2].place, "output from 0 on only");
    if (rest.size() > 3) document_.step = std::min(document_.step, number(rest[3]));
    transient_ = line[0].place;
  }

  /// .print [tran] V(a) V(a,b) I(R1): the quantity and its names are words.
  void read_print(const Words& line) {
    std::size_t k = 1;
    if (k < line.size() && lower(line[k].text) == "tran") ++k;
    if (k >= line.size()) fail(line[0].place, ".print needs V(node), V(a,b) or I(element)");
    while (k < line.size()) {
      const std::string quantity = upper(line[k].text);
      if (quantity != "V" && quantity != "I" && quantity != "P")
        fail(line[k].place,
             fmt::format("'{}': expected V(node), V(a,b), I(element) or P(element)", line[k].text));
      const Place place = line[k].place;
      std::vector<std::string> names;
      for (++k; k < line.size() && !starts_quantity(line, k); ++k)
        names.push_back(quantity == "V" ? node(line[k]) : upper(line[k].text));
      if (names.empty() || names.size() > (quantity == "V" ? 2u : 1u))
        fail(place, fmt::format("{}(…) with {} names", quantity, names.size()));
      document_.outputs.push_back({fmt::format("{}({})", quantity, fmt::join(names, "-")),
                                   {fmt::format("{}({})", quantity, fmt::join(names, ", ")), place},
                                   place});
    }
  }

  /// A quantity stands before a parenthesis: what is named V in one is a node.
  bool starts_quantity(const Words& line, std::size_t k) const {
    const std::string quantity = upper(line[k].text);
    if (quantity != "V" && quantity != "I" && quantity != "P") return false;
    const std::string text = line_text(line[k].place.line);
    const std::size_t behind = static_cast<std::size_t>(line[k].place.column);
    return behind < text.size() && text[behind] == '(';
  }

  std::string line_text(int number) const {
    std::size_t begin = 0;
    for (int k = 1; k < number; ++k) begin = text_.find('\n', begin) + 1;
    return text_.substr(begin, text_.find('\n', begin) - begin);
  }

  // Elements.

  struct Model {
    std::optional<FormulaText> saturation, emission, capacitance;
  };

  std::string node(const Word& word) const {
    const std::string name = lower(word.text);
    if (word.expression || word.text == "=") fail(word.place, "expected the name of a node");
    const bool plain =
        std::ranges::all_of(name, [](char c) { return in_word(c) || in_number(c) || c == '_'; });
    if (!plain) fail(word.place, fmt::format("'{}' is no node: expected letters, digits and _", word.text));
    return name == "gnd" || name == "ground" ? "0" : name;
  }

  SceneDocument::Branch& add_branch(const Words& line, const char* kind) {
    const std::string name = upper(line[0].text);
    if (!is_name(name)) fail(line[0].place, fmt::format("'{}' is no name for an element", line[0].text));
    if (!elements_.insert(name).second) fail(line[0].place, fmt::format("two elements are named '{}'", name));
    const std::string from = node(word(line, 1, "two nodes")), to = node(word(line, 2, "two nodes"));
    if (from == to) fail(line[1].place, fmt::format("{} joins a node to itself", name));
    document_.branches.push_back({kind, name, {from}, {to}, {}, {}, line[0].place});
    return document_.branches.back();
  }

  void start_at(const std::string& key, const FormulaText& value) {
    document_.start.push_back({{key, value.start}, {value}, false});
    if (!given_start_)
      fail(value.start,
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
        fail(line[0].place,
             fmt::format("unknown element '{}'; known are R, L, C, V, I, D, K, E, F, G, H", line[0].text));
    }
  }

  void read_passive(const Words& line, const char* kind) {
    SceneDocument::Branch& branch = add_branch(line, kind);
    const FormulaText size = value(word(line, 3, "a value"));
    branch.values.emplace("value", size);
    if (branch.kind == "resistor") return require_end(line, 4);
    const auto start = assigned(line, 4, "ic");
    if (!start) return;
    if (branch.kind == "capacitor")
      start_at("q" + branch.name, {fmt::format("({})*({})", start->text, size.text), start->start});
    else
      start_at("v_q" + branch.name, *start);
  }

  void read_source(const Words& line, const char* kind) {
    const FormulaText wave = waveform(line);
    SceneDocument::Branch& branch = add_branch(line, kind);
    // The voltage of a source in SPICE is that of its first node over its second.
    branch.values.emplace("value", branch.kind == "source_voltage" ? negative(wave) : wave);
  }

  static FormulaText negative(const FormulaText& text) { return {"-(" + text.text + ")", text.start}; }

  FormulaText waveform(const Words& line) {
    std::size_t k = 3;
    if (k < line.size() && lower(line[k].text) == "dc") ++k;
    const Word& first = word(line, k, "a value, PULSE(…), SIN(…) or PWL(…)");
    const std::string form = first.expression ? "" : lower(first.text);
    const bool named = form == "pulse" || form == "sin" || form == "pwl";
    if (!named) {
      require_end(line, k + 1);
      return value(first);
    }
    std::vector<Word> words(line.begin() + static_cast<std::ptrdiff_t>(k) + 1, line.end());
    if (form == "pwl") return piecewise(line, words);
    std::vector<std::string> values;
    for (const Word& one : words) values.push_back("(" + value(one).text + ")");
    return {form == "pulse" ? pulse(line, words, values) : sine(line, values), first.place};
  }

  void require_count(const Words& line, std::size_t count, std::size_t least, std::size_t most,
                     const char* form) const {
    if (count < least || count > most)
      fail(line[0].place, fmt::format("{} values; expected {}", count, form));
  }

  std::string pulse(const Words& line, const std::vector<Word>& words, const std::vector<std::string>& v) {
    require_count(line, v.size(), 2, 7, "PULSE(V1 V2 [TD TR TF PW PER])");
    const auto given = [&](std::size_t k, double absent) {
      const bool zero_edge =
          (k == 3 || k == 4) && k < words.size() && !words[k].expression && number(words[k]) == 0.0;
      return k < v.size() && !zero_edge ? v[k] : fmt::format("{:.17g}", absent);
    };
    const std::string delay = given(2, 0.0), rise = given(3, step()), fall = given(4, step()),
                      width = given(5, end());
    const std::string since =
        v.size() > 6 ? fmt::format("mod(t - {}, {})", delay, v[6]) : fmt::format("(t - {})", delay);
    return fmt::format(
        "{0} + ({1} - {0})*if(t > {2}, max(0, min(1, min({3}/{4}, 1 - ({3} - {4} - {5})/{6}))), 0)", v[0],
        v[1], delay, since, rise, width, fall);
  }

  std::string sine(const Words& line, const std::vector<std::string>& v) {
    require_count(line, v.size(), 2, 6, "SIN(VO VA [FREQ TD THETA PHASE])");
    const std::string frequency = v.size() > 2 ? v[2] : fmt::format("(1/{:.17g})", end()),
                      delay = v.size() > 3 ? v[3] : "0", damping = v.size() > 4 ? v[4] : "0",
                      phase = v.size() > 5 ? v[5] : "0";
    const std::string since = v.size() > 3 ? fmt::format("max(0, t - {})", delay) : "t";
    const std::string factor = v.size() > 4 ? fmt::format("*exp(-{}*{})", since, damping) : "";
    const std::string shift = v.size() > 5 ? fmt::format(" + pi*{}/180", phase) : "";
    return fmt::format("{} + {}*sin(2*pi*{}*{}{}){}", v[0], v[1], frequency, since, shift, factor);
  }

  FormulaText piecewise(const Words& line, const std::vector<Word>& words) {
    if (words.size() < 4 || words.size() % 2 != 0)
      fail(line[0].place, "PWL needs pairs of a time and a value, two at least");
    SceneDocument::Input input{
        "pwl_" + upper(line[0].text), SceneDocument::Input::Kind::linear, {}, {}, true, line[0].place};
    for (std::size_t k = 0; k < words.size(); k += 2) {
      input.times.push_back(number(words[k]));
      input.values.push_back(number(words[k + 1]));
      if (k > 0 && !(input.times.back() > input.times[k / 2 - 1]))
        fail(words[k].place, "the times of PWL are to ascend");
    }
    document_.inputs.push_back(input);
    return {input.name, line[0].place};
  }

  double step() const { return document_.step; }
  double end() const { return document_.t_end; }

  void read_diode(const Words& line) {
    SceneDocument::Branch& branch = add_branch(line, "diode");
    const Word& name = word(line, 3, "a model");
    require_end(line, 4);
    const auto found = models_.find(lower(name.text));
    if (found == models_.end()) fail(name.place, fmt::format("there is no .model '{}'", name.text));
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
    const std::string first = upper(word(line, 1, "two inductors").text),
                      second = upper(word(line, 2, "two inductors").text);
    document_.mutuals.push_back({first, second, value(word(line, 3, "a coefficient")), true, line[0].place});
    require_end(line, 4);
  }

  void read_controlled_by_voltage(const Words& line) {
    const bool voltage = lower(line[0].text)[0] == 'e';
    const Word& name = word(line, 3, "two nodes that control it");
    const std::string plus = node(name), minus = node(word(line, 4, "two nodes that control it"));
    const FormulaText gain = value(word(line, 5, "a gain"));
    require_end(line, 6);
    const FormulaText given{fmt::format("({})*V({}, {})", gain.text, plus, minus), name.place};
    SceneDocument::Branch& branch = add_branch(line, voltage ? "source_voltage" : "source_current");
    branch.values.emplace("value", voltage ? negative(given) : given);
  }

  void read_controlled_by_current(const Words& line) {
    const bool voltage = lower(line[0].text)[0] == 'h';
    const Word& control = word(line, 3, "a voltage source that controls it");
    const FormulaText gain = value(word(line, 4, "a gain"));
    require_end(line, 5);
    const std::string name = upper(control.text);
    if (name[0] != 'V' || !elements_.contains(name))
      fail(control.place, fmt::format("there is no voltage source '{}'", control.text));
    const FormulaText given{fmt::format("({})*I({})", gain.text, name), control.place};
    SceneDocument::Branch& branch = add_branch(line, voltage ? "source_voltage" : "source_current");
    branch.values.emplace("value", voltage ? negative(given) : given);
  }

  void require_whole() const {
    if (!transient_) fail({1, 1}, "there is no .tran STEP STOP");
    if (document_.branches.empty()) fail({1, 1}, "there are no elements");
    const bool grounded = std::ranges::any_of(document_.branches, [](const auto& branch) {
      return branch.from.name == "0" || branch.to.name == "0";
    });
    if (!grounded) fail({1, 1}, "no element leads to node 0");
  }

  const std::string& file_;
  const std::string& text_;
  SceneDocument document_;
  std::string title_;
  std::vector<Words> lines_, controlled_by_current_;
  std::map<std::string, Model> models_;
  std::set<std::string> names_, elements_;
  std::optional<Place> transient_;
  bool given_start_ = false;
};

}  // namespace

SceneDocument read_netlist(const std::string& file, const std::string& text) {
  return NetlistReader(file, text).read();
}

}  // namespace diracstep::scene_compiler
