#pragma once

#include <array>
#include <deque>
#include <diracstep/scene_format/compiler/formula_graph.hpp>
#include <functional>
#include <set>
#include <span>
#include <string>
#include <unordered_map>
#include <vector>

namespace diracstep::scene_compiler {

/// What a kernel works on.  The same struct stands, as text, at the top of every generated source.
struct KernelCall {
  long count;              ///< instances
  const int* slots;        ///< for each instance: places of its coordinates, then of its rows
  const int* positions;    ///< for each instance: places of its derivatives in the values of a pattern
  const double* known;     ///< computed once from the parameters
  const double* instance;  ///< computed once for each instance
  const double* in[3];     ///< by Role
  const double* multipliers;
  double* out[3];
  double t, s;
};
/// Takes a KernelCall; to the generated source, which may be C, that is a struct of its own.
using CompiledKernel = void (*)(const void* call);
/// Takes a StageKernelCall (core/system/stage_kernel.hpp), likewise.
using CompiledStageKernel = void (*)(void* call);

/// Subexpressions that are computed before any kernel runs.
class Constants {
 public:
  int add(Node node);
  const std::vector<Node>& nodes() const { return nodes_; }

 private:
  std::vector<Node> nodes_;
  std::unordered_map<Node, int> numbers_;
};

/// Where a kernel adds a result: out[column][at], `at` read from a table of the instance.
struct Store {
  enum class Table { fixed, slots, positions };
  int column;
  Table table;
  int entry;  ///< in the table; the place itself where it is fixed
  Node value;
};

/// How the leaves of a piece are reached.
struct PieceLayout {
  std::unordered_map<Node, int> slots;  ///< of each coordinate leaf, by its leaf of role position
  int slot_count = 0;                   ///< coordinates; rows' places follow
  int output_count = 0;
  int width() const { return slot_count + output_count; }
};

/// Straight-line code that runs once for each instance of a piece: value k is computed by instruction k from
/// earlier ones.  It can be run here, slowly, or written as C; both give the same bits.
class Kernel {
 public:
  Kernel(FormulaGraph& graph, const std::vector<Store>& stores, const PieceLayout& layout, Constants& known,
         Constants& instance);

  bool empty() const { return stores_.empty(); }
  void run(const KernelCall& call, int instance_width, int position_width) const;
  /// A C function of this name.
  std::string source(const std::string& name, int instance_width, int position_width) const;
  /// Adds the numbers of the tables that it reads.
  void add_tables(std::set<int>& numbers) const;
  std::size_t size() const { return code_.size(); }

  /// Whether it reads coordinates and what is known of the parameters, nothing else.
  bool of_coordinates_alone() const;
  /// Whether what takes its time are quotients and square roots, of which a processor takes several at once.
  bool has_roots_or_quotients_alone() const;
  /// Its instructions in C, for a place where known[] is in scope; coordinate(role, slot) names a coordinate.
  using CoordinateName = std::function<std::string(int, int)>;
  std::string instructions(const CoordinateName& coordinate) const;
  /// Store::value of each is the number k of the rk that holds it after the instructions.
  const std::vector<Store>& stores() const { return stores_; }

 private:
  enum class From : unsigned char {
    computed,
    literal,
    known,
    instance,
    coordinate,
    multiplier,
    force,
    time,
    scale
  };
  struct Instruction {
    From from;
    NodeData data;  ///< a, b: earlier instructions, or where a leaf is read from; c: column
  };
  std::string expression(const Instruction& instruction, const CoordinateName& coordinate) const;

  const std::deque<LookupTable>* tables_;  ///< of the graph, which outlives the kernel
  std::vector<Instruction> code_;
  std::vector<Store> stores_;  ///< their values are numbers of instructions
  int width_;
};

/// The first lines of every generated source: the struct KernelCall and helpers.
const std::string& kernel_prelude();

/// A name for a text that nobody can give another one: half of its SHA-256.
std::string content_name(const std::string& text);

}  // namespace diracstep::scene_compiler
