#include <algorithm>
#include <array>
#include <cmath>
#include <diracstep/scene_format/compiler/formula_parser.hpp>
#include <numbers>
#include <ranges>
#include <stdexcept>

namespace diracstep::scene_compiler {

namespace {

struct Function {
  std::string_view name;
  Op op;
  int arguments;
  bool reference = false;
};

constexpr std::array functions{Function{"sin", Op::sin, 1},     Function{"cos", Op::cos, 1},
                               Function{"tan", Op::tan, 1},     Function{"asin", Op::asin, 1},
                               Function{"acos", Op::acos, 1},   Function{"atan", Op::atan, 1},
                               Function{"atan2", Op::atan2, 2}, Function{"sinh", Op::sinh, 1},
                               Function{"cosh", Op::cosh, 1},   Function{"tanh", Op::tanh, 1},
                               Function{"asinh", Op::asinh, 1}, Function{"acosh", Op::acosh, 1},
                               Function{"atanh", Op::atanh, 1}, Function{"exp", Op::exp, 1},
                               Function{"log", Op::log, 1},     Function{"sqrt", Op::sqrt, 1},
                               Function{"abs", Op::abs, 1},     Function{"pow", Op::pow, 2},
                               Function{"min", Op::min, 2},     Function{"max", Op::max, 2},
                               Function{"floor", Op::floor, 1}, Function{"kepler_E", Op::kepler_E, 2, true},
                               Function{"sn", Op::sn, 2, true}, Function{"cn", Op::cn, 2, true},
                               Function{"dn", Op::dn, 2, true}};

/// Functions with arguments of their own kind.
constexpr std::array<std::string_view, 7> forms{"sum", "rate", "diff", "if", "mod", "and", "or"};
constexpr std::array<std::string_view, 13> keys{"t",    "pi",     "kind", "digits", "how",
                                                "with", "source", "name", "method", "project",
                                                "for",  "each",   "guess"};

}  // namespace

bool is_reserved(std::string_view name) {
  const auto is = [&](std::string_view other) { return other == name; };
  return std::ranges::any_of(keys, is) || std::ranges::any_of(forms, is) ||
         std::ranges::any_of(functions, is, &Function::name);
}

/// Reads one text by recursive descent.
class FormulaParser::Reader : FormulaScanner {
 public:
  Reader(FormulaParser& parser, const FormulaText& text, const Context& context)
      : FormulaScanner(parser.file_, text),
        parser_(parser),
        graph_(parser.graph_),
        symbols_(parser.symbols_),
        context_(context) {
    if (text.text.size() > longest_formula)
      fail(0, "a formula of " + std::to_string(text.text.size()) + " characters; the limit is " +
                  std::to_string(longest_formula));
  }

  Node whole_formula() {
    const Node node = expression();
    expect_end();
    return node;
  }

  Node whole_equation() {
    const Node left = expression();
    expect('=', "'=' and the right-hand side");
    const Node right = expression();
    expect_end();
    return located(graph_.subtract(left, right), 0);
  }

  std::vector<int> whole_loops() {
    std::vector<int> loops;
    do loops.push_back(loop());
    while (take(','));
    expect_end();
    return loops;
  }

  Node whole_index() {
    const Node node = index(0);
    expect_end();
    return node;
  }

  Node whole_coordinate() {
    const Node node = primary();
    expect_end();
    if (graph_[node].op != Op::coordinate) fail(0, "expected a coordinate, a velocity or a momentum");
    return node;
  }

 private:
  Node located(Node node, std::size_t offset) {
    symbols_.places.try_emplace(node, place(offset));
    return node;
  }

  Node expression() {
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

  Node term() {
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

  Node unary() {
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

  Node primary() {
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

  Node named(std::size_t place, const std::string& name) {
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
    fail(place, "unknown name '" + name + "' in " + context_.what + suggestion(name, known_names()));
  }

  /// lambda_ROW.
  Node force(const std::string& name) {
    constexpr std::string_view prefix = "lambda_";
    if (!context_.motion || !name.starts_with(prefix)) return none;
    const std::string row = name.substr(prefix.size());
    if (std::ranges::find(symbols_.rows, row) == symbols_.rows.end()) return none;
    auto found = std::ranges::find(symbols_.forces, row);
    if (found == symbols_.forces.end()) found = symbols_.forces.insert(found, row);
    return graph_.force(static_cast<int>(found - symbols_.forces.begin()));
  }

  Node parameter(std::size_t place, int id) {
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
  Node index(std::size_t place) {
    const Node node = expression();
    if (graph_.known(node) == Known::each_call)
      fail(place, "an index or bound is made of numbers, sizes and loop variables only");
    return node;
  }

  Node coordinate(std::size_t place, const std::string& name, Role role) {
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
  Node entry(std::size_t place, const std::string& name, int indices) {
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

  long whole_number(const std::string& name) {
    constexpr double most = 9.0;
    peek();
    const std::size_t here = at();
    const double index = number_follows() ? number() : 0.0;
    if (!(index >= 1.0 && index <= most && index == std::floor(index)))
      fail(here, "an index of '" + name + "' is a number such as 1; a sum over it is written out");
    return static_cast<long>(index);
  }

  Node subscript(std::size_t place, const std::string& name, std::size_t count) {
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

  Node definition(std::size_t place, const std::string& name, const FormulaText& text) {
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

  Node call(std::size_t place, const std::string& name) {
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

  /// V(a), V(a, b), I(R), P(R); "V(" stands behind us.
  Node of_circuit(std::size_t place, char quantity) {
    if (!context_.positions || context_.second != 'v')
      fail(place, std::string(1, quantity) + "(…) may not stand in " + context_.what);
    CircuitQuery query{quantity, {}, this->place(place)};
    do query.names.push_back(circuit_name());
    while (quantity == 'V' && query.names.size() < 2 && take(','));
    expect(')', "')'");
    return located(parser_.circuit_(query), place);
  }

  CircuitQuery::Name circuit_name() {
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

  /// a > b, or conditions joined by "and" and "or": a tree of choices.
  struct Condition {
    Node difference = none;  ///< positive where it holds; of a comparison
    bool both = false;
    std::vector<Condition> parts = {};
  };

  /// x where the condition holds and y elsewhere; on its edge the mean of both.
  Node chosen(const Condition& condition, Node x, Node y) {
    if (condition.parts.empty())
      return graph_.add(graph_.where(condition.difference, x),
                        graph_.where(graph_.negative(condition.difference), y));
    const Condition &first = condition.parts[0], &second = condition.parts[1];
    return condition.both ? chosen(first, chosen(second, x, y), y) : chosen(first, x, chosen(second, x, y));
  }

  Condition comparison() {
    const Node left = expression();
    const char sign = peek();
    if (sign != '<' && sign != '>') fail_expecting("'<' or '>', for if takes a comparison");
    take(sign);
    take('=');  // <= is <: on the edge the value is the mean of both sides
    const Node right = expression();
    return {sign == '>' ? graph_.subtract(left, right) : graph_.subtract(right, left)};
  }

  Condition condition() {
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

  Node choice() {
    const Condition when = condition();
    expect(',', "',' and the value where the comparison holds");
    const Node x = expression();
    expect(',', "',' and the value where it does not");
    const Node y = expression();
    expect(')', "')'");
    return chosen(when, x, y);
  }

  /// a − b floor(a/b).
  Node modulo() {
    const Node a = expression();
    expect(',', "',' and the second argument of mod");
    const Node b = expression();
    expect(')', "')'");
    return graph_.subtract(a, graph_.multiply(b, graph_.apply(Op::floor, graph_.divide(a, b))));
  }

  /// An input at the time, or at what stands in parentheses behind its name.
  Node read_input(std::size_t place, const std::string& name, int table) {
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

  int loop() {
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
  bool loop_follows() {
    const std::size_t here = at();
    const std::string name = word();
    const bool is_loop = !name.empty() && peek() == '=';
    back_to(here);
    return is_loop;
  }

  Node sum(std::size_t place) {
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

  Node rate(std::size_t place) {
    if (context_.second != 'v')
      fail(place, "rate(f) needs velocities, and there are none in " + context_.what);
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

  Node diff(std::size_t place) {
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

  void require_no_sum(Node f, std::size_t place, const char* form) const {
    for (const Node node : graph_.reachable(std::span(&f, 1)))
      if (graph_[node].op == Op::sum || graph_[node].op >= Op::kepler_E)
        fail(place, std::string(form) + " cannot take a sum or a reference function");
  }

  std::vector<std::string> known_names() const {
    std::vector<std::string> names{"pi"};
    if (context_.time) names.emplace_back("t");
    for (const auto& family : symbols_.families) {
      if (context_.positions) names.push_back(family.name);
      if (context_.second != 0) names.push_back(std::string(1, context_.second) + '_' + family.name);
    }
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

  std::vector<std::string> function_names() const {
    std::vector<std::string> names(forms.begin(), forms.end());
    for (const Function& function : functions)
      if (!function.reference || context_.reference) names.emplace_back(function.name);
    return names;
  }

  /// Counts how deep the recursion is, so that no text can exhaust the stack.
  struct Deeper {
    explicit Deeper(Reader& r) : reader(r) {
      if (++reader.parser_.depth_ > deepest_nesting)
        reader.fail(reader.at(), "nested deeper than " + std::to_string(deepest_nesting) + " levels");
    }
    ~Deeper() { --reader.parser_.depth_; }
    Deeper(const Deeper&) = delete;
    Deeper& operator=(const Deeper&) = delete;
    Reader& reader;
  };

  FormulaParser& parser_;
  FormulaGraph& graph_;
  Symbols& symbols_;
  Context context_;
};

Node FormulaParser::formula(const FormulaText& text, const Context& context) {
  return Reader(*this, text, context).whole_formula();
}

Node FormulaParser::equation(const FormulaText& text, const Context& context) {
  return Reader(*this, text, context).whole_equation();
}

std::vector<int> FormulaParser::loops(const FormulaText& text, const Context& context) {
  return Reader(*this, text, context).whole_loops();
}

Node FormulaParser::index(const FormulaText& text, const Context& context) {
  return Reader(*this, text, context).whole_index();
}

Node FormulaParser::coordinate(const FormulaText& text, const Context& context) {
  return Reader(*this, text, context).whole_coordinate();
}

Node FormulaParser::rate(Node f) {
  Node rate = graph_.derivative(f, graph_.time());
  for (const Node node : graph_.reachable(std::span(&f, 1))) {
    const NodeData leaf = graph_[node];
    if (leaf.op != Op::coordinate || leaf.c != static_cast<int>(Role::position)) continue;
    const Node velocity = symbols_.rates.empty()
                              ? graph_.coordinate(leaf.a, leaf.b, Role::second)
                              : formula(symbols_.rates[static_cast<std::size_t>(leaf.a)],
                                        {.what = "a rate", .positions = true, .second = 'v'});
    rate = graph_.add(rate, graph_.multiply(graph_.derivative(f, node), velocity));
  }
  return rate;
}

}  // namespace diracstep::scene_compiler
