#include <fmt/format.h>

#include <algorithm>
#include <diracstep/files/sha256.hpp>
#include <diracstep/scene_format/compiler/detail/memory_pool.hpp>
#include <diracstep/scene_format/compiler/kernel.hpp>
#include <diracstep/scene_format/compiler/operations.hpp>
#include <set>

namespace diracstep::scene_compiler {

int Constants::add(Node node) {
  const auto [found, added] = numbers_.try_emplace(node, static_cast<int>(nodes_.size()));
  if (added) nodes_.push_back(node);
  return found->second;
}

Kernel::Kernel(FormulaGraph& graph, const std::vector<Store>& stores, const PieceLayout& layout,
               Constants& known, Constants& instance)
    : tables_(&graph.tables()), width_(layout.width()) {
  std::vector<Node> roots;
  for (const Store& store : stores)
    if (!graph.is_number(store.value, 0.0)) {
      stores_.push_back(store);
      roots.push_back(store.value);
    }
  // Of what is known beforehand only the roots and the arguments of computed nodes are read here.
  std::set<Node> needed(roots.begin(), roots.end());
  const std::vector<Node> nodes = graph.reachable(roots);
  for (const Node node : nodes) {
    const NodeData& data = graph[node];
    if (graph.known(node) != Known::each_call) continue;
    if (arity(data.op) >= 1) needed.insert(data.a);
    if (arity(data.op) == 2) needed.insert(data.b);
  }
  std::unordered_map<Node, int> number;
  for (const Node node : nodes) {
    if (!needed.contains(node)) continue;
    NodeData data = graph[node];
    From from = From::computed;
    if (data.op == Op::number) {
      from = From::literal;
    } else if (graph.known(node) != Known::each_call) {
      const bool once = graph.known(node) == Known::once;
      from = once ? From::known : From::instance;
      data.a = (once ? known : instance).add(node);
    } else if (data.op == Op::coordinate) {
      from = From::coordinate;
      data.a = layout.slots.at(graph.coordinate(data.a, data.b, Role::position));
    } else if (data.op == Op::multiplier) {
      from = data.c == 1 ? From::force : From::multiplier;
      if (data.c != 1) data.a += layout.slot_count;
    } else if (data.op == Op::time) {
      from = From::time;
    } else if (data.op == Op::scale) {
      from = From::scale;
    } else {
      data.a = number.at(data.a);
      if (arity(data.op) == 2) data.b = number.at(data.b);
    }
    number[node] = static_cast<int>(code_.size());
    code_.push_back({from, data});
  }
  for (Store& store : stores_) store.value = number.at(store.value);
}

void Kernel::run(const KernelCall& call, int instance_width, int position_width) const {
  static MemoryPool<std::vector<double>>& pool = *new MemoryPool<std::vector<double>>;
  MemoryPool<std::vector<double>>::Loan loan(pool);
  std::vector<double>& values = *loan;
  values.resize(std::max(values.size(), code_.size()));
  for (long i = 0; i < call.count; ++i) {
    const int* const slots = call.slots + i * width_;
    const int* const positions = call.positions + i * position_width;
    const double* const instance = call.instance + i * instance_width;
    double* next = values.data();
    for (const Instruction& instruction : code_) {
      const NodeData& data = instruction.data;
      double& result = *next++;
      const auto value = [&](int a) { return values[static_cast<std::size_t>(a)]; };
      switch (instruction.from) {
        case From::literal:
          result = data.value;
          break;
        case From::known:
          result = call.known[data.a];
          break;
        case From::instance:
          result = instance[data.a];
          break;
        case From::coordinate:
          result = call.in[data.c][slots[data.a]];
          break;
        case From::multiplier:
          result = call.multipliers[slots[data.a]];
          break;
        case From::force:
          result = call.multipliers[data.a];
          break;
        case From::time:
          result = call.t;
          break;
        case From::scale:
          result = call.s;
          break;
        case From::computed:
          if (data.op == Op::table) {
            const auto number = static_cast<std::size_t>(data.c / LookupTable::width);
            result = (*tables_)[number].value(value(data.a), data.c % LookupTable::width);
            break;
          }
          result = computed(data, value(data.a), arity(data.op) == 2 ? value(data.b) : 0.0);
          break;
      }
    }
    for (const Store& store : stores_) {
      const int at = store.table == Store::Table::fixed   ? store.entry
                     : store.table == Store::Table::slots ? slots[store.entry]
                                                          : positions[store.entry];
      call.out[store.column][at] += values[static_cast<std::size_t>(store.value)];
    }
  }
}

namespace {

std::string literal(double value) {
  std::string text = fmt::format("{:.17g}", value);
  if (text.find_first_of(".en") == std::string::npos) text += ".0";
  return value < 0.0 ? '(' + text + ')' : text;
}

const char* function_name(Op op) {
  switch (op) {
    case Op::pow:
      return "pow";
    case Op::sqrt:
      return "sqrt";
    case Op::sin:
      return "sin";
    case Op::cos:
      return "cos";
    case Op::tan:
      return "tan";
    case Op::asin:
      return "asin";
    case Op::acos:
      return "acos";
    case Op::atan:
      return "atan";
    case Op::atan2:
      return "atan2";
    case Op::sinh:
      return "sinh";
    case Op::cosh:
      return "cosh";
    case Op::tanh:
      return "tanh";
    case Op::asinh:
      return "asinh";
    case Op::acosh:
      return "acosh";
    case Op::atanh:
      return "atanh";
    case Op::exp:
      return "exp";
    case Op::log:
      return "log";
    case Op::abs:
      return "fabs";
    case Op::sign:
      return "diracstep_sign";
    case Op::min:
      return "diracstep_min";
    case Op::max:
      return "diracstep_max";
    case Op::hypot:
      return "hypot";
    case Op::floor:
      return "floor";
    case Op::where:
      return "diracstep_where";
    default:
      return nullptr;
  }
}

/// x to the power n with the multiplications of whole_power.
std::string power_text(const std::string& x, int exponent) {
  const auto product = [](const std::string& a, const std::string& b) {
    return std::string("(").append(a).append(" * ").append(b).append(")");
  };
  std::string result, square = x;
  for (; exponent > 0; exponent /= 2, square = product(square, square))
    if (exponent % 2 == 1) result = result.empty() ? square : product(result, square);
  return result;
}

}  // namespace

std::string Kernel::expression(const Instruction& instruction, const CoordinateName& coordinate) const {
  const NodeData& data = instruction.data;
  const std::string a = fmt::format("r{}", data.a), b = fmt::format("r{}", data.b);
  switch (instruction.from) {
    case From::literal:
      return literal(data.value);
    case From::known:
      return fmt::format("known[{}]", data.a);
    case From::instance:
      return fmt::format("instance[{}]", data.a);
    case From::coordinate:
      return coordinate(data.c, data.a);
    case From::multiplier:
      return fmt::format("multipliers[slots[{}]]", data.a);
    case From::force:
      return fmt::format("multipliers[{}]", data.a);
    case From::time:
      return "call->t";
    case From::scale:
      return "call->s";
    case From::computed:
      break;
  }
  switch (data.op) {
    case Op::negative:
      return '-' + a;
    case Op::add:
      return a + " + " + b;
    case Op::subtract:
      return a + " - " + b;
    case Op::multiply:
      return a + " * " + b;
    case Op::divide:
      return a + " / " + b;
    case Op::power:
      return power_text(a, data.c);
    case Op::table: {
      const int number = data.c / LookupTable::width;
      return fmt::format("diracstep_table(table{0}_knots, table{0}_parts, {1}, {2}, {3})", number,
                         (*tables_)[static_cast<std::size_t>(number)].knots.size(), a,
                         data.c % LookupTable::width);
    }
    default:
      break;
  }
  return arity(data.op) == 2 ? fmt::format("{}({}, {})", function_name(data.op), a, b)
                             : fmt::format("{}({})", function_name(data.op), a);
}

bool Kernel::of_coordinates_alone() const {
  return std::ranges::all_of(code_, [](const Instruction& instruction) {
    const From from = instruction.from;
    return from == From::computed || from == From::literal || from == From::known || from == From::coordinate;
  });
}

bool Kernel::has_roots_or_quotients_alone() const {
  bool any = false;
  for (const Instruction& instruction : code_) {
    const Op op = instruction.data.op;
    if (instruction.from != From::computed) continue;
    any = any || op == Op::sqrt || op == Op::divide;
    if (op != Op::sqrt && function_name(op) != nullptr) return false;
  }
  return any;
}

std::string Kernel::instructions(const CoordinateName& coordinate) const {
  std::string text;
  for (std::size_t k = 0; k < code_.size(); ++k)
    text += fmt::format("    const double r{} = {};\n", k, expression(code_[k], coordinate));
  return text;
}

void Kernel::add_tables(std::set<int>& numbers) const {
  for (const Instruction& instruction : code_)
    if (instruction.data.op == Op::table && instruction.from == From::computed)
      numbers.insert(instruction.data.c / LookupTable::width);
}

std::string Kernel::source(const std::string& name, int instance_width, int position_width) const {
  std::set<std::string> pointers, tables;  // those that are used: no compiler shall warn
  std::string body =
      instructions([](int role, int slot) { return fmt::format("in{}[slots[{}]]", role, slot); });
  for (const Instruction& instruction : code_) {
    const From from = instruction.from;
    if (from == From::known) pointers.insert("const double* const known = call->known;");
    if (from == From::instance)
      tables.insert(fmt::format("const double* const instance = call->instance + i * {};", instance_width));
    if (from == From::multiplier || from == From::force)
      pointers.insert("const double* const multipliers = call->multipliers;");
    if (from == From::coordinate)
      pointers.insert(fmt::format("const double* const in{0} = call->in[{0}];", instruction.data.c));
    if (from == From::coordinate || from == From::multiplier)
      tables.insert(fmt::format("const int* const slots = call->slots + i * {};", width_));
  }
  for (const Store& store : stores_) {
    pointers.insert(fmt::format("double* const DIRACSTEP_RESTRICT out{0} = call->out[{0}];", store.column));
    const bool in_slots = store.table == Store::Table::slots;
    if (store.table == Store::Table::fixed) {
      body += fmt::format("    out{}[{}] += r{};\n", store.column, store.entry, store.value);
      continue;
    }
    if (in_slots)
      tables.insert(fmt::format("const int* const slots = call->slots + i * {};", width_));
    else
      tables.insert(fmt::format("const int* const positions = call->positions + i * {};", position_width));
    body += fmt::format("    out{}[{}[{}]] += r{};\n", store.column, in_slots ? "slots" : "positions",
                        store.entry, store.value);
  }
  std::string text = fmt::format(
      "static void {}(const void* data) {{\n  const diracstep_call* const call = (const "
      "diracstep_call*)data;\n",
      name);
  for (const auto& pointer : pointers) text += "  " + pointer + '\n';
  text += "  for (long i = 0; i < call->count; ++i) {\n";
  for (const auto& table : tables) text += "    " + table + '\n';
  return text + body + "  }\n}\n";
}

const std::string& kernel_prelude() {
  static const std::string text = R"(/* Written by DiracStep from a scene file: valid C and C++. */
#include <math.h>
#if defined(__GNUC__)
#define DIRACSTEP_RESTRICT __restrict__
#else
#define DIRACSTEP_RESTRICT
#endif
#ifdef __cplusplus
#define DIRACSTEP_PUBLIC extern "C"
#else
#define DIRACSTEP_PUBLIC
#endif
typedef struct {
  long count;
  const int* slots;
  const int* positions;
  const double* known;
  const double* instance;
  const double* in[3];
  const double* multipliers;
  double* out[3];
  double t, s;
} diracstep_call;
typedef void (*diracstep_kernel)(const void*);
static inline double diracstep_sign(double x) { return x > 0.0 ? 1.0 : x < 0.0 ? -1.0 : 0.0; }
static inline double diracstep_min(double a, double b) { return a < b || a != a ? a : b; }
static inline double diracstep_max(double a, double b) { return a > b || a != a ? a : b; }
static inline double diracstep_where(double a, double b) { return a > 0.0 ? b : a < 0.0 ? 0.0 : b / 2.0; }
)";
  return text;
}

std::string content_name(const std::string& text) { return sha256(text).substr(0, 32); }

}  // namespace diracstep::scene_compiler
