#include <algorithm>
#include <cmath>
#include <diracstep/scene_format/compiler/detail/formula_reader.hpp>
#include <numbers>
#include <ranges>
#include <utility>

namespace diracstep::scene_compiler {

Node FormulaParser::Reader::whole_formula() {
  const Node node = expression();
  expect_end();
  return node;
}

Node FormulaParser::Reader::whole_equation() {
  const Node left = expression();
  expect('=', "'=' and the right-hand side");
  const Node right = expression();
  expect_end();
  return located(graph_.subtract(left, right), 0);
}

std::vector<int> FormulaParser::Reader::whole_loops() {
  std::vector<int> loops;
  do loops.push_back(loop());
  while (take(','));
  expect_end();
  return loops;
}

Node FormulaParser::Reader::whole_index() {
  const Node node = index(0);
  expect_end();
  return node;
}

Node FormulaParser::Reader::whole_coordinate() {
  const Node node = primary();
  expect_end();
  if (graph_[node].op != Op::coordinate) fail(0, "expected a coordinate, a velocity or a momentum");
  return node;
}

Node FormulaParser::Reader::located(Node node, std::size_t offset) {
  symbols_.places.try_emplace(node, place(offset));
  return node;
}

Node FormulaParser::Reader::expression() {
  Node left = term();
  for (;;) {
    const char c = peek();
    if (c != '+' && c != '-') return left;
    const std::size_t place = at();
    take(c);
    const Node right = term();
    left = located(c == '+' ? graph_.add(left, right) : graph_.subtract(left, right), place);
  }
}

Node FormulaParser::Reader::term() {
  Node left = unary();
  for (;;) {
    const char c = peek();
    if ((c != '*' && c != '/') || follows("**")) return left;
    const std::size_t place = at();
    take(c);
    const Node right = unary();
    left = located(c == '*' ? graph_.multiply(left, right) : graph_.divide(left, right), place);
  }
}

Node FormulaParser::Reader::unary() {
  const Deeper deeper(*this);
  const std::size_t place = at();
  if (take('+')) return unary();
  if (take('-')) return located(graph_.negative(unary()), place);
  const Node base = primary();
  peek();
  const std::size_t sign = at();
  if (!take("**") && !take('^')) return base;
  return located(graph_.raise(base, unary()), sign);
}

Node FormulaParser::Reader::primary() {
  const char c = peek();
  const std::size_t place = at();
  if (number_follows()) return located(graph_.number(number()), place);
  if (take('(')) {
    const Node inner = expression();
    expect(')', "')'");
    return inner;
  }
  if (starts_name(c)) return located(named(place, word()), place);
  fail_expecting("a number, a name or '('");
}

Node FormulaParser::Reader::named(std::size_t place, const std::string& name) {
  if (const auto local = context_.locals.find(name); local != context_.locals.end()) return local->second;
  if (const auto input = symbols_.inputs.find(name); input != symbols_.inputs.end())
    return located(read_input(place, name, input->second), place);
  if (peek() == '(') return call(place, name);
  if (name == "pi") return graph_.number(std::numbers::pi);
  const std::vector<int> inner_first(context_.loops.rbegin(), context_.loops.rend());
  for (const int loop : inner_first)
    if (symbols_.loops[static_cast<std::size_t>(loop)].variable == name) return graph_.loop_index(loop);
  if (name == "t") {
    if (!context_.time) fail(place, "the time t may not stand in " + context_.what);
    return graph_.time();
  }
  if (const int id = symbols_.parameter(name); id != none) return parameter(place, id);
  if (const auto found = symbols_.indexed.find(name); found != symbols_.indexed.end())
    return entry(place, name, found->second);
  if (const auto found = symbols_.definitions.find(name); found != symbols_.definitions.end())
    return definition(place, found->first, found->second);
  if (const Node node = coordinate(place, name, Role::position); node != none) return node;
  if (name.size() > 2 && name[1] == '_' && (name[0] == 'v' || name[0] == 'p'))
    if (const Node node = coordinate(place, name, Role::second); node != none) return node;
  if (const Node node = force(name); node != none) return node;
  const std::string velocity = symbols_.velocity_meant(name);
  fail(place, "unknown name '" + name + "' in " + context_.what +
                  (velocity.empty() ? suggestion(name, known_names()) : velocity));
}

/// lambda_ROW.
Node FormulaParser::Reader::force(const std::string& name) {
  constexpr std::string_view prefix = "lambda_";
  if (!context_.motion || !name.starts_with(prefix)) return none;
  const std::string row = name.substr(prefix.size());
  if (std::ranges::find(symbols_.rows, row) == symbols_.rows.end()) return none;
  auto found = std::ranges::find(symbols_.forces, row);
  if (found == symbols_.forces.end()) found = symbols_.forces.insert(found, row);
  return graph_.force(static_cast<int>(found - symbols_.forces.begin()));
}

Node FormulaParser::Reader::parameter(std::size_t place, int id) {
  const Symbols::Parameter& parameter = symbols_.parameters[static_cast<std::size_t>(id)];
  if (context_.mechanics && parameter.family != none)
    return graph_.coordinate(parameter.family, none, Role::position);
  if (!parameter.array) return graph_.parameter(id);
  expect('[', "'[' and an index, for '" + parameter.name + "' is an array");
  const Node index = this->index(place);
  expect(']', "']'");
  return located(graph_.element(id, index), place);
}

/// An index or bound: made of whole numbers, sizes and loop variables.
Node FormulaParser::Reader::index(std::size_t place) {
  const Node node = expression();
  if (graph_.known(node) == Known::each_call)
    fail(place, "an index or bound is made of numbers, sizes and loop variables only");
  return node;
}

Node FormulaParser::Reader::coordinate(std::size_t place, const std::string& name, Role role) {
  const std::string base = role == Role::position ? name : name.substr(2);
  const int id = role == Role::position ? symbols_.family(base) : symbols_.velocity(base);
  if (id == none) return none;
  if (role == Role::position && !context_.positions)
    fail(place, "the coordinate '" + name + "' may not stand in " + context_.what);
  if (role == Role::second && name[0] != context_.second && context_.motion)
    role = Role::direction;  // where functions of the motion find the other one of v and p
  if (role == Role::second && name[0] != context_.second)
    fail(place, "'" + name + "' may not stand in " + context_.what +
                    (context_.second != 0 ? std::string("; expected ") + context_.second + '_' + base
                                          : std::string()));
  const std::size_t loops = symbols_.families[static_cast<std::size_t>(id)].loops.size();
  return graph_.coordinate(id, subscript(place, name, loops), role);
}

/// R[1,2] or w_R[1].
Node FormulaParser::Reader::entry(std::size_t place, const std::string& name, int indices) {
  expect('[', indices == 1 ? "'[' and an index, for '" + name + "' is a vector"
                           : "'[' and two indices, for '" + name + "' is a matrix");
  std::string key = name;
  for (int k = 0; k < indices; ++k) {
    if (k > 0) expect(',', "',' and the second index");
    key += (k == 0 ? '[' : ',') + std::to_string(whole_number(name));
  }
  expect(']', "']'");
  const auto found = symbols_.entries.find(key + ']');
  if (found == symbols_.entries.end()) fail(place, "there is no " + key + ']');
  return definition(place, found->first, found->second);
}

long FormulaParser::Reader::whole_number(const std::string& name) {
  constexpr double most = 9.0;
  peek();
  const std::size_t here = at();
  const double index = number_follows() ? number() : 0.0;
  if (!(index >= 1.0 && index <= most && index == std::floor(index)))
    fail(here, "an index of '" + name + "' is a number such as 1; a sum over it is written out");
  return static_cast<long>(index);
}

Node FormulaParser::Reader::subscript(std::size_t place, const std::string& name, std::size_t count) {
  if (count == 0) {
    if (peek() == '[')
      fail(at(), "'" + name + "' has no index; declare it with for = \"i = 1..N\" to repeat it");
    return none;
  }
  expect('[', count == 1 ? "'[' and an index, for '" + name + "' is repeated"
                         : "'[' and two indices, for '" + name + "' is repeated twice");
  Node node = index(place);
  if (count == 2) {
    expect(',', "',' and the second index");
    node = graph_.list(node, index(place));
  }
  expect(']', "']'");
  return node;
}

Node FormulaParser::Reader::definition(std::size_t place, const std::string& name, const FormulaText& text) {
  std::string key = name + ' ' + context_.second + (context_.positions ? 'q' : ' ') +
                    (context_.time ? 't' : ' ') + (context_.sums ? 's' : ' ') +
                    (context_.reference ? 'r' : ' ') + (context_.mechanics ? 'm' : ' ') +
                    (context_.motion ? 'M' : ' ');
  for (const int loop : context_.loops) key += ' ' + std::to_string(loop);
  const auto found = parser_.defined_.find(key);
  if (found != parser_.defined_.end()) return found->second;
  if (std::ranges::find(parser_.being_defined_, name) != parser_.being_defined_.end())
    fail(place, "the definition of '" + name + "' uses itself");
  parser_.being_defined_.push_back(name);
  const Deeper deeper(*this);
  Context without_locals = context_;
  without_locals.locals.clear();
  const Node node = Reader(parser_, text, without_locals).whole_formula();
  parser_.being_defined_.pop_back();
  return parser_.defined_[key] = node;
}

Node FormulaParser::Reader::call(std::size_t place, const std::string& name) {
  expect('(', "'('");
  if (name == "sum") return sum(place);
  if (name == "rate") return rate(place);
  if (name == "diff") return diff(place);
  if (name == "if") return choice();
  if (name == "mod") return modulo();
  if (parser_.circuit_ && (name == "V" || name == "I" || name == "P")) return of_circuit(place, name[0]);
  const auto function = std::ranges::find(functions, name, &Function::name);
  if (function == functions.end())
    fail(place, "unknown function '" + name + "'" + suggestion(name, function_names()));
  if (function->reference && !context_.reference)
    fail(place, "'" + name + "' may stand in references only, not in " + context_.what);
  const Node a = expression();
  Node b = none;
  if (function->arguments == 2) {
    expect(',', "',' and the second argument of " + name);
    b = expression();
  }
  expect(')', "')'");
  return function->op == Op::pow ? graph_.raise(a, b) : graph_.apply(function->op, a, b);
}

}  // namespace diracstep::scene_compiler
