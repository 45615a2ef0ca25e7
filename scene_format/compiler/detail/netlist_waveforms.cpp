#include <fmt/format.h>

#include <diracstep/scene_format/compiler/detail/netlist_waveforms.hpp>

namespace diracstep::scene_compiler {

FormulaText NetlistWaveforms::waveform(const Words& line) {
  std::size_t k = 3;
  if (k < line.size() && lower(line[k].text) == "dc") ++k;
  const Word& first = text_.word(line, k, "a value, PULSE(…), SIN(…) or PWL(…)");
  const std::string form = first.expression ? "" : lower(first.text);
  const bool named = form == "pulse" || form == "sin" || form == "pwl";
  if (!named) {
    text_.require_end(line, k + 1);
    return text_.value(first);
  }
  std::vector<Word> words(line.begin() + static_cast<std::ptrdiff_t>(k) + 1, line.end());
  if (form == "pwl") return piecewise(line, words);
  std::vector<std::string> values;
  for (const Word& one : words) values.push_back("(" + text_.value(one).text + ")");
  return {form == "pulse" ? pulse(line, words, values) : sine(line, values), first.place};
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
