#pragma once

#include <array>
#include <diracstep/scene_format/compiler/formula_parser.hpp>
#include <string>
#include <string_view>
#include <vector>

namespace diracstep::scene_compiler {

/// A function that formulas know.
struct Function {
  std::string_view name;
  Op op;
  int arguments;
  bool reference = false;
};

inline constexpr std::array functions{Function{"sin", Op::sin, 1},
                                      Function{"cos", Op::cos, 1},
                                      Function{"tan", Op::tan, 1},
                                      Function{"asin", Op::asin, 1},
                                      Function{"acos", Op::acos, 1},
                                      Function{"atan", Op::atan, 1},
                                      Function{"atan2", Op::atan2, 2},
                                      Function{"sinh", Op::sinh, 1},
                                      Function{"cosh", Op::cosh, 1},
                                      Function{"tanh", Op::tanh, 1},
                                      Function{"asinh", Op::asinh, 1},
                                      Function{"acosh", Op::acosh, 1},
                                      Function{"atanh", Op::atanh, 1},
                                      Function{"exp", Op::exp, 1},
                                      Function{"log", Op::log, 1},
                                      Function{"sqrt", Op::sqrt, 1},
                                      Function{"abs", Op::abs, 1},
                                      Function{"pow", Op::pow, 2},
                                      Function{"min", Op::min, 2},
                                      Function{"max", Op::max, 2},
                                      Function{"floor", Op::floor, 1},
                                      Function{"sign", Op::sign, 1},
                                      Function{"kepler_E", Op::kepler_E, 2, true},
                                      Function{"sn", Op::sn, 2, true},
                                      Function{"cn", Op::cn, 2, true},
                                      Function{"dn", Op::dn, 2, true}};

/// Functions with arguments of their own kind.
inline constexpr std::array<std::string_view, 7> forms{"sum", "rate", "diff", "if", "mod", "and", "or"};

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

  Node whole_formula();
  Node whole_equation();
  std::vector<int> whole_loops();
  Node whole_index();
  Node whole_coordinate();

 private:
  Node located(Node node, std::size_t offset);
  Node expression();
  Node term();
  Node unary();
  Node primary();
  Node named(std::size_t place, const std::string& name);
  /// lambda_ROW.
  Node force(const std::string& name);
  Node parameter(std::size_t place, int id);
  /// An index or bound: made of whole numbers, sizes and loop variables.
  Node index(std::size_t place);
  Node coordinate(std::size_t place, const std::string& name, Role role);
  /// R[1,2] or w_R[1].
  Node entry(std::size_t place, const std::string& name, int indices);
  long whole_number(const std::string& name);
  Node subscript(std::size_t place, const std::string& name, std::size_t count);
  Node definition(std::size_t place, const std::string& name, const FormulaText& text);
  Node call(std::size_t place, const std::string& name);
  /// V(a), V(a, b), I(R), P(R); "V(" stands behind us.
  Node of_circuit(std::size_t place, char quantity);
  CircuitQuery::Name circuit_name();
  /// a > b, or conditions joined by "and" and "or": a tree of choices.
  struct Condition {
    Node difference = none;  ///< positive where it holds; of a comparison
    bool both = false;
    std::vector<Condition> parts = {};
  };

  /// x where the condition holds and y elsewhere; on its edge the mean of both.
  Node chosen(const Condition& condition, Node x, Node y, std::size_t offset);
  Condition comparison();
  Condition condition();
  Node choice();
  /// a − b floor(a/b).
  Node modulo();
  /// An input at the time, or at what stands in parentheses behind its name.
  Node read_input(std::size_t place, const std::string& name, int table);
  int loop();
  /// Whether "name =" follows: one more loop of a sum.
  bool loop_follows();
  Node sum(std::size_t place);
  Node rate(std::size_t place);
  Node diff(std::size_t place);
  void require_no_sum(Node f, std::size_t place, const char* form) const;
  std::vector<std::string> known_names() const;
  std::vector<std::string> function_names() const;
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

}  // namespace diracstep::scene_compiler
