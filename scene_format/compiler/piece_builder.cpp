#include <algorithm>
#include <diracstep/scene_format/compiler/piece_builder.hpp>

namespace diracstep::scene_compiler {

using Table = Store::Table;

void PieceBuilder::find_slots(Piece& piece) {
  std::vector<Node> roots = piece.outputs;
  roots.insert(roots.end(), piece.targets.begin(), piece.targets.end());
  for (const Node node : graph_.reachable(roots)) {
    const NodeData data = graph_[node];
    if (data.op != Op::coordinate) continue;
    const Node position = graph_.coordinate(data.a, data.b, Role::position);
    if (piece.layout.slots.try_emplace(position, static_cast<int>(piece.slots.size())).second)
      piece.slots.push_back(position);
  }
  piece.layout.slot_count = static_cast<int>(piece.slots.size());
  piece.layout.output_count = static_cast<int>(piece.groups.size());
}

Node PieceBuilder::leaf(const Piece& piece, std::size_t slot, Role role) {
  const NodeData data = graph_[piece.slots[slot]];
  return graph_.coordinate(data.a, data.b, role);
}

PieceBuilder::Matrix PieceBuilder::gradients(const Piece& piece, const std::vector<Node>& roots, Role role) {
  if (const std::size_t most = size_limits().derivatives; roots.size() * piece.slots.size() > most)
    throw FormulaGraph::TooLarge("a piece of more than " + std::to_string(most) + " derivatives");
  Matrix rows(roots.size(), std::vector<Node>(piece.slots.size()));
  for (std::size_t k = 0; k < piece.slots.size(); ++k) {
    const std::vector<Node> column = graph_.derivative(roots, leaf(piece, k, role));
    for (std::size_t r = 0; r < roots.size(); ++r) rows[r][k] = column[r];
  }
  return rows;
}

/// Whether the second derivatives miss something: a jump of the first ones.
bool PieceBuilder::has_kink(const Piece& piece) const {
  return std::ranges::any_of(graph_.reachable(piece.outputs), [&](Node node) {
    const Op op = graph_[node].op;
    const bool kink = op == Op::abs || op == Op::sign || op == Op::min || op == Op::max || op == Op::where ||
                      op == Op::floor || op == Op::table;
    return kink && varies(node);
  });
}

void PieceBuilder::add_kernel(Piece& piece, const std::vector<Store>& stores) {
  piece.kernels.emplace_back(graph_, stores, piece.layout, known_, piece.instance);
}

void PieceBuilder::add_value(SceneFunction& function, Piece piece) {
  find_slots(piece);
  add_kernel(piece, {{0, Table::fixed, 0, piece.outputs[0]}});
  function.pieces.push_back(std::move(piece));
}

void PieceBuilder::add_outputs(SceneFunction& function, Piece piece) {
  find_slots(piece);
  std::vector<Store> values;
  for (std::size_t r = 0; r < piece.outputs.size(); ++r)
    values.push_back({0, Table::slots, piece.layout.slot_count + static_cast<int>(r), piece.outputs[r]});
  add_kernel(piece, values);
  function.pieces.push_back(std::move(piece));
}

void PieceBuilder::add_phase(SceneFunction& function, Piece piece) {
  find_slots(piece);
  const std::size_t n = piece.slots.size();
  const std::vector<Node> fx = gradients(piece, piece.outputs, Role::position)[0];
  const std::vector<Node> fy = gradients(piece, piece.outputs, Role::second)[0];
  Matrix fxx = gradients(piece, fx, Role::position), fxy = gradients(piece, fx, Role::second),
         fyy = gradients(piece, fy, Role::second);
  for (std::size_t k = 0; k < n; ++k)  // one node for both places of a symmetric pair
    for (std::size_t l = 0; l < k; ++l) {
      fxx[k][l] = fxx[l][k];
      fyy[k][l] = fyy[l][k];
    }

  std::vector<Store> hessian;
  for (std::size_t k = 0; k < n; ++k)
    for (std::size_t l = 0; l < n; ++l) {
      if (zero(fxx[k][l]) && zero(fxy[k][l]) && zero(fxy[l][k]) && zero(fyy[k][l])) continue;
      const int entry = static_cast<int>(piece.entries.size());
      piece.entries.emplace_back(k, l);
      hessian.insert(hessian.end(), {{0, Table::positions, entry, fxx[k][l]},
                                     {1, Table::positions, entry, fxy[k][l]},
                                     {2, Table::positions, entry, fyy[k][l]}});
      if (!zero(fxy[k][l])) function.separable = false;
      if (varies(fyy[k][l])) function.y_hessian_constant = false;
      if (k != l && !zero(fyy[k][l])) function.y_hessian_diagonal = false;
      if (!zero(fyy[k][l])) function.y_hessian_zero = false;
      if (varies(fxx[k][l]) || varies(fxy[k][l]) || varies(fyy[k][l])) function.quadratic = false;
    }

  for (const Node slope : fx)
    if (!zero(slope)) function.x_absent = false;
  if (has_kink(piece)) function.quadratic = function.y_hessian_constant = false;

  std::vector<Store> gradient, rate, position_rate;
  const std::vector<Node> fyt = graph_.derivative(fy, graph_.time()),
                          fxt = graph_.derivative(fx, graph_.time());
  for (std::size_t k = 0; k < n; ++k) {
    const int slot = static_cast<int>(k);
    gradient.push_back({0, Table::slots, slot, fx[k]});
    gradient.push_back({1, Table::slots, slot, fy[k]});
    rate.push_back({0, Table::slots, slot, fyt[k]});
    position_rate.push_back({0, Table::slots, slot, fxt[k]});
  }
  if (!zero(graph_.derivative(piece.outputs, graph_.time())[0])) function.autonomous = false;
  add_kernel(piece, {{0, Table::fixed, 0, piece.outputs[0]}});
  add_kernel(piece, gradient);
  add_kernel(piece, hessian);
  add_kernel(piece, rate);
  add_kernel(piece, position_rate);
  function.pieces.push_back(std::move(piece));
}

void PieceBuilder::add_rows(SceneFunction& function, Piece piece, const std::vector<Node>& offsets) {
  find_slots(piece);
  const std::size_t n = piece.slots.size(), m = piece.outputs.size();
  const int row_slot = piece.layout.slot_count;
  const Matrix a = gradients(piece, piece.outputs, function.holonomic ? Role::position : Role::second);
  const std::vector<Node> b = function.holonomic ? graph_.derivative(piece.outputs, graph_.time()) : offsets;

  std::vector<Node> contracted;
  for (std::size_t r = 0; r < m; ++r) {
    Node sum = graph_.multiply(graph_.scale(), b[r]);
    for (std::size_t k = 0; k < n; ++k)
      sum = graph_.add(sum, graph_.multiply(a[r][k], leaf(piece, k, Role::direction)));
    contracted.push_back(sum);
  }
  const Matrix contracted_by_q = gradients(piece, contracted, Role::position);
  const std::vector<Node> at_one = graph_.substitute(contracted, graph_.scale(), graph_.number(1.0));
  const std::vector<Node> by_time = graph_.derivative(at_one, graph_.time());

  std::vector<Store> position, coefficients, derivative, rate, annihilator;
  for (std::size_t r = 0; r < m; ++r) {
    const int row = row_slot + static_cast<int>(r);
    position.push_back({0, Table::slots, row, piece.outputs[r]});
    coefficients.push_back({1, Table::slots, row, b[r]});
    rate.push_back({0, Table::slots, row, by_time[r]});
    if (!zero(by_time[r])) function.autonomous = false;
    if (!zero(by_time[r]) || !zero(b[r])) function.workless = false;
    for (std::size_t k = 0; k < n; ++k) {
      if (zero(a[r][k]) && zero(contracted_by_q[r][k])) continue;
      const int entry = static_cast<int>(piece.entries.size());
      piece.entries.emplace_back(r, k);
      coefficients.push_back({0, Table::positions, entry, a[r][k]});
      derivative.push_back({0, Table::positions, entry, contracted_by_q[r][k]});
    }
  }

  std::vector<Node> reaction(n, graph_.number(0.0));  // Aᵀλ
  for (std::size_t k = 0; k < n; ++k)
    for (std::size_t r = 0; r < m; ++r)
      reaction[k] = graph_.add(reaction[k], graph_.multiply(graph_.multiplier(static_cast<int>(r)), a[r][k]));
  const Matrix by_q = gradients(piece, reaction, Role::position);
  for (std::size_t k = 0; k < n; ++k)
    for (std::size_t l = 0; l < n; ++l) {
      if (zero(by_q[k][l]) && zero(by_q[l][k])) continue;
      annihilator.push_back({0, Table::positions, static_cast<int>(piece.curvature.size()), by_q[k][l]});
      piece.curvature.emplace_back(k, l);
    }
  add_kernel(piece, function.holonomic ? position : std::vector<Store>{});
  add_kernel(piece, coefficients);
  add_kernel(piece, derivative);
  add_kernel(piece, rate);
  add_kernel(piece, annihilator);
  function.pieces.push_back(std::move(piece));
}

void PieceBuilder::add_force(SceneFunction& function, Piece piece) {
  find_slots(piece);
  const Matrix fq = gradients(piece, piece.outputs, Role::position),
               fv = gradients(piece, piece.outputs, Role::second);
  std::vector<Store> value, derivatives;
  for (std::size_t r = 0; r < piece.outputs.size(); ++r) {
    value.push_back({0, Table::slots, piece.layout.slots.at(piece.targets[r]), piece.outputs[r]});
    for (std::size_t k = 0; k < piece.slots.size(); ++k) {
      if (zero(fq[r][k]) && zero(fv[r][k])) continue;
      const int entry = static_cast<int>(piece.entries.size());
      piece.entries.emplace_back(piece.layout.slots.at(piece.targets[r]), k);
      derivatives.insert(derivatives.end(),
                         {{0, Table::positions, entry, fq[r][k]}, {1, Table::positions, entry, fv[r][k]}});
    }
  }
  add_kernel(piece, value);
  add_kernel(piece, derivatives);
  function.pieces.push_back(std::move(piece));
}

}  // namespace diracstep::scene_compiler
