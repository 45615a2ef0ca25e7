#include <fmt/format.h>

#include <array>
#include <cmath>
#include <diracstep/scene_format/loader/defined_start.hpp>
#include <diracstep/scene_format/loader/turns.hpp>

namespace diracstep {

using namespace scene_compiler;

namespace {

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
        turns.set(at);
        at.evaluate();
        index = {at.whole(0), two ? at.whole(1) : 0};
      }
      const int position = scene.layout.position(leaf.a, index);
      return leaf.c == static_cast<int>(Role::position) ? start.q[position] : y[position];
    });
    turns.run([&](long) {
      turns.set(body);
      body.evaluate();
      const Node bad = body.undefined();
      if (bad == none) return;
      const auto place = program.symbols.places.find(bad);
      throw SceneError(program.document.file, place == program.symbols.places.end() ? Place{} : place->second,
                       fmt::format("{}: at the start, {} (of {}){}", what, operation(program.graph[bad].op),
                                   body.arguments_of(bad), turns.text()));
    });
  }
}

bool finite(const PhaseFunction& f, double t, ConstVectorRef x, ConstVectorRef y) {
  Vector fx(f.dimension()), fy(fx), fxx(f.pattern().nonzeros()), fxy = fxx, fyy = fxx;
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
  throw SceneError(scene.program->document.file, place,
                   what +
                       ": a first or second derivative is not finite at the start, as that of u^p with p < 2 "
                       "at u = 0, also "
                       "in max(0, u)^p, for which if(u > 0, u^p, 0) can be written; move the start or mend "
                       "the formula there");
}

}  // namespace

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
  Vector f(v.size());
  functions.force->value(t, q, v, f);
  if (f.allFinite()) return;
  require_outputs_defined(scene, *program.force, "the force", start, v);
  fail_at_start(scene, "the force", {});
}

}  // namespace diracstep
