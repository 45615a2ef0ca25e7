#include <diracstep/boundary_values/detail/control_program.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <exception>

#ifdef DIRACSTEP_WITH_IPOPT

#define HAVE_CSTDDEF 1  // what headers of Ipopt 3.11 ask for
#include <IpIpoptApplication.hpp>
#include <IpSolveStatistics.hpp>
#include <IpTNLP.hpp>

namespace diracstep::boundary {

namespace {

using Ipopt::Index;
using Ipopt::Number;

/// A control program as Ipopt asks for it.  An exception is kept, and ends the search.
class Program final : public Ipopt::TNLP {
 public:
  Program(ControlProgram& program, const std::function<bool()>& go_on, Vector& u)
      : program_(program), go_on_(go_on), u_(u), jacobian_(program.jacobian(u)) {
    hessian_ = program.hessian_entries();
  }

  std::exception_ptr failure;
  int iterations = 0;

  bool get_nlp_info(Index& n, Index& m, Index& of_jacobian, Index& of_hessian,
                    IndexStyleEnum& style) override {
    n = program_.unknowns();
    m = program_.equations();
    of_jacobian = static_cast<Index>(jacobian_.nonZeros());
    of_hessian = static_cast<Index>(hessian_.size());
    style = C_STYLE;
    return true;
  }

  bool get_bounds_info(Index n, Number* lower, Number* upper, Index m, Number* c_lower,
                       Number* c_upper) override {
    constexpr double none = 2e19;  // Ipopt's infinity is 1e19
    Eigen::Map<Vector>(lower, n) = program_.lower().cwiseMax(-none);
    Eigen::Map<Vector>(upper, n) = program_.upper().cwiseMin(none);
    Eigen::Map<Vector>(c_lower, m).setZero();
    Eigen::Map<Vector>(c_upper, m).setZero();
    return true;
  }

  bool get_starting_point(Index n, bool, Number* x, bool, Number*, Number*, Index, bool, Number*) override {
    Eigen::Map<Vector>(x, n) = u_;
    return true;
  }

  bool eval_f(Index n, const Number* x, bool, Number& value) override {
    return guarded([&] {
      value = program_.cost(at(n, x));
      return std::isfinite(value);
    });
  }

  bool eval_grad_f(Index n, const Number* x, bool, Number* gradient) override {
    return guarded([&] {
      Eigen::Map<Vector> out(gradient, n);
      out = program_.gradient(at(n, x));
      return out.allFinite();
    });
  }

  bool eval_g(Index n, const Number* x, bool, Index m, Number* g) override {
    return guarded([&] {
      Eigen::Map<Vector> out(g, m);
      out = program_.residual(at(n, x));
      return out.allFinite();
    });
  }

  bool eval_jac_g(Index n, const Number* x, bool, Index, Index count, Index* rows, Index* columns,
                  Number* values) override {
    return guarded([&] {
      if (values == nullptr) {
        Index k = 0;
        for (int c = 0; c < jacobian_.outerSize(); ++c)
          for (Sparse::InnerIterator e(jacobian_, c); e; ++e, ++k) {
            rows[k] = static_cast<Index>(e.row());
            columns[k] = c;
          }
        return true;
      }
      const Sparse now = program_.jacobian(at(n, x));
      if (now.nonZeros() != jacobian_.nonZeros()) throw Error("the pattern of the Jacobian changes");
      Eigen::Map<Vector> out(values, count);
      out = Eigen::Map<const Vector>(now.valuePtr(), count);
      return out.allFinite();
    });
  }

  bool eval_h(Index n, const Number* x, bool, Number factor, Index m, const Number* multipliers, bool,
              Index count, Index* rows, Index* columns, Number* values) override {
    return guarded([&] {
      if (values == nullptr) {
        for (std::size_t k = 0; k < hessian_.size(); ++k) {
          rows[k] = hessian_[k].first;
          columns[k] = hessian_[k].second;
        }
        return true;
      }
      Eigen::Map<Vector> out(values, count);
      out = program_.hessian(at(n, x), factor, Eigen::Map<const Vector>(multipliers, m));
      return out.allFinite();
    });
  }

  bool intermediate_callback(Ipopt::AlgorithmMode, Index, Number, Number, Number, Number, Number, Number,
                             Number, Number, Index, const Ipopt::IpoptData*,
                             Ipopt::IpoptCalculatedQuantities*) override {
    return !go_on_ || go_on_();
  }

  void finalize_solution(Ipopt::SolverReturn, Index n, const Number* x, const Number*, const Number*, Index,
                         const Number*, const Number*, Number, const Ipopt::IpoptData*,
                         Ipopt::IpoptCalculatedQuantities*) override {
    u_ = at(n, x);
  }

 private:
  static Vector at(Index n, const Number* x) { return Eigen::Map<const Vector>(x, n); }

  template <class Work>
  bool guarded(Work work) {
    if (failure) return false;
    try {
      return work();
    } catch (...) {
      failure = std::current_exception();
      return false;
    }
  }

  ControlProgram& program_;
  const std::function<bool()>& go_on_;
  Vector& u_;
  Sparse jacobian_;
  std::vector<std::pair<int, int>> hessian_;
};

std::string words(Ipopt::ApplicationReturnStatus status) {
  switch (status) {
    case Ipopt::Solve_Succeeded:
      return "the optimality conditions hold to the tolerance";
    case Ipopt::Solved_To_Acceptable_Level:
      return "the optimality conditions hold as far as round-off lets them, not to the tolerance";
    case Ipopt::Infeasible_Problem_Detected:
      return "no controls near the guess lead from the one end to the other: more time, other bounds or "
             "another "
             "guess may help";
    case Ipopt::Not_Enough_Degrees_Of_Freedom:
      return "there are more conditions than controls can fulfil: more steps or fewer conditions are needed";
    case Ipopt::Maximum_Iterations_Exceeded:
      return "the iterations are used up";
    case Ipopt::Restoration_Failed:
    case Ipopt::Search_Direction_Becomes_Too_Small:
      return "no step of the search comes nearer to a solution: more steps or another guess may help";
    case Ipopt::User_Requested_Stop:
      return "interrupted";
    case Ipopt::Diverging_Iterates:
      return "the iterates grow without bound: the cost may have no minimum";
    default:
      return "Ipopt has ended with status " + std::to_string(static_cast<int>(status));
  }
}

}  // namespace

InteriorPointReport solve(ControlProgram& program, int max_iterations, double tolerance,
                          const std::function<bool()>& go_on, Vector& u) {
  Ipopt::SmartPtr<Program> of = new Program(program, go_on, u);
  Ipopt::SmartPtr<Ipopt::IpoptApplication> application = new Ipopt::IpoptApplication(false);
  application->Options()->SetStringValue("sb", "yes");
  application->Options()->SetIntegerValue("print_level", 0);
  application->Options()->SetIntegerValue("max_iter", max_iterations);
  application->Options()->SetNumericValue("tol", tolerance);
  application->Options()->SetNumericValue("constr_viol_tol", tolerance);
  // Bounds are bounds: not relaxed by round-off.
  application->Options()->SetStringValue("honor_original_bounds", "yes");
  if (application->Initialize("") != Ipopt::Solve_Succeeded) throw Error("Ipopt cannot be set up");
  const Ipopt::ApplicationReturnStatus status =
      application->OptimizeTNLP(Ipopt::SmartPtr<Ipopt::TNLP>(Ipopt::GetRawPtr(of)));
  if (of->failure) std::rethrow_exception(of->failure);
  InteriorPointReport report;
  report.converged = status == Ipopt::Solve_Succeeded || status == Ipopt::Solved_To_Acceptable_Level;
  report.ending = words(status);
  if (Ipopt::IsValid(application->Statistics()))
    report.iterations = application->Statistics()->IterationCount();
  return report;
}

}  // namespace diracstep::boundary

#else

namespace diracstep::boundary {

InteriorPointReport solve(ControlProgram&, int, double, const std::function<bool()>&, Vector&) {
  throw Misuse(
      "optimal control needs Ipopt, and this library was built without: install coinor-libipopt-dev, then "
      "run "
      "cmake again");
}

}  // namespace diracstep::boundary

#endif
