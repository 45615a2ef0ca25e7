#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <diracstep/validation/scene_file/scene_functions.hpp>

namespace diracstep {

using namespace scene_compiler;

namespace {

/// Calls `visit(row)` for each turn of the piece's loops, outermost first; `row` counts the turns of its
/// first `counting` loops.
class Turns {
 public:
  Turns(const SceneProgram& program, const ParameterValues& parameters, std::vector<int> loops,
        std::size_t counting)
      : program_(program), loops_(std::move(loops)), counting_(counting), values_(loops_.size()) {
    for (const int id : loops_) {
      const Loop& loop = program.symbols.loops[static_cast<std::size_t>(id)];
      bounds_.emplace_back(program, parameters, std::vector<Node>{loop.first, loop.last});
    }
  }

  template <class Visit>
  void run(const Visit& visit) {
    descend(0, visit);
  }
  /// Values of the loops in the current turn.
  const std::vector<long>& values() const { return values_; }
  const std::vector<int>& loops() const { return loops_; }

 private:
  template <class Visit>
  void descend(std::size_t depth, const Visit& visit) {
    if (depth == loops_.size()) {
      if (++turns_ > LoadedScene::most_instances)
        throw SceneError(
            program_.document.file, {},
            fmt::format("more than {} repeated elements, the limit", LoadedScene::most_instances));
      visit(rows_);
    } else {
      for (std::size_t k = 0; k < depth; ++k) bounds_[depth].set_loop(loops_[k], values_[k]);
      bounds_[depth].evaluate();
      const long first = bounds_[depth].whole(0), last = bounds_[depth].whole(1);
      for (values_[depth] = first; values_[depth] <= last; ++values_[depth]) descend(depth + 1, visit);
    }
    if (depth == counting_) ++rows_;
  }

  const SceneProgram& program_;
  std::vector<int> loops_;
  std::size_t counting_;
  std::vector<long> values_;
  std::vector<Evaluator> bounds_;
  long rows_ = 0, turns_ = 0;
};

std::string turn_text(const SceneProgram& program, const Turns& turns) {
  std::string text;
  for (std::size_t k = 0; k < turns.loops().size(); ++k)
    text += fmt::format("{}{} = {}", k == 0 ? ", at " : ", ",
                        program.symbols.loops[static_cast<std::size_t>(turns.loops()[k])].variable,
                        turns.values()[k]);
  return text;
}

/// A piece with all its instances laid out.
struct LoadedPiece {
  const Piece* piece;
  long count = 0;
  std::vector<int> slots = {};
  std::vector<double> instance = {};
  std::vector<int> positions = {}, curvature_positions = {};
};

/// A function of the scene, ready to be called kernel by kernel.
class LoadedFunction {
 public:
  LoadedFunction(LoadedScenePtr scene, const SceneFunction& function)
      : scene_(std::move(scene)), function_(&function), table_(table_of(*scene_, function)) {
    place_rows();
    for (const Piece& piece : function.pieces) load(piece);
  }

  const SceneFunction& function() const { return *function_; }
  const std::vector<std::string>& row_names() const { return row_names_; }
  int dimension() const { return scene_->layout.dimension(); }

  /// (i, j) of all derivatives: rows and coordinates for rows, else coordinates twice.
  std::vector<std::pair<int, int>> entries(bool curvature) const {
    std::vector<std::pair<int, int>> all;
    for (const LoadedPiece& loaded : pieces_)
      for_each_entry(loaded, curvature, [&](int i, int j) { all.emplace_back(i, j); });
    return all;
  }

  /// Where each instance's derivatives go in the values of `pattern`.
  void find_positions(const SparsityPattern& pattern, bool curvature) {
    for (LoadedPiece& loaded : pieces_) {
      auto& positions = curvature ? loaded.curvature_positions : loaded.positions;
      for_each_entry(loaded, curvature, [&](int i, int j) { positions.push_back(pattern.position(i, j)); });
    }
  }

  /// Adds kernel `number` of every piece to call.out.
  void run(std::size_t number, KernelCall call) const {
    const CompiledKernel* compiled = table_;
    call.known = scene_->known.data();
    for (const LoadedPiece& loaded : pieces_) {
      const Piece& piece = *loaded.piece;
      const Kernel& kernel = piece.kernels[number];
      if (!kernel.empty()) {
        call.count = loaded.count;
        call.slots = loaded.slots.data();
        call.instance = loaded.instance.data();
        const bool curvature = function_->kind == FunctionKind::rows && number == annihilator_kernel;
        call.positions = (curvature ? loaded.curvature_positions : loaded.positions).data();
        if (compiled != nullptr)
          compiled[number](&call);
        else
          kernel.run(call, piece.instance_width(), piece.position_width(function_->kind, number));
      }
      if (compiled != nullptr) compiled += piece.kernels.size();
    }
  }

 private:
  /// The function's part of the table of compiled kernels; null where there is none.
  static const CompiledKernel* table_of(const LoadedScene& scene, const SceneFunction& function) {
    const CompiledKernel* table = scene.library.kernels;
    if (table == nullptr) return nullptr;
    for (const SceneFunction* other : scene.program->functions()) {
      if (other == &function) return table;
      for (const Piece& piece : other->pieces) table += piece.kernels.size();
    }
    return nullptr;  // an invariant: it is not worth compiling
  }

  void place_rows() {
    for (const RowGroup& group : function_->groups) {
      first_rows_.push_back(static_cast<int>(row_names_.size()));
      Turns turns(*scene_->program, scene_->parameters, group.loops, group.loops.size());
      turns.run([&](long) {
        std::string name = group.name;
        for (const long value : turns.values()) name += fmt::format("_{}", value);
        row_names_.push_back(std::move(name));
      });
    }
  }

  int coordinate(const Evaluator& body, std::size_t root, Node leaf, const Turns& turns) const {
    const SceneProgram& program = *scene_->program;
    const NodeData& data = program.graph[leaf];
    const bool two = data.b != none && program.graph[data.b].op == Op::list;
    const std::array<long, 2> index{data.b == none ? 0 : body.whole(root), two ? body.whole(root + 1) : 0};
    const int position = scene_->layout.position(data.a, index);
    if (position >= 0) return position;
    const auto place = program.symbols.places.find(leaf);
    throw SceneError(
        program.document.file, place == program.symbols.places.end() ? Place{} : place->second,
        fmt::format("there is no {}{}", scene_->layout.name(data.a, index), turn_text(program, turns)));
  }

  void load(const Piece& piece) {
    const SceneProgram& program = *scene_->program;
    std::vector<Node> roots;
    std::vector<std::size_t> first_root;  // of the index of each slot
    for (const Node leaf : piece.slots) {
      first_root.push_back(roots.size());
      const Node index = program.graph[leaf].b;
      if (index == none) continue;
      if (program.graph[index].op == Op::list)
        roots.insert(roots.end(), {program.graph[index].a, program.graph[index].b});
      else
        roots.push_back(index);
    }
    const std::size_t first_constant = roots.size();
    roots.insert(roots.end(), piece.instance.nodes().begin(), piece.instance.nodes().end());
    Evaluator body(program, scene_->parameters, roots);
    Turns turns(program, scene_->parameters, piece.loops, piece.counting_loops);
    LoadedPiece loaded{&piece};
    turns.run([&](long row) {
      for (std::size_t k = 0; k < piece.loops.size(); ++k) body.set_loop(piece.loops[k], turns.values()[k]);
      body.evaluate();
      for (std::size_t k = 0; k < piece.slots.size(); ++k)
        loaded.slots.push_back(coordinate(body, first_root[k], piece.slots[k], turns));
      for (const int group : piece.groups)
        loaded.slots.push_back(first_rows_[static_cast<std::size_t>(group)] +
                               (piece.counting_loops > 0 ? static_cast<int>(row) : 0));
      for (std::size_t k = first_constant; k < roots.size(); ++k)
        loaded.instance.push_back(static_cast<double>(body.value(k)));
      ++loaded.count;
    });
    pieces_.push_back(std::move(loaded));
  }

  template <class Visit>
  void for_each_entry(const LoadedPiece& loaded, bool curvature, const Visit& visit) const {
    const Piece& piece = *loaded.piece;
    const bool by_row = function_->kind == FunctionKind::rows && !curvature;
    const auto width = static_cast<std::size_t>(piece.layout.width());
    for (std::size_t i = 0; i < static_cast<std::size_t>(loaded.count); ++i) {
      const int* const slots = loaded.slots.data() + i * width;
      for (const auto& [a, b] : curvature ? piece.curvature : piece.entries)
        visit(slots[by_row ? piece.layout.slot_count + a : a], slots[b]);
    }
  }

  LoadedScenePtr scene_;
  const SceneFunction* function_;
  const CompiledKernel* table_;
  std::vector<LoadedPiece> pieces_;
  std::vector<int> first_rows_;
  std::vector<std::string> row_names_;
};

/// The pattern of the entries and of their mirrors.
SparsityPattern symmetric_pattern(int n, std::vector<std::pair<int, int>> entries) {
  const std::size_t count = entries.size();
  for (std::size_t k = 0; k < count; ++k) entries.emplace_back(entries[k].second, entries[k].first);
  return {n, n, std::move(entries)};
}

template <class Base>
class FilePhaseFunction final : public Base {
 public:
  explicit FilePhaseFunction(LoadedFunction function)
      : Base(symmetric_pattern(function.dimension(), function.entries(false)),
             structure_of(function.function())),
        function_(std::move(function)) {
    function_.find_positions(this->pattern(), false);
  }

  double value(double t, ConstVectorRef x, ConstVectorRef y) const override {
    double sum = 0.0;
    KernelCall call = at(t, x, y);
    call.out[0] = &sum;
    function_.run(0, call);
    return sum;
  }

  void gradient(double t, ConstVectorRef x, ConstVectorRef y, VectorRef fx, VectorRef fy) const override {
    fx.setZero();
    fy.setZero();
    KernelCall call = at(t, x, y);
    call.out[0] = fx.data();
    call.out[1] = fy.data();
    function_.run(1, call);
  }

  void hessian(double t, ConstVectorRef x, ConstVectorRef y, VectorRef fxx, VectorRef fxy,
               VectorRef fyy) const override {
    fxx.setZero();
    fxy.setZero();
    fyy.setZero();
    KernelCall call = at(t, x, y);
    call.out[0] = fxx.data();
    call.out[1] = fxy.data();
    call.out[2] = fyy.data();
    function_.run(2, call);
  }

  void gradient_rate(double t, ConstVectorRef x, ConstVectorRef y, VectorRef fyt) const override {
    fyt.setZero();
    KernelCall call = at(t, x, y);
    call.out[0] = fyt.data();
    function_.run(3, call);
  }

  void position_gradient_rate(double t, ConstVectorRef x, ConstVectorRef y, VectorRef fxt) const override {
    fxt.setZero();
    KernelCall call = at(t, x, y);
    call.out[0] = fxt.data();
    function_.run(4, call);
  }

 private:
  static PhaseStructure structure_of(const SceneFunction& f) {
    return {f.separable, f.y_hessian_constant, f.y_hessian_diagonal, f.quadratic, f.y_hessian_zero};
  }
  static KernelCall at(double t, ConstVectorRef x, ConstVectorRef y) {
    KernelCall call{};
    call.t = t;
    call.in[0] = x.data();
    call.in[1] = y.data();
    return call;
  }

  LoadedFunction function_;
};

class FileRows final : public ConstraintRows {
 public:
  explicit FileRows(LoadedFunction function)
      : ConstraintRows(function.function().holonomic,
                       SparsityPattern(static_cast<int>(function.row_names().size()), function.dimension(),
                                       function.entries(false)),
                       symmetric_pattern(function.dimension(), function.entries(true)), function.row_names()),
        function_(std::move(function)) {
    function_.find_positions(pattern(), false);
    function_.find_positions(curvature_pattern(), true);
  }

  bool constant() const override {
    return std::ranges::all_of(function_.function().pieces, [](const Piece& piece) {
      return std::ranges::all_of(std::array{std::size_t{2}, std::size_t{3}, annihilator_kernel},
                                 [&](std::size_t number) { return piece.kernels[number].empty(); });
    });
  }

  void position(double t, ConstVectorRef q, VectorRef phi) const override {
    if (!holonomic()) return ConstraintRows::position(t, q, phi);
    phi.setZero();
    KernelCall call = at(t, q);
    call.out[0] = phi.data();
    function_.run(0, call);
  }

  void coefficients(double t, ConstVectorRef q, VectorRef a, VectorRef b) const override {
    a.setZero();
    b.setZero();
    KernelCall call = at(t, q);
    call.out[0] = a.data();
    call.out[1] = b.data();
    function_.run(1, call);
  }

  void derivative(double t, ConstVectorRef q, ConstVectorRef w, double s, VectorRef d) const override {
    d.setZero();
    KernelCall call = at(t, q);
    call.in[2] = w.data();
    call.s = s;
    call.out[0] = d.data();
    function_.run(2, call);
  }

  void time_derivative(double t, ConstVectorRef q, ConstVectorRef v, VectorRef d) const override {
    d.setZero();
    KernelCall call = at(t, q);
    call.in[2] = v.data();
    call.out[0] = d.data();
    function_.run(3, call);
  }

  void annihilator_derivative(double t, ConstVectorRef q, ConstVectorRef lambda, VectorRef d) const override {
    d.setZero();
    KernelCall call = at(t, q);
    call.multipliers = lambda.data();
    call.out[0] = d.data();
    function_.run(annihilator_kernel, call);
  }

 private:
  static KernelCall at(double t, ConstVectorRef q) {
    KernelCall call{};
    call.t = t;
    call.in[0] = q.data();
    return call;
  }

  LoadedFunction function_;
};

class FileForce final : public Force {
 public:
  explicit FileForce(LoadedFunction function)
      : Force(symmetric_pattern(function.dimension(), function.entries(false))),
        function_(std::move(function)) {
    function_.find_positions(pattern(), false);
  }

  void value(double t, ConstVectorRef q, ConstVectorRef v, VectorRef f) const override {
    f.setZero();
    KernelCall call = at(t, q, v);
    call.out[0] = f.data();
    function_.run(0, call);
  }

  void derivatives(double t, ConstVectorRef q, ConstVectorRef v, VectorRef fq, VectorRef fv) const override {
    fq.setZero();
    fv.setZero();
    KernelCall call = at(t, q, v);
    call.out[0] = fq.data();
    call.out[1] = fv.data();
    function_.run(1, call);
  }

 private:
  static KernelCall at(double t, ConstVectorRef q, ConstVectorRef v) {
    KernelCall call{};
    call.t = t;
    call.in[0] = q.data();
    call.in[1] = v.data();
    return call;
  }

  LoadedFunction function_;
};

const char* operation(Op op) {
  switch (op) {
    case Op::divide:
      return "division by zero or overflow";
    case Op::log:
      return "the logarithm of a number that is not positive";
    case Op::sqrt:
      return "the square root of a negative number";
    case Op::asin:
    case Op::acos:
      return "asin or acos of a number outside [-1, 1]";
    case Op::acosh:
      return "acosh of a number below 1";
    case Op::atanh:
      return "atanh of a number outside (-1, 1)";
    case Op::pow:
      return "a power that is not defined";
    default:
      return "a value that is not finite";
  }
}

struct StartPoint {
  ConstVectorRef q, v, p;
  double t;
};

/// Computes the outputs of every instance once more, node by node.
void require_outputs_defined(const LoadedScene& scene, const SceneFunction& function, const std::string& what,
                             const StartPoint& start, ConstVectorRef y) {
  const SceneProgram& program = *scene.program;
  for (const Piece& piece : function.pieces) {
    Evaluator body(program, scene.parameters, piece.outputs);
    Turns turns(program, scene.parameters, piece.loops, 0);
    body.set_time(start.t);
    body.set_leaf([&](const NodeData& leaf) -> long double {
      std::array<long, 2> index{0, 0};
      if (leaf.b != none) {
        const bool two = program.graph[leaf.b].op == Op::list;
        Evaluator at(
            program, scene.parameters,
            two ? std::vector{program.graph[leaf.b].a, program.graph[leaf.b].b} : std::vector{leaf.b});
        for (std::size_t k = 0; k < piece.loops.size(); ++k) at.set_loop(piece.loops[k], turns.values()[k]);
        at.evaluate();
        index = {at.whole(0), two ? at.whole(1) : 0};
      }
      const int position = scene.layout.position(leaf.a, index);
      return leaf.c == static_cast<int>(Role::position) ? start.q[position] : y[position];
    });
    turns.run([&](long) {
      for (std::size_t k = 0; k < piece.loops.size(); ++k) body.set_loop(piece.loops[k], turns.values()[k]);
      body.evaluate();
      const Node bad = body.undefined();
      if (bad == none) return;
      const auto place = program.symbols.places.find(bad);
      throw SceneError(program.document.file, place == program.symbols.places.end() ? Place{} : place->second,
                       fmt::format("{}: at the start, {} (of {}){}", what, operation(program.graph[bad].op),
                                   body.arguments_of(bad), turn_text(program, turns)));
    });
  }
}

bool finite(const PhaseFunction& f, double t, ConstVectorRef x, ConstVectorRef y) {
  Vector fx(x.size()), fy(x.size()), fxx(f.pattern().nonzeros()), fxy = fxx, fyy = fxx;
  f.gradient(t, x, y, fx, fy);
  f.hessian(t, x, y, fxx, fxy, fyy);
  return std::isfinite(f.value(t, x, y)) && fx.allFinite() && fy.allFinite() && fxx.allFinite() &&
         fxy.allFinite() && fyy.allFinite();
}

bool finite(const ConstraintRows& rows, double t, ConstVectorRef q) {
  Vector a(rows.pattern().nonzeros()), b(rows.rows()), phi = Vector::Zero(rows.rows());
  rows.coefficients(t, q, a, b);
  if (rows.holonomic()) rows.position(t, q, phi);
  return a.allFinite() && b.allFinite() && phi.allFinite();
}

[[noreturn]] void fail_at_start(const LoadedScene& scene, const std::string& what, Place place) {
  throw SceneError(
      scene.program->document.file, place,
      what + ": a derivative is not finite at the start; move the start or mend the formula there");
}

}  // namespace

LoadedScene::LoadedScene(std::unique_ptr<const SceneProgram> compiled, ParameterValues values)
    : program(std::move(compiled)),
      parameters(std::move(values)),
      layout(*program, parameters),
      library(kernel_library(*program)) {
  Evaluator evaluator(*program, parameters, program->known.nodes());
  evaluator.evaluate();
  for (std::size_t i = 0; i < program->known.nodes().size(); ++i)
    known.push_back(static_cast<double>(evaluator.value(i)));
}

std::shared_ptr<const Lagrangian> file_lagrangian(const LoadedScenePtr& scene) {
  if (!scene->program->lagrangian) return nullptr;
  return std::make_shared<FilePhaseFunction<Lagrangian>>(LoadedFunction(scene, *scene->program->lagrangian));
}

std::shared_ptr<const Hamiltonian> file_hamiltonian(const LoadedScenePtr& scene) {
  if (!scene->program->hamiltonian) return nullptr;
  return std::make_shared<FilePhaseFunction<Hamiltonian>>(
      LoadedFunction(scene, *scene->program->hamiltonian));
}

std::shared_ptr<const Force> file_force(const LoadedScenePtr& scene) {
  if (!scene->program->force) return nullptr;
  return std::make_shared<FileForce>(LoadedFunction(scene, *scene->program->force));
}

ConstraintBlocks file_constraints(const LoadedScenePtr& scene) {
  ConstraintBlocks blocks;
  for (const SceneFunction& rows : scene->program->rows)
    blocks.push_back(std::make_shared<FileRows>(LoadedFunction(scene, rows)));
  return blocks;
}

InvariantFunction file_invariant(const LoadedScenePtr& scene, std::size_t number) {
  auto function = std::make_shared<const LoadedFunction>(scene, scene->program->invariants[number].function);
  return [function](double t, ConstVectorRef q, ConstVectorRef y) {
    double sum = 0.0;
    KernelCall call{};
    call.t = t;
    call.in[0] = q.data();
    call.in[1] = y.data();
    call.out[0] = &sum;
    function->run(0, call);
    return sum;
  };
}

void require_defined(const LoadedScene& scene, const Scene& functions, double t, ConstVectorRef q,
                     ConstVectorRef v, ConstVectorRef p) {
  const SceneProgram& program = *scene.program;
  const StartPoint start{q, v, p, t};
  if (functions.lagrangian && !finite(*functions.lagrangian, t, q, v)) {
    require_outputs_defined(scene, *program.lagrangian, "the Lagrangian", start, v);
    fail_at_start(scene, "the Lagrangian",
                  program.document.lagrangian ? program.document.lagrangian->start : Place{});
  }
  if (functions.hamiltonian && p.size() > 0 && !finite(*functions.hamiltonian, t, q, p)) {
    require_outputs_defined(scene, *program.hamiltonian, "the Hamiltonian", start, p);
    fail_at_start(scene, "the Hamiltonian", program.document.hamiltonian->start);
  }
  for (std::size_t k = 0; k < functions.constraints.size(); ++k) {
    if (finite(*functions.constraints[k], t, q)) continue;
    require_outputs_defined(scene, program.rows[k], "the rows", start, v);
    fail_at_start(scene, "the rows", program.rows[k].groups.front().place);
  }
  if (!functions.force || v.size() == 0) return;
  Vector f(q.size());
  functions.force->value(t, q, v, f);
  if (f.allFinite()) return;
  require_outputs_defined(scene, *program.force, "the force", start, v);
  fail_at_start(scene, "the force", {});
}

}  // namespace diracstep
