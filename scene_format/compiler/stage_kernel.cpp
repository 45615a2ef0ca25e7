#include <fmt/format.h>

#include <algorithm>
#include <diracstep/scene_format/compiler/stage_kernel.hpp>

namespace diracstep::scene_compiler {

namespace {

/// As fixed_stages().
constexpr std::size_t most_stage_coordinates = 4, most_stage_rows = 2;
/// Where the formulas are longer, they are what takes the time, not what stands around them; and a compiler,
/// which unrolls them over the stages, takes long.
constexpr std::size_t most_instructions = 64;
constexpr std::size_t position_kernel = 0, first_derivatives_kernel = 1;

bool written_out(const SceneFunction& function, std::initializer_list<std::size_t> kernels) {
  return function.autonomous && std::ranges::all_of(function.pieces, [&](const Piece& piece) {
           return piece.loops.empty() && std::ranges::all_of(kernels, [&](std::size_t number) {
                    return piece.kernels[number].of_coordinates_alone();
                  });
         });
}

/// The struct StageKernelCall.
constexpr const char* stage_prelude = R"(typedef struct {
  const double* known;
  const double *q0, *p0;
  const double *position, *lobatto, *force, *impulse;
  double per_step;
  double* x;
  double *gauss, *lobatto_points;
  double *lq, *lv;
  double *at_lobatto, *at_gauss;
  double* impulses;
  double* f;
  double largest_impulse;
  double momentum, constraint;
  void* owner;
  int (*next)(void* owner);
  void (*solve_rows)(void* owner, double*);
  const double *inverse_mass, *constraint_forms, *through_mass;
  const double *by_constraint, *by_impulse;
} diracstep_stages;
typedef void (*diracstep_stage_kernel)(void*);
)";

std::size_t size(const SceneFunction& function, std::initializer_list<std::size_t> kernels) {
  std::size_t sum = 0;
  for (const Piece& piece : function.pieces)
    for (const std::size_t number : kernels) sum += piece.kernels[number].size();
  return sum;
}

std::string replaced(const std::string& lines, char mark, int number) {
  std::string text;
  for (const char c : lines) c == mark ? text += std::to_string(number) : text += c;
  return text;
}

/// The lines for # = 0 … count − 1.
std::string repeated(const std::string& lines, int count) {
  std::string text;
  for (int k = 0; k < count; ++k) text += replaced(lines, '#', k);
  return text;
}

/// Before a loop over the stages with these kernels in it.  A compiler unrolls the loop first and then does
/// not see that roots and quotients could be taken side by side, which is where the time goes.
std::string vectorised(const SceneFunction& function, std::size_t kernel) {
  const bool slow = std::ranges::any_of(function.pieces, [&](const Piece& piece) {
    return piece.kernels[kernel].has_roots_or_quotients_alone();
  });
  return slow ? "#pragma GCC unroll 1\n" : "";
}

/// The lines for each stage i.
std::string lanes(const std::string& lines, int first = 0, const char* end = "S") {
  return fmt::format("  for (int i = {}; i < {}; ++i) {{\n{}  }}\n", first, end, lines);
}

/// result_i = base_i + Σ_k weights[s k + i] terms_k.
std::string sums(const char* result, const char* base, const char* weights, const char* terms) {
  return fmt::format(
      "  for (int i = 0; i < S; ++i) sum[i] = call->{2}[i] * {3}[0];\n"
      "  for (int k = 1; k < S; ++k)\n"
      "    for (int i = 0; i < S; ++i) sum[i] += call->{2}[S * k + i] * {3}[k];\n"
      "  for (int i = 0; i < S; ++i) {0} = {1} + sum[i];\n",
      result, base, weights, terms);
}

std::string table_of_kernels(const std::string& name, const std::string& kernels) {
  return fmt::format(
      "DIRACSTEP_PUBLIC const diracstep_stage_kernel {0}[];\n"
      "const diracstep_stage_kernel {0}[] = {{{1}}};\n",
      name, kernels);
}

}  // namespace

StageKernels::StageKernels(const SceneProgram& program)
    : graph_(program.graph), n_(static_cast<int>(program.symbols.families.size())) {
  const auto& families = program.symbols.families;
  const bool few = families.size() <= most_stage_coordinates &&
                   std::ranges::all_of(families, [](const auto& family) { return family.loops.empty(); });
  if (!few || !program.lagrangian || program.rows.size() > 1) return;
  if (program.lagrangian->y_hessian_zero && !program.lagrangian->separable) return;  // another step
  if (!written_out(*program.lagrangian, {first_derivatives_kernel})) return;
  std::size_t instructions = size(*program.lagrangian, {first_derivatives_kernel});
  if (!program.rows.empty()) {
    const SceneFunction& rows = program.rows.front();
    if (rows.groups.size() > most_stage_rows || !rows.workless ||
        !written_out(rows, {position_kernel, first_derivatives_kernel}))
      return;
    instructions += size(rows, {position_kernel, first_derivatives_kernel});
    rows_ = &rows;
    m_ = static_cast<int>(rows.groups.size());
    std::vector<std::pair<int, int>> entries;
    for (const Piece& piece : rows.pieces)
      for (const auto& [output, slot] : piece.entries)
        entries.emplace_back(piece.groups[static_cast<std::size_t>(output)],
                             graph_[piece.slots[static_cast<std::size_t>(slot)]].a);
    pattern_ = SparsityPattern(m_, n_, entries);
  }
  if (instructions <= most_instructions) lagrangian_ = &*program.lagrangian;
}

std::string StageKernels::source_file(const std::string& table, int stages) const {
  return kernel_prelude() + stage_prelude + source(stages) +
         table_of_kernels(table, fmt::format("stages{}", stages));
}

std::string StageKernels::appendix(const std::string& table) const {
  std::string text = stage_prelude, names;
  for (int s = 1; s <= most_stages; ++s) {
    text += source(s);
    names += fmt::format("{}stages{}", s > 1 ? ", " : "", s);
  }
  return text + table_of_kernels(table, names);
}

/// Arrays over the stages: v, lambda the unknowns; q, lq, lv and a (the entries of A) at the Gauss nodes;
/// node, impulse and b (the entries of A) at the Lobatto nodes; f and phi the residual.
std::string StageKernels::source(int stages) const {
  std::string text = fmt::format("#undef S\n#define S {0}\nstatic void stages{0}(void* data) {{\n", stages);
  text +=
      "  diracstep_stages* const call = (diracstep_stages*)data;\n"
      "  const double* const known = call->known;\n  (void)known;\n"
      "  double sum[S], largest[S], total[S];\n";
  text += coordinates("  double q#[S], v#[S], lq#[S], lv#[S], f#[S];\n");
  if (m_ > 0)
    text += coordinates("  double node#[S], impulse#[S];\n") + rows("  double lambda#[S], phi#[S];\n");
  text += entries("  double a@_#[S], b@_#[S];\n");
  text += lanes(coordinates("    v#[i] = call->x[N * i + #];\n") +
                rows("    lambda#[i] = call->x[N * S + M * i + #];\n"));
  text += "  for (;;) {\n" + momentum();
  if (m_ > 0) text += impulses() + constraint();
  text += norm("momentum", "f", n_, "N", "0") + norm("constraint", "phi", m_, "M", "N * S");
  text += "  const int next = call->next ? call->next(call->owner) : 0;\n  if (next == 0) return;\n";
  text += correction() + "  if (next == 2) return;\n  }\n}\n";
  const auto put = [&](const char* name, int value) {
    for (std::size_t at = 0; (at = text.find(name, at)) != std::string::npos;)
      text.replace(at, 1, std::to_string(value));
  };
  put("N *", n_);
  put("M *", m_);
  return text;
}

/// The lines once for each coordinate, in place of #.
std::string StageKernels::coordinates(const std::string& lines) const { return repeated(lines, n_); }
std::string StageKernels::rows(const std::string& lines) const { return repeated(lines, m_); }

/// The lines once for each entry (@, #) of A, number ~ among them.
std::string StageKernels::entries(const std::string& lines) const {
  std::string text;
  pattern_.for_each([&](Eigen::Index e, int a, int c) {
    text += replaced(replaced(replaced(lines, '#', c), '@', a), '~', static_cast<int>(e));
  });
  return text;
}

std::string StageKernels::momentum() const {
  return coordinates(sums("q#[i]", "call->q0[#]", "position", "v#")) +
         vectorised(*lagrangian_, first_derivatives_kernel) +
         lanes(coordinates("    lq#[i] = lv#[i] = 0.0;\n") +
               derivatives(*lagrangian_, first_derivatives_kernel, {"q", "a", "i"}) + rows_at_gauss()) +
         coordinates("  for (int i = 0; i < S; ++i) f#[i] = lv#[i] - call->p0[#];\n" +
                     sums("f#[i]", "f#[i]", "force", "lq#")) +
         lanes(coordinates("    call->gauss[N * i + #] = q#[i];\n    call->lq[N * i + #] = lq#[i];\n"
                           "    call->lv[N * i + #] = lv#[i];\n"));
}

std::string StageKernels::impulses() const {
  std::string text = coordinates(sums("node#[i]", "call->q0[#]", "lobatto", "v#"));
  text +=
      lanes(coordinates("    call->lobatto_points[N * (i + 1) + #] = node#[i];\n    impulse#[i] = 0.0;\n") +
            entries("    b@_#[i] = i == 0 ? call->at_lobatto[~] : 0.0;\n") + "    largest[i] = 0.0;\n");
  text += lanes(derivatives(*rows_, first_derivatives_kernel, {"node", "b", "i + 1"}), 0, "S - 1");
  text += lanes(
      entries("    {\n    const double term = b@_#[i] * lambda@[i], size = fabs(term);\n"
              "    largest[i] = size > largest[i] ? size : largest[i];\n    impulse#[i] += term;\n    }\n"));
  text += lanes(coordinates("    call->impulses[N * i + #] = impulse#[i];\n") +
                entries(fmt::format("    call->at_lobatto[{} * i + ~] = b@_#[i];\n", pattern_.nonzeros())));
  text +=
      "  {\n  double most = 0.0;\n"
      "  for (int i = 0; i < S; ++i) most = largest[i] > most ? largest[i] : most;\n"
      "  call->largest_impulse = most;\n  }\n";
  return text + coordinates(sums("f#[i]", "f#[i]", "impulse", "impulse#"));
}

/// A of nonholonomic rows, in the loop that holds ∂L/∂q: the two share sines and cosines.
std::string StageKernels::rows_at_gauss() const {
  if (m_ == 0 || rows_->holonomic) return "";
  return entries("    a@_#[i] = 0.0;\n") + derivatives(*rows_, first_derivatives_kernel, {"q", "a", "i"});
}

std::string StageKernels::constraint() const {
  const std::string zero = rows("    phi#[i] = 0.0;\n");
  if (rows_->holonomic)
    return lanes(zero + derivatives(*rows_, position_kernel, {"node", "b", "i"}) +
                 rows("    phi#[i] *= call->per_step;\n"));
  return lanes(zero + entries("    phi@[i] += a@_#[i] * v#[i];\n") +
               entries(fmt::format("    call->at_gauss[{} * i + ~] = a@_#[i];\n", pattern_.nonzeros())));
}

/// The part of f into its place, and its largest entry.
std::string StageKernels::norm(const std::string& result, const std::string& value, int count,
                               const std::string& width, const std::string& first) const {
  if (count == 0) return "";
  return lanes(repeated(fmt::format("    call->f[{} + {} * i + #] = {}#[i];\n", first, width, value), count) +
               "    largest[i] = total[i] = 0.0;\n") +
         lanes(repeated(fmt::format("    {{\n    const double size = fabs({}#[i]);\n"
                                    "    largest[i] = size > largest[i] ? size : largest[i];\n"
                                    "    total[i] += size;\n    }}\n",
                                    value),
                        count)) +
         "  {\n  double most = 0.0, all = 0.0;\n" +
         lanes("    most = largest[i] > most ? largest[i] : most;\n    all += total[i];\n") +
         fmt::format("  call->{} = all - all == 0.0 ? most : HUGE_VAL;\n  }}\n", result);
}

/// x ← x − P⁻¹F as StageSplitting solves it; the velocities of the correction are in lv.
std::string StageKernels::correction() const {
  std::string text;
  if (lagrangian_->y_hessian_diagonal)
    text += lanes(coordinates(fmt::format("    lv#[i] = call->inverse_mass[{} * #] * f#[i];\n", n_ + 1)));
  else
    for (int c = 0; c < n_; ++c) {
      std::string lines = "    lv#[i] = 0.0;\n";
      for (int k = 0; k < n_; ++k)
        lines += fmt::format("    lv#[i] += call->inverse_mass[# + N * {0}] * f{0}[i];\n", k);
      text += lanes(replaced(lines, '#', c));
    }
  if (m_ > 0) text += correction_of_rows();
  return text + lanes(coordinates("    v#[i] -= lv#[i];\n    call->x[N * i + #] = v#[i];\n"
                                  "    call->f[N * i + #] = lv#[i];\n") +
                      rows("    lambda#[i] -= phi#[i];\n    call->x[N * S + M * i + #] = lambda#[i];\n"
                           "    call->f[N * S + M * i + #] = phi#[i];\n"));
}

std::string StageKernels::correction_of_rows() const {
  const auto each = [this](const char* lines) {  // coordinate by coordinate within each row
    std::string text;
    for (int a = 0; a < m_; ++a) text += replaced(coordinates(lines), '@', a);
    return text;
  };
  std::string text = coordinates(rows_->holonomic ? sums("impulse#[i]", "0.0", "by_constraint", "lv#")
                                                  : lanes("    impulse#[i] = lv#[i];\n"));
  text += lanes(each("    phi@[i] -= call->constraint_forms[N * M * i + @ + M * #] * impulse#[i];\n"));
  text += "  {\n  double rows[M * S];\n" + lanes(rows("    rows[M * i + #] = phi#[i];\n")) +
          "  call->solve_rows(call->owner, rows);\n" + lanes(rows("    phi#[i] = rows[M * i + #];\n")) +
          "  }\n";
  text += lanes(coordinates("    impulse#[i] = 0.0;\n") +
                each("    impulse#[i] += call->through_mass[N * M * i + # + N * @] * phi@[i];\n"));
  return text + coordinates(sums("lv#[i]", "lv#[i]", "by_impulse", "impulse#"));
}

/// The kernel of all pieces at point i: adds to lq, lv, phi or the entries of A.
std::string StageKernels::derivatives(const SceneFunction& function, std::size_t kernel,
                                      const Names& names) const {
  std::string text;
  for (const Piece& piece : function.pieces) {
    text += "    {\n" + piece.kernels[kernel].instructions([&](int role, int slot) {
      const bool position = role == static_cast<int>(Role::position);
      return fmt::format("{}{}[i]", position ? names.position : "v", coordinate(piece, slot));
    });
    for (const Store& store : piece.kernels[kernel].stores())
      text += fmt::format("    {}[{}] += r{};\n", target(function, piece, store, names.entry), names.lane,
                          store.value);
    text += "    }\n";
  }
  return text;
}

/// Where a value of L or of the rows goes.
std::string StageKernels::target(const SceneFunction& function, const Piece& piece, const Store& store,
                                 const char* entry) const {
  const auto row = [&](int output) { return piece.groups[static_cast<std::size_t>(output)]; };
  if (store.table == Store::Table::positions) {
    const auto& [output, slot] = piece.entries[static_cast<std::size_t>(store.entry)];
    return fmt::format("{}{}_{}", entry, row(output), coordinate(piece, slot));
  }
  if (function.kind == FunctionKind::rows)
    return fmt::format("phi{}", row(store.entry - piece.layout.slot_count));
  return fmt::format("{}{}", store.column == 0 ? "lq" : "lv", coordinate(piece, store.entry));
}

int StageKernels::coordinate(const Piece& piece, int slot) const {
  return graph_[piece.slots[static_cast<std::size_t>(slot)]].a;
}

}  // namespace diracstep::scene_compiler
