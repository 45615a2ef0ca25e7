#include <algorithm>
#include <cmath>
#include <diracstep/scene_format/compiler/detail/formula_reader.hpp>
#include <ranges>
#include <span>
#include <utility>

namespace diracstep::scene_compiler {

/// Forms with arguments of their own kind: conditions, sums, rates, inputs, quantities of circuits.

/// V(a), V(a, b), I(R), P(R); "V(" stands behind us.
Node FormulaParser::Reader::of_circuit(std::size_t place, char quantity) {
  if (!context_.positions || context_.second != 'v')
    fail(place, std::string(1, quantity) + "(…) may not stand in " + context_.what);
  CircuitQuery query{quantity, {}, this->place(place)};
  do query.names.push_back(circuit_name());
  while (quantity == 'V' && query.names.size() < 2 && take(','));
  expect(')', "')'");
  return located(parser_.circuit_(query), place);
}

CircuitQuery::Name FormulaParser::Reader::circuit_name() {
  peek();
  const std::size_t here = at();
  CircuitQuery::Name name{word()};
  if (name.name.empty() && number_follows()) {  // nodes may be numbered
    const double number = this->number();
    if (number != std::floor(number) || number < 0.0) fail(here, "expected the name of a node");
    name.name = std::to_string(static_cast<long>(number));
  }
  if (name.name.empty()) fail_expecting("the name of a node or of an element");
  if (take('[')) {
    name.index = index(here);
    expect(']', "']'");
  }
  return name;
}

/// x where the condition holds and y elsewhere; on its edge the mean of both.  Jumps are named by the place.
Node FormulaParser::Reader::chosen(const Condition& condition, Node x, Node y, std::size_t offset) {
  const auto where = [&](Node difference, Node value) {
    const Node node = graph_.where(difference, value);
    return graph_[node].op == Op::where ? located(node, offset) : node;
  };
  if (condition.parts.empty())
    return graph_.add(where(condition.difference, x), where(graph_.negative(condition.difference), y));
  const Condition &first = condition.parts[0], &second = condition.parts[1];
  return condition.both ? chosen(first, chosen(second, x, y, offset), y, offset)
                        : chosen(first, x, chosen(second, x, y, offset), offset);
}

FormulaParser::Reader::Condition FormulaParser::Reader::comparison() {
  const Node left = expression();
  const char sign = peek();
  if (sign != '<' && sign != '>') fail_expecting("'<' or '>', for if takes a comparison");
  take(sign);
  take('=');  // <= is <: on the edge the value is the mean of both sides
  const Node right = expression();
  return {sign == '>' ? graph_.subtract(left, right) : graph_.subtract(right, left)};
}

FormulaParser::Reader::Condition FormulaParser::Reader::condition() {
  Condition whole = comparison();
  for (;;) {
    const std::size_t here = at();
    const std::string join = word();
    if (join != "and" && join != "or") {
      back_to(here);
      return whole;
    }
    Condition next = comparison();
    whole = {none, join == "and", {std::move(whole), std::move(next)}};
  }
}

Node FormulaParser::Reader::choice() {
  const std::size_t offset = at();
  const Condition when = condition();
  expect(',', "',' and the value where the comparison holds");
  const Node x = expression();
  expect(',', "',' and the value where it does not");
  const Node y = expression();
  expect(')', "')'");
  return chosen(when, x, y, offset);
}

/// a − b floor(a/b).
Node FormulaParser::Reader::modulo() {
  const std::size_t offset = at();
  const Node a = expression();
  expect(',', "',' and the second argument of mod");
  const Node b = expression();
  expect(')', "')'");
  const Node whole = located(graph_.apply(Op::floor, graph_.divide(a, b)), offset);
  return graph_.subtract(a, graph_.multiply(b, whole));
}

/// An input at the time, or at what stands in parentheses behind its name.
Node FormulaParser::Reader::read_input(std::size_t place, const std::string& name, int table) {
  Node u = none;
  if (take('(')) {
    u = expression();
    expect(')', "')'");
  } else {
    if (!context_.time)
      fail(place, "an input is a function of the time t, which may not stand in " + context_.what);
    u = graph_.time();
  }
  if (u == graph_.time()) symbols_.inputs_of_time.insert(name);
  return graph_.table(table, 0, u);
}

int FormulaParser::Reader::loop() {
  const std::size_t place = at();
  const std::string variable = word();
  if (!is_name(variable) || is_reserved(variable)) fail(place, "expected a loop variable, as in i = 1..N");
  expect('=', "'=' and a range, as in i = 1..N");
  const Node first = index(place);
  if (!take("..")) fail_expecting("'..' and the last value, as in i = 1..N");
  const Node last = index(place);
  symbols_.loops.push_back({variable, first, last});
  const int id = static_cast<int>(symbols_.loops.size()) - 1;
  context_.loops.push_back(id);
  return id;
}

/// Whether "name =" follows: one more loop of a sum.
bool FormulaParser::Reader::loop_follows() {
  const std::size_t here = at();
  const std::string name = word();
  const bool is_loop = !name.empty() && peek() == '=';
  back_to(here);
  return is_loop;
}

Node FormulaParser::Reader::sum(std::size_t place) {
  if (!context_.sums) fail(place, "a sum may not stand in " + context_.what);
  const std::vector<int> outside = context_.loops;
  std::vector<int> loops;
  do {
    loops.push_back(loop());
    expect(',', "',' and what is summed");
  } while (loop_follows());
  Node node = expression();
  expect(')', "')'");
  context_.loops = outside;
  const std::vector<int> last_first(loops.rbegin(), loops.rend());
  for (const int id : last_first) node = located(graph_.sum(node, id), place);
  return node;
}

Node FormulaParser::Reader::rate(std::size_t place) {
  if (context_.second != 'v') fail(place, "rate(f) needs velocities, and there are none in " + context_.what);
  const Node f = expression();
  expect(')', "')'");
  require_no_sum(f, place, "rate");
  for (const Node node : graph_.reachable(std::span(&f, 1)))
    if (graph_[node].op == Op::coordinate && graph_[node].c == static_cast<int>(Role::second))
      fail(place,
           "rate(f) of a formula that holds velocities would need accelerations, which formulas do not "
           "know");
  return parser_.rate(f);
}

Node FormulaParser::Reader::diff(std::size_t place) {
  const Node f = expression();
  expect(',', "',' and a coordinate");
  const std::size_t symbol_place = at();
  const Node symbol = primary();
  expect(')', "')'");
  if (graph_[symbol].op != Op::coordinate && graph_[symbol].op != Op::time)
    fail(symbol_place, "diff(f, x) takes a coordinate, a velocity or t as its second argument");
  require_no_sum(f, place, "diff");
  return graph_.derivative(f, symbol);
}

void FormulaParser::Reader::require_no_sum(Node f, std::size_t place, const char* form) const {
  for (const Node node : graph_.reachable(std::span(&f, 1)))
    if (graph_[node].op == Op::sum || graph_[node].op >= Op::kepler_E)
      fail(place, std::string(form) + " cannot take a sum or a reference function");
}

std::vector<std::string> FormulaParser::Reader::known_names() const {
  std::vector<std::string> names{"pi"};
  if (context_.time) names.emplace_back("t");
  for (const auto& family : symbols_.families) {
    if (context_.positions) names.push_back(family.name);
    if (context_.second != 0 && symbols_.components.empty())
      names.push_back(std::string(1, context_.second) + '_' + family.name);
  }
  for (const auto& [name, component] : symbols_.components)
    if (context_.second != 0) names.push_back(std::string(1, context_.second) + '_' + name);
  if (context_.motion)
    for (const auto& row : symbols_.rows) names.push_back("lambda_" + row);
  for (const auto& parameter : symbols_.parameters) names.push_back(parameter.name);
  for (const auto& [name, text] : symbols_.definitions) names.push_back(name);
  for (const auto& [name, indices] : symbols_.indexed) names.push_back(name);
  for (const auto& [name, table] : symbols_.inputs) names.push_back(name);
  for (const int loop : context_.loops)
    names.push_back(symbols_.loops[static_cast<std::size_t>(loop)].variable);
  return names;
}

std::vector<std::string> FormulaParser::Reader::function_names() const {
  std::vector<std::string> names(forms.begin(), forms.end());
  for (const Function& function : functions)
    if (!function.reference || context_.reference) names.emplace_back(function.name);
  return names;
}

}  // namespace diracstep::scene_compiler
