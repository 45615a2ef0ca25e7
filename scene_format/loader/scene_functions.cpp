#include <algorithm>
#include <array>
#include <diracstep/core/system/stage_kernel.hpp>
#include <diracstep/scene_format/compiler/evaluator.hpp>
#include <diracstep/scene_format/loader/loaded_function.hpp>
#include <diracstep/scene_format/loader/scene_functions.hpp>
#include <set>
#include <utility>

namespace diracstep {

using namespace scene_compiler;

namespace {

/// The pattern of the entries and of their mirrors.
SparsityPattern symmetric_pattern(int n, std::vector<std::pair<int, int>> entries) {
  const std::size_t count = entries.size();
  for (std::size_t k = 0; k < count; ++k) entries.emplace_back(entries[k].second, entries[k].first);
  return {n, n, entries};
}

/// Member by member: a struct set to zero as a whole costs more than the kernel of a small scene.
KernelCall call_at(double t, const double* x, const double* y = nullptr) {
  return {0, nullptr, nullptr, nullptr, nullptr, {x, y, nullptr}, nullptr, {nullptr, nullptr, nullptr},
          t, 0.0};
}

constexpr int few = 8;

template <int... I>
void clear_few(double* x, Eigen::Index size, std::integer_sequence<int, I...>) {
  ((I < size ? void(x[I] = 0.0) : void()), ...);
}

/// x = 0, without a call for the few entries of a small scene.
void clear(VectorRef& x) {  // by reference: copies of references are not free
  if (x.size() > few) return void(x.setZero());
  clear_few(x.data(), x.size(), std::make_integer_sequence<int, few>());
}

/// The same for a few columns: two at a time and no call, which is quicker up to some dozens.
void clear(double* x, int size) {
  for (int i = 0; i + 1 < size; i += 2) x[i] = x[i + 1] = 0.0;
  if (size % 2 == 1) x[size - 1] = 0.0;
}

template <class Base>
class FilePhaseFunction : public Base {
 public:
  explicit FilePhaseFunction(LoadedFunction function)
      : Base(symmetric_pattern(function.dimension(), function.entries(false)),
             structure_of(function.function())),
        function_(std::move(function)) {
    function_.find_positions(this->pattern(), false);
  }

  double value(double t, ConstVectorRef x, ConstVectorRef y) const override {
    double sum = 0.0;
    KernelCall call = call_at(t, x.data(), y.data());
    call.out[0] = &sum;
    function_.run(0, call);
    return sum;
  }

  void gradient(double t, ConstVectorRef x, ConstVectorRef y, VectorRef fx, VectorRef fy) const override {
    clear(fx);
    clear(fy);
    KernelCall call = call_at(t, x.data(), y.data());
    call.out[0] = fx.data();
    call.out[1] = fy.data();
    function_.run(1, call);
  }

  void hessian(double t, ConstVectorRef x, ConstVectorRef y, VectorRef fxx, VectorRef fxy,
               VectorRef fyy) const override {
    clear(fxx);
    clear(fxy);
    clear(fyy);
    KernelCall call = call_at(t, x.data(), y.data());
    call.out[0] = fxx.data();
    call.out[1] = fxy.data();
    call.out[2] = fyy.data();
    function_.run(2, call);
  }

  void gradients(const PointColumns& at, double* fx, double* fy) const override {
    if (!at_once(at)) return Base::gradients(at, fx, fy);
    clear(fx, this->dimension() * at.count);
    clear(fy, this->dimension() * at.count);
    KernelCall call = call_at(at.times[0], at.x, at.y);
    call.out[0] = fx;
    call.out[1] = fy;
    function_.run(1, call, at.count);
  }

  void hessians(const PointColumns& at, double* fxx, double* fxy, double* fyy) const override {
    if (!at_once(at)) return Base::hessians(at, fxx, fxy, fyy);
    for (double* const of : {fxx, fxy, fyy}) clear(of, this->pattern().nonzeros() * at.count);
    KernelCall call = call_at(at.times[0], at.x, at.y);
    call.out[0] = fxx;
    call.out[1] = fxy;
    call.out[2] = fyy;
    function_.run(2, call, at.count);
  }

  void gradient_rate(double t, ConstVectorRef x, ConstVectorRef y, VectorRef fyt) const override {
    clear(fyt);
    KernelCall call = call_at(t, x.data(), y.data());
    call.out[0] = fyt.data();
    function_.run(3, call);
  }

  void position_gradient_rate(double t, ConstVectorRef x, ConstVectorRef y, VectorRef fxt) const override {
    clear(fxt);
    KernelCall call = call_at(t, x.data(), y.data());
    call.out[0] = fxt.data();
    function_.run(4, call);
  }

 protected:
  const LoadedScene& scene() const { return function_.scene(); }

 private:
  /// A call holds one time.
  bool at_once(const PointColumns& at) const {
    return at.count <= function_.points_at_once() && this->structure().autonomous;
  }
  static PhaseStructure structure_of(const SceneFunction& f) {
    return {f.separable, f.y_hessian_constant, f.y_hessian_diagonal,
            f.quadratic, f.y_hessian_zero,     f.autonomous,
            f.x_absent};
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

  std::string origin(int row) const override { return function_.row_origin(row); }
  const LoadedScene& scene() const { return function_.scene(); }

  bool workless() const override { return function_.function().workless; }

  void position(double t, ConstVectorRef q, VectorRef phi) const override {
    if (!holonomic()) return ConstraintRows::position(t, q, phi);
    clear(phi);
    KernelCall call = call_at(t, q.data());
    call.out[0] = phi.data();
    function_.run(0, call);
  }

  void coefficients(double t, ConstVectorRef q, VectorRef a, VectorRef b) const override {
    clear(a);
    clear(b);
    KernelCall call = call_at(t, q.data());
    call.out[0] = a.data();
    call.out[1] = b.data();
    function_.run(1, call);
  }

  void derivative(double t, ConstVectorRef q, ConstVectorRef w, double s, VectorRef d) const override {
    clear(d);
    KernelCall call = call_at(t, q.data());
    call.in[2] = w.data();
    call.s = s;
    call.out[0] = d.data();
    function_.run(2, call);
  }

  void time_derivative(double t, ConstVectorRef q, ConstVectorRef v, VectorRef d) const override {
    clear(d);
    KernelCall call = call_at(t, q.data());
    call.in[2] = v.data();
    call.out[0] = d.data();
    function_.run(3, call);
  }

  void annihilator_derivative(double t, ConstVectorRef q, ConstVectorRef lambda, VectorRef d) const override {
    clear(d);
    KernelCall call = call_at(t, q.data());
    call.multipliers = lambda.data();
    call.out[0] = d.data();
    function_.run(annihilator_kernel, call);
  }

  void positions(const PointColumns& at, double* phi) const override {
    if (!holonomic() || !at_once(at)) return ConstraintRows::positions(at, phi);
    KernelCall call = call_at(at.times[0], at.x);
    run(0, at, call, phi, rows());
  }

  void coefficients_at(const PointColumns& at, double* a, double* b) const override {
    if (!at_once(at)) return ConstraintRows::coefficients_at(at, a, b);
    clear(b, rows() * at.count);
    KernelCall call = call_at(at.times[0], at.x);
    call.out[1] = b;
    run(1, at, call, a, pattern().nonzeros());
  }

  void derivatives(const PointColumns& at, double* d) const override {
    if (!at_once(at)) return ConstraintRows::derivatives(at, d);
    KernelCall call = call_at(at.times[0], at.x);
    call.in[2] = at.y;
    call.s = 1.0;
    run(2, at, call, d, pattern().nonzeros());
  }

  void annihilator_derivatives(const PointColumns& at, const double* multipliers, double* d) const override {
    if (!at_once(at)) return ConstraintRows::annihilator_derivatives(at, multipliers, d);
    KernelCall call = call_at(at.times[0], at.x);
    call.multipliers = multipliers;
    run(annihilator_kernel, at, call, d, curvature_pattern().nonzeros());
  }

 private:
  /// A call holds one time.
  bool at_once(const PointColumns& at) const { return at.count <= function_.points_at_once() && workless(); }

  /// Kernel `number` into columns of so many entries.
  void run(std::size_t number, const PointColumns& at, KernelCall& call, double* out, int entries) const {
    clear(out, entries * at.count);
    call.out[0] = out;
    function_.run(number, call, at.count);
  }

  LoadedFunction function_;
};

class FileLagrangian final : public FilePhaseFunction<Lagrangian>, public StageKernelSource {
 public:
  using FilePhaseFunction::FilePhaseFunction;

  StageKernel stage_kernel(const ConstraintRows* rows, int stages, long evaluations) const override {
    const auto* const of_file = dynamic_cast<const FileRows*>(rows);
    const bool of_this_file =
        rows == nullptr ? scene().program->rows.empty() : of_file != nullptr && &of_file->scene() == &scene();
    if (!of_this_file) return {};
    return {scene().stage_kernels.kernel(stages, evaluations), scene().known.data()};
  }
};

class FileForce final : public Force {
 public:
  explicit FileForce(LoadedFunction function)
      : Force(symmetric_pattern(function.dimension(), function.entries(false))),
        function_(std::move(function)) {
    function_.find_positions(pattern(), false);
  }

  void value(double t, ConstVectorRef q, ConstVectorRef v, VectorRef f) const override {
    clear(f);
    KernelCall call = call_at(t, q.data(), v.data());
    call.out[0] = f.data();
    function_.run(0, call);
  }

  void derivatives(double t, ConstVectorRef q, ConstVectorRef v, VectorRef fq, VectorRef fv) const override {
    clear(fq);
    clear(fv);
    KernelCall call = call_at(t, q.data(), v.data());
    call.out[0] = fq.data();
    call.out[1] = fv.data();
    function_.run(1, call);
  }

 private:
  LoadedFunction function_;
};

/// Whether products with parameters that are zero make all outputs zero, as a damper's of the value 0.
bool vanishes(const LoadedScene& scene, const SceneFunction& function) {
  const FormulaGraph& graph = scene.program->graph;
  std::vector<Node> outputs;
  for (const Piece& piece : function.pieces)
    outputs.insert(outputs.end(), piece.outputs.begin(), piece.outputs.end());
  const std::vector<Node> nodes = graph.reachable(outputs);
  std::vector<Node> known;
  for (const Node node : nodes)
    if (graph.known(node) == Known::once && graph[node].op != Op::list) known.push_back(node);
  Evaluator values(*scene.program, scene.parameters, known);
  values.evaluate();
  std::set<Node> zero;
  for (std::size_t k = 0; k < known.size(); ++k)
    if (values.value(k) == 0.0L) zero.insert(known[k]);
  const std::set<Node> decided(known.begin(), known.end());  // 0/0 is no zero
  for (const Node node : nodes) {                            // arguments before what holds them
    if (decided.contains(node)) continue;
    const NodeData& data = graph[node];
    const bool a = zero.contains(data.a), b = zero.contains(data.b);
    const bool both = data.op == Op::add || data.op == Op::subtract;
    const bool first = data.op == Op::negative || data.op == Op::divide || data.op == Op::sum;
    if ((data.op == Op::multiply && (a || b)) || (both && a && b) || (first && a)) zero.insert(node);
  }
  return std::ranges::all_of(outputs, [&](Node node) { return zero.contains(node); });
}

}  // namespace

std::shared_ptr<const Lagrangian> file_lagrangian(const LoadedScenePtr& scene) {
  if (!scene->program->lagrangian) return nullptr;
  return std::make_shared<FileLagrangian>(LoadedFunction(scene, *scene->program->lagrangian));
}

std::shared_ptr<const Hamiltonian> file_hamiltonian(const LoadedScenePtr& scene) {
  if (!scene->program->hamiltonian) return nullptr;
  return std::make_shared<FilePhaseFunction<Hamiltonian>>(
      LoadedFunction(scene, *scene->program->hamiltonian));
}

std::shared_ptr<const Lagrangian> file_cost(const LoadedScenePtr& scene) {
  if (!scene->program->cost) return nullptr;
  return std::make_shared<FilePhaseFunction<Lagrangian>>(LoadedFunction(scene, *scene->program->cost));
}

std::shared_ptr<const Lagrangian> file_end_cost(const LoadedScenePtr& scene) {
  if (!scene->program->end_cost) return nullptr;
  return std::make_shared<FilePhaseFunction<Lagrangian>>(LoadedFunction(scene, *scene->program->end_cost));
}

std::shared_ptr<const Force> file_force(const LoadedScenePtr& scene) {
  if (!scene->program->force || vanishes(*scene, *scene->program->force)) return nullptr;
  return std::make_shared<FileForce>(LoadedFunction(scene, *scene->program->force));
}

ConstraintBlocks file_constraints(const LoadedScenePtr& scene) {
  ConstraintBlocks blocks;
  for (const SceneFunction& rows : scene->program->rows)
    blocks.push_back(std::make_shared<FileRows>(LoadedFunction(scene, rows)));
  return blocks;
}

ValueFunction file_value(const LoadedScenePtr& scene, const SceneFunction& of) {
  auto function = std::make_shared<const LoadedFunction>(scene, of);
  return [function](double t, ConstVectorRef q, ConstVectorRef y) {
    double sum = 0.0;
    KernelCall call = call_at(t, q.data(), y.data());
    call.out[0] = &sum;
    function->run(0, call);
    return sum;
  };
}

PointFunction file_point_value(const LoadedScenePtr& scene, const SceneFunction& of,
                               const std::vector<std::string>& rows) {
  auto function = std::make_shared<const LoadedFunction>(scene, of);
  std::vector<Eigen::Index> places;  // of the forces that formulas read, -1 where there is none
  for (const std::string& name : scene->program->symbols.forces) {
    const auto found = std::ranges::find(rows, name);
    places.push_back(found == rows.end() ? -1 : found - rows.begin());
  }
  const bool by_momentum = !scene->program->lagrangian;
  return [function, places, by_momentum](const MotionPoint& at) {
    double sum = 0.0;
    std::vector<double> forces;
    for (const Eigen::Index place : places)
      forces.push_back(place >= 0 && place < at.lambda.size() ? at.lambda[place] : 0.0);
    const Vector &second = by_momentum ? at.p : at.v, &other = by_momentum ? at.v : at.p;
    KernelCall call = call_at(at.t, at.q.data(), second.data());
    call.in[2] = other.data();
    call.multipliers = forces.data();
    call.out[0] = &sum;
    function->run(0, call);
    return sum;
  };
}

std::shared_ptr<const ConstraintRows> file_rows(const LoadedScenePtr& scene, const SceneFunction& of) {
  return std::make_shared<FileRows>(LoadedFunction(scene, of));
}

}  // namespace diracstep
