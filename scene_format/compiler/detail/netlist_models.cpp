#include <fmt/format.h>

#include <diracstep/scene_format/compiler/detail/netlist_models.hpp>
#include <set>

namespace diracstep::scene_compiler {

namespace {

constexpr double kelvin_at_27_degrees = 300.15;
constexpr double boltzmann_by_charge = 8.617333262e-5;  // V/K, k/e of the SI of 2019
constexpr double usual_junction = 1e-12;                // F

struct ModelKeys {
  std::set<std::string> read, without_effect, left_out;
  const char* text;
};

/// Of a type in small letters.  Without effect is what tells how others change with temperature, and noise.
const ModelKeys* keys_of(const std::string& type) {
  static const ModelKeys diode{{"is", "n", "rs", "cjo", "bv", "ibv"},
                               {"eg", "xti", "kf", "af", "tnom"},
                               {"m", "mj", "vj", "pb", "fc", "tt"},
                               "IS, N, RS, CJO, BV, IBV"};
  static const ModelKeys of_switch{{"vt", "vh", "ron", "roff"}, {}, {}, "VT, RON, ROFF"};
  if (type == "d") return &diode;
  return type == "sw" ? &of_switch : nullptr;
}

bool is_zero(const FormulaText& text) { return text.text.find_first_not_of("0. ") == std::string::npos; }

}  // namespace

std::optional<FormulaText> NetlistModels::Model::get(const char* key) const {
  const auto found = values.find(key);
  return found == values.end() ? std::nullopt : std::optional(found->second);
}

/// .model NAME D(IS=… N=… RS=… CJO=…), .model NAME SW(VT=… RON=… ROFF=…)
void NetlistModels::read(const Words& line, std::vector<std::string>& notes) {
  const std::string name = lower(text_.word(line, 1, "a name").text);
  const Word& type = text_.word(line, 2, "a type, D or SW");
  Model model{lower(type.text), {}};
  if (keys_of(model.type) == nullptr)
    text_.fail(type.place,
               fmt::format("a model of type '{}'; only diodes, D, and switches, SW, are known", type.text));
  std::string left_out;
  for (std::size_t k = 3; k < line.size(); k += 3) add_value(line, k, model, left_out);
  if (!left_out.empty())
    notes.push_back(fmt::format(
        "line {}: {} of model {} left out: the capacitance of a diode is constant, and it conducts "
        "without delay",
        line[0].place.line, left_out, line[1].text));
  if (!models_.emplace(name, model).second)
    text_.fail(line[1].place, fmt::format("two models are named '{}'", line[1].text));
}

void NetlistModels::add_value(const Words& line, std::size_t k, Model& model, std::string& left_out) const {
  if (k + 2 >= line.size() || line[k + 1].text != "=") text_.fail(line[k].place, "expected KEY=VALUE");
  const ModelKeys& keys = *keys_of(model.type);
  const std::string key = lower(line[k].text) == "cj0" ? "cjo" : lower(line[k].text);
  if (keys.left_out.contains(key)) left_out += (left_out.empty() ? "" : ", ") + line[k].text;
  if (keys.left_out.contains(key) || keys.without_effect.contains(key)) return;
  if (!keys.read.contains(key))
    text_.fail(line[k].place, fmt::format("unknown parameter '{}' of a {}; known are {}", line[k].text,
                                          model.type == "d" ? "diode" : "switch", keys.text));
  const FormulaText value = text_.value(line[k + 2]);
  if (key == "vh" && !is_zero(value))
    text_.fail(line[k].place, "a switch with a hysteresis VH is not supported");
  model.values.emplace(key, value);
}

const NetlistModels::Model& NetlistModels::find(const Word& name, const char* type) const {
  const auto found = models_.find(lower(name.text));
  if (found == models_.end() || found->second.type != lower(type))
    text_.fail(name.place, fmt::format("there is no .model '{}' of type {}", name.text, type));
  return found->second;
}

std::optional<FormulaText> NetlistModels::fill_diode(const Word& name, SceneDocument::Branch& diode) const {
  const Model& model = find(name, "D");
  const Place place = diode.place;
  const double thermal = boltzmann_by_charge * kelvin_at_27_degrees;
  const auto emission = model.get("n");
  const std::string factor = emission ? "(" + emission->text + ")" : "1";
  diode.values.emplace("saturation", model.get("is").value_or(FormulaText{"1e-14", place}));
  diode.values.emplace("thermal_voltage", FormulaText{fmt::format("{:.17g}*{}", thermal, factor), place});
  diode.values.emplace("capacitance",
                       model.get("cjo").value_or(FormulaText{fmt::format("{:g}", usual_junction), place}));
  if (const auto breakdown = model.get("bv")) {
    diode.values.emplace("breakdown_voltage", *breakdown);
    diode.values.emplace("breakdown_current", model.get("ibv").value_or(FormulaText{"1e-3", place}));
  }
  const auto series = model.get("rs");
  return series && !is_zero(*series) ? series : std::nullopt;
}

void NetlistModels::fill_switch(const Word& name, const std::string& voltage,
                                SceneDocument::Branch& branch) const {
  const Model& model = find(name, "SW");
  const auto value = [&](const char* key, const char* absent) {
    return model.get(key).value_or(FormulaText{absent, branch.place});
  };
  branch.values.emplace("closed",
                        FormulaText{fmt::format("{} > ({})", voltage, value("vt", "0").text), branch.place});
  branch.values.emplace("on", value("ron", "1"));
  branch.values.emplace("off", value("roff", "1e12"));  // SPICE's 1/GMIN
}

}  // namespace diracstep::scene_compiler
