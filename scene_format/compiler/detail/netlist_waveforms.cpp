#include <fmt/format.h>

#include <diracstep/scene_format/compiler/detail/netlist_waveforms.hpp>

namespace diracstep::scene_compiler {

FormulaText NetlistWaveforms::waveform(const Words& line) {
  std::optional<FormulaText> steady, wave;
  for (std::size_t k = 3; k < line.size();) {
    const std::string form = line[k].expression ? "" : lower(line[k].text);
    if (form == "ac") {  // of the analysis of small signals
      for (++k; k < line.size() && is_value(line[k]);) ++k;
    } else if (is_wave(form)) {
      std::vector<Word> words;
      const Word& name = line[k];
      for (++k; k < line.size() && is_value(line[k]); ++k) words.push_back(line[k]);
      if (wave) text_.fail(name.place, "a second waveform");
      wave = named(form, line, words, name.place);
    } else {
      if (form == "dc") ++k;
      if (steady) text_.require_end(line, k);
      steady = text_.value(text_.word(line, k, "a value"));
      ++k;
    }
  }
  if (!wave && !steady && line.size() < 4)
    (void)text_.word(line, 3, "a value, PULSE(…), SIN(…), EXP(…), SFFM(…) or PWL(…)");
  return wave ? *wave : steady.value_or(FormulaText{"0", line[0].place});
}

bool NetlistWaveforms::is_wave(const std::string& form) {
  return form == "pulse" || form == "sin" || form == "pwl" || form == "exp" || form == "sffm";
}

bool NetlistWaveforms::is_value(const Word& word) {
  return word.expression || in_number(word.text[0]) || word.text[0] == '+' || word.text[0] == '-' ||
         word.text[0] == '.';
}

FormulaText NetlistWaveforms::named(const std::string& form, const Words& line,
                                    const std::vector<Word>& words, Place place) {
  if (form == "pwl") return piecewise(line, words);
  std::vector<std::string> values;
  for (const Word& one : words) values.push_back("(" + text_.value(one).text + ")");
  if (form == "pulse") return {pulse(line, words, values), place};
  if (form == "exp") return {exponential(line, values), place};
  return {form == "sin" ? sine(line, values) : modulated(line, values), place};
}

void NetlistWaveforms::require_count(const Words& line, std::size_t count, std::size_t least,
                                     std::size_t most, const char* form) const {
  if (count < least || count > most)
    text_.fail(line[0].place, fmt::format("{} values; expected {}", count, form));
}

std::string NetlistWaveforms::pulse(const Words& line, const std::vector<Word>& words,
                                    const std::vector<std::string>& v) const {
  require_count(line, v.size(), 2, 7, "PULSE(V1 V2 [TD TR TF PW PER])");
  const auto given = [&](std::size_t k, double absent) {
    const bool zero_edge =
        (k == 3 || k == 4) && k < words.size() && !words[k].expression && text_.number(words[k]) == 0.0;
    return k < v.size() && !zero_edge ? v[k] : fmt::format("{:.17g}", absent);
  };
  const std::string delay = given(2, 0.0), rise = given(3, step()), fall = given(4, step()),
                    width = given(5, end());
  const std::string since =
      v.size() > 6 ? fmt::format("mod(t - {}, {})", delay, v[6]) : fmt::format("(t - {})", delay);
  return fmt::format(
      "{0} + ({1} - {0})*if(t > {2}, max(0, min(1, min({3}/{4}, 1 - ({3} - {4} - {5})/{6}))), 0)", v[0], v[1],
      delay, since, rise, width, fall);
}

std::string NetlistWaveforms::sine(const Words& line, const std::vector<std::string>& v) const {
  require_count(line, v.size(), 2, 6, "SIN(VO VA [FREQ TD THETA PHASE])");
  const std::string frequency = v.size() > 2 ? v[2] : fmt::format("(1/{:.17g})", end()),
                    delay = v.size() > 3 ? v[3] : "0", damping = v.size() > 4 ? v[4] : "0",
                    phase = v.size() > 5 ? v[5] : "0";
  const std::string since = v.size() > 3 ? fmt::format("max(0, t - {})", delay) : "t";
  const std::string factor = v.size() > 4 ? fmt::format("*exp(-{}*{})", since, damping) : "";
  const std::string shift = v.size() > 5 ? fmt::format(" + pi*{}/180", phase) : "";
  return fmt::format("{} + {}*sin(2*pi*{}*{}{}){}", v[0], v[1], frequency, since, shift, factor);
}

std::string NetlistWaveforms::exponential(const Words& line, const std::vector<std::string>& v) const {
  require_count(line, v.size(), 2, 6, "EXP(V1 V2 [TD1 TAU1 TD2 TAU2])");
  const std::string usual = fmt::format("{:.17g}", step());
  const auto given = [&](std::size_t k, const std::string& absent) { return k < v.size() ? v[k] : absent; };
  const std::string rise = given(2, "0"), fall = given(4, fmt::format("({} + {})", rise, usual));
  return fmt::format("{0} + ({1} - {0})*((1 - exp(-max(0, t - {2})/{3})) - (1 - exp(-max(0, t - {4})/{5})))",
                     v[0], v[1], rise, given(3, usual), fall, given(5, usual));
}

std::string NetlistWaveforms::modulated(const Words& line, const std::vector<std::string>& v) const {
  require_count(line, v.size(), 5, 5, "SFFM(VO VA FC MDI FS)");
  return fmt::format("{} + {}*sin(2*pi*{}*t + {}*sin(2*pi*{}*t))", v[0], v[1], v[2], v[3], v[4]);
}

FormulaText NetlistWaveforms::piecewise(const Words& line, const std::vector<Word>& words) {
  if (words.size() < 4 || words.size() % 2 != 0)
    text_.fail(line[0].place, "PWL needs pairs of a time and a value, two at least");
  SceneDocument::Input input{
      "pwl_" + upper(line[0].text), SceneDocument::Input::Kind::linear, {}, {}, true, line[0].place};
  for (std::size_t k = 0; k < words.size(); k += 2) {
    input.times.push_back(text_.number(words[k]));
    input.values.push_back(text_.number(words[k + 1]));
    if (k > 0 && !(input.times.back() > input.times[k / 2 - 1]))
      text_.fail(words[k].place, "the times of PWL are to ascend");
  }
  document_.inputs.push_back(input);
  return {input.name, line[0].place};
}

}  // namespace diracstep::scene_compiler
