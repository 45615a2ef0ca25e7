#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <diracstep/scene_format/compiler/size_limits.hpp>
#include <diracstep/scene_format/loader/loaded_function.hpp>

namespace diracstep {

using namespace scene_compiler;

namespace {

/// Functions of more coordinates, or with larger tables, take points one by one.
constexpr int most_coordinates = 16;
constexpr std::size_t largest_table = 256;

/// The function's part of the table of compiled kernels; null where there is none.
const CompiledKernel* table_of(const LoadedScene& scene, const SceneFunction& function) {
  const CompiledKernel* table = scene.library.kernels;
  if (table == nullptr) return nullptr;
  for (const SceneFunction* other : scene.program->functions()) {
    if (other == &function) return table;
    for (const Piece& piece : other->pieces) table += piece.kernels.size();
  }
  return nullptr;  // an invariant or an output: it is not worth compiling
}

}  // namespace

LoadedFunction::LoadedFunction(LoadedScenePtr scene, const SceneFunction& function, const KeepTurn& keep)
    : scene_(std::move(scene)), function_(&function), table_(table_of(*scene_, function)) {
  place_rows();
  for (const Piece& piece : function.pieces) load(piece, keep);
  const auto small = [](const LoadedPiece& loaded) {
    return loaded.slots.size() + loaded.instance.size() <= largest_table;
  };
  if (!keep && dimension() <= most_coordinates && std::ranges::all_of(pieces_, small)) copy_slots();
  plan_jobs();
}

/// The tables of the first point once more for each further one, whose columns stand behind.
void LoadedFunction::copy_slots() {
  copies_ = points;
  const int rows = static_cast<int>(row_names_.size());
  for (LoadedPiece& loaded : pieces_) {
    const std::size_t slots = loaded.slots.size(), constants = loaded.instance.size();
    const int width = loaded.piece->layout.width(), coordinates = loaded.piece->layout.slot_count;
    for (int point = 1; point < points; ++point) {
      for (std::size_t k = 0; k < slots; ++k) {
        const bool of_coordinate = static_cast<int>(k) % width < coordinates;
        loaded.slots.push_back(loaded.slots[k] + point * (of_coordinate ? dimension() : rows));
      }
      for (std::size_t k = 0; k < constants; ++k) loaded.instance.push_back(loaded.instance[k]);
    }
  }
}

void LoadedFunction::place_rows() {
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

const std::string& LoadedFunction::row_origin(int row) const {
  const auto after = std::ranges::upper_bound(first_rows_, row);
  return function_->groups[static_cast<std::size_t>(after - first_rows_.begin()) - 1].origin;
}

int LoadedFunction::coordinate(const Evaluator& body, std::size_t root, Node leaf, const Turns& turns) const {
  const SceneProgram& program = *scene_->program;
  const NodeData& data = program.graph[leaf];
  const bool two = data.b != none && program.graph[data.b].op == Op::list;
  const std::array<long, 2> index{data.b == none ? 0 : body.whole(root), two ? body.whole(root + 1) : 0};
  const int position = scene_->layout.position(data.a, index);
  if (position >= 0) return position;
  const auto place = program.symbols.places.find(leaf);
  throw SceneError(program.document.file, place == program.symbols.places.end() ? Place{} : place->second,
                   fmt::format("there is no {}{}", scene_->layout.name(data.a, index), turns.text()));
}

void LoadedFunction::load(const Piece& piece, const KeepTurn& keep) {
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
  const std::size_t width = static_cast<std::size_t>(piece.layout.width()) + piece.entries.size() +
                            piece.curvature.size() + piece.instance.nodes().size();
  const std::size_t most = size_limits().entries / std::max<std::size_t>(width, 1);
  turns.run([&](long row) {
    if (static_cast<std::size_t>(loaded.count) >= most)
      throw SceneError(
          program.document.file, {},
          fmt::format("repeated elements of {} coordinates and derivatives each: more than {} turns, "
                      "the limit",
                      width, most));
    turns.set(body);
    body.evaluate();
    for (std::size_t k = 0; k < piece.slots.size(); ++k)
      loaded.slots.push_back(coordinate(body, first_root[k], piece.slots[k], turns));
    if (keep && !keep(std::span(loaded.slots).last(piece.slots.size())))
      return loaded.slots.resize(loaded.slots.size() - piece.slots.size());
    for (const int group : piece.groups)
      loaded.slots.push_back(first_rows_[static_cast<std::size_t>(group)] +
                             (piece.counting_loops > 0 ? static_cast<int>(row) : 0));
    for (std::size_t k = first_constant; k < roots.size(); ++k)
      loaded.instance.push_back(constant(program, body.value(k)));
    ++loaded.count;
  });
  pieces_.push_back(std::move(loaded));
}

template <class Visit>
void LoadedFunction::for_each_entry(const LoadedPiece& loaded, bool curvature, const Visit& visit) const {
  const Piece& piece = *loaded.piece;
  const bool by_row = function_->kind == FunctionKind::rows && !curvature;
  const auto width = static_cast<std::size_t>(piece.layout.width());
  for (std::size_t i = 0; i < static_cast<std::size_t>(loaded.count); ++i) {
    const int* const slots = loaded.slots.data() + i * width;
    for (const auto& [a, b] : curvature ? piece.curvature : piece.entries)
      visit(slots[by_row ? piece.layout.slot_count + a : a], slots[b]);
  }
}

std::vector<std::pair<int, int>> LoadedFunction::entries(bool curvature) const {
  std::vector<std::pair<int, int>> all;
  for (const LoadedPiece& loaded : pieces_)
    for_each_entry(loaded, curvature, [&](int i, int j) { all.emplace_back(i, j); });
  return all;
}

void LoadedFunction::find_positions(const SparsityPattern& pattern, bool curvature) {
  for (LoadedPiece& loaded : pieces_) {
    auto& positions = curvature ? loaded.curvature_positions : loaded.positions;
    for_each_entry(loaded, curvature, [&](int i, int j) { positions.push_back(pattern.position(i, j)); });
    const std::size_t first = positions.size();
    for (int point = 1; point < copies_; ++point)
      for (std::size_t k = 0; k < first; ++k) positions.push_back(positions[k] + point * pattern.nonzeros());
  }
  plan_jobs();
}

/// What does nothing is left out, and all that is not an argument is looked up once.
void LoadedFunction::plan_jobs() {
  jobs_.clear();
  const CompiledKernel* compiled = table_;
  for (const LoadedPiece& loaded : pieces_) {
    const auto& kernels = loaded.piece->kernels;
    jobs_.resize(std::max(jobs_.size(), kernels.size()));
    for (std::size_t number = 0; number < kernels.size(); ++number) {
      if (kernels[number].empty()) continue;
      const bool curvature = function_->kind == FunctionKind::rows && number == annihilator_kernel;
      jobs_[number].push_back({compiled != nullptr ? compiled[number] : nullptr, &kernels[number], &loaded,
                               loaded.count, loaded.slots.data(),
                               (curvature ? loaded.curvature_positions : loaded.positions).data(),
                               loaded.instance.data()});
    }
    if (compiled != nullptr) compiled += kernels.size();
  }
}

void LoadedFunction::run(std::size_t number, KernelCall& call, int count) const {
  if (number >= jobs_.size()) return;  // a function without pieces
  call.known = scene_->known.data();
  for (const Job& job : jobs_[number]) {
    call.count = job.count * count;
    call.slots = job.slots;
    call.positions = job.positions;
    call.instance = job.instance;
    if (job.compiled != nullptr) {
      job.compiled(&call);
      continue;
    }
    const Piece& piece = *job.loaded->piece;
    job.kernel->run(call, piece.instance_width(), piece.position_width(function_->kind, number));
  }
}

}  // namespace diracstep
