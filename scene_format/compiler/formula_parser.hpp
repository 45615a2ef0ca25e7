#pragma once

#include <diracstep/scene_format/compiler/formula_graph.hpp>
#include <diracstep/scene_format/compiler/formula_scanner.hpp>
#include <functional>
#include <map>
#include <set>
#include <string>
#include <string_view>
#include <unordered_map>
#include <utility>
#include <vector>

namespace diracstep::scene_compiler {

/// A loop variable and its range.
struct Loop {
  std::string variable;
  Node first = none;
  Node last = none;
};

/// What the names in a formula may stand for.
struct Symbols {
  struct Family {
    std::string name;
    std::vector<int> loops = {};  ///< of a repeated coordinate
    bool cyclic = false;          ///< its index wraps around
  };
  struct Parameter {
    std::string name;
    bool array = false;
    int family = none;  ///< of the coordinate that stands for it where the scene is differentiated by it
  };
  std::vector<Family> families;
  std::vector<Parameter> parameters;  ///< sizes first
  std::map<std::string, FormulaText, std::less<>> definitions;
  std::map<std::string, int, std::less<>> inputs;  ///< numbers of tables in the graph
  std::vector<Loop> loops;
  std::vector<std::string> rows;         ///< that are not repeated
  std::set<std::string> inputs_of_time;  ///< inputs that a formula reads at the time
  std::vector<std::string> forces;       ///< of these rows, as far as formulas read them
  // On groups and spheres (SceneDocument::Spaces); empty in R^n.
  std::map<std::string, int, std::less<>> components;       ///< of a velocity: the family that stands for it
  std::map<std::string, FormulaText, std::less<>> entries;  ///< "R[1,2]", by the names in `indexed`
  std::map<std::string, int, std::less<>> indexed;          ///< "R", "w_R": and the number of its indices
  std::vector<FormulaText> rates;                           ///< of the families

  void add(Family family) {
    family_numbers.emplace(family.name, static_cast<int>(families.size()));
    families.push_back(std::move(family));
  }
  void add(Parameter parameter) {
    parameter_numbers.emplace(parameter.name, static_cast<int>(parameters.size()));
    parameters.push_back(std::move(parameter));
  }
  /// Their numbers; none for another name.
  int family(const std::string& name) const { return number(family_numbers, name); }
  /// The family whose velocity is that of `name`.
  int velocity(const std::string& name) const {
    if (indexed.empty()) return family(name);
    const auto found = components.find(name);
    return found == components.end() ? none : found->second;
  }
  int parameter(const std::string& name) const { return number(parameter_numbers, name); }
  /// The velocity that a family stands for, as a file writes it: "v_x", and on groups and spheres "w_R[1]
  /// (v_R_1, in the body frame of R)".
  std::string velocity_text(int family) const;
  /// Empty, or how to write the velocity of a group or a sphere that "v_R" or "v_R_w" means.
  std::string velocity_meant(std::string_view name) const;

  using Numbers = std::unordered_map<std::string, int>;
  static int number(const Numbers& numbers, const std::string& name) {
    const auto found = numbers.find(name);
    return found == numbers.end() ? none : found->second;
  }
  Numbers family_numbers, parameter_numbers;  ///< files with very many are read in time that grows with them

  /// Where the nodes that came straight from the file stand there.
  std::unordered_map<Node, Place> places;
};

/// What a formula may contain, by the place where it stands.
struct Context {
  std::string what;        ///< "the Lagrangian", for messages
  bool positions = false;  ///< coordinates
  char second = 0;         ///< 'v' or 'p': velocities or momenta
  bool time = false;
  bool sums = false;
  bool motion = false;          ///< velocities and momenta, and forces lambda_ROW of rows
  bool reference = false;       ///< Kepler's and Jacobi's functions
  bool mechanics = false;       ///< of the equations of motion: parameters may be coordinates
  std::vector<int> loops = {};  ///< loop variables in force
  /// Further names with what they stand for, before all others; definitions do not see them.
  std::map<std::string, Node, std::less<>> locals = {};
};

/// "V(a, b[k])", "I(R)", "P(R)" in a formula: voltages, currents and powers of a circuit.
struct CircuitQuery {
  struct Name {
    std::string name;
    Node index = none;
  };
  char quantity;  ///< 'V', 'I', 'P'
  std::vector<Name> names;
  Place place;
};

/// Reads formulas into a graph.  The grammar is arithmetic and a fixed list of functions, nothing else: a
/// formula cannot name a file, call a program or define anything.
class FormulaParser {
 public:
  static constexpr std::size_t longest_formula = 100'000;  ///< characters
  static constexpr int deepest_nesting = 150;

  FormulaParser(std::string file, FormulaGraph& graph, Symbols& symbols)
      : file_(std::move(file)), graph_(graph), symbols_(symbols) {}

  Node formula(const FormulaText& text, const Context& context);
  /// Left side minus right side of "a = b".
  Node equation(const FormulaText& text, const Context& context);
  /// "i = 1..N, j = 1..i-1": adds the loops to the symbols and returns their numbers.
  std::vector<int> loops(const FormulaText& text, const Context& context);
  /// A coordinate, velocity or momentum: "x", "v_x[N]".
  Node coordinate(const FormulaText& text, const Context& context);

  /// An index: made of numbers, sizes and loop variables.
  Node index(const FormulaText& text, const Context& context);
  /// Answers what formulas ask of a circuit; without it V, I and P are no functions.
  void set_circuit(std::function<Node(const CircuitQuery&)> circuit) { circuit_ = std::move(circuit); }

  /// df/dt = Σ ∂f/∂q v + ∂f/∂t.
  Node rate(Node f);
  const std::string& file() const { return file_; }

 private:
  class Reader;
  std::string file_;
  FormulaGraph& graph_;
  Symbols& symbols_;
  std::map<std::string, Node> defined_;  ///< definitions by name and context
  std::vector<std::string> being_defined_;
  std::function<Node(const CircuitQuery&)> circuit_;
  int depth_ = 0;
};

/// Names that a file may not give to anything of its own.
bool is_reserved(std::string_view name);

}  // namespace diracstep::scene_compiler
